// SPDX-License-Identifier: Apache-2.0
//
// Blocks come in the order in which pieces are finished, and are found again by an index that is in
// memory: 16 bytes per block and channel. Images need rows from top to bottom, and padding needs
// the rows below as well. Waiting for those in memory would cost an image's size; on disk it costs
// a scratch file.
//
// Behind a piece's blocks its record follows: which blocks they are, those that cover nothing too,
// and what was counted in them. A run that finds the pack of one that died counts as made what
// sound records name, and nothing else. All counts are integers, so it does not matter how the
// pieces of the two runs were cut.
#include "flow/project/results.h"

#include <algorithm>
#include <utility>

#include "pounce/error.h"

namespace pounce::flow {

ResultCollector::ResultCollector(job::JobContext& job, const store::GeometryStore& target,
                                 std::size_t channels, const Hash128& key)
    : job_(job),
      target_(target),
      grid_(target.directory().pages.front(), channels),
      index_lease_(job.budget, index_bytes(target.directory().pages.front(), channels),
                   "the index of the results"),
      made_(grid_.blocks(), false) {
  result_.covered.assign(channels, 0);
  result_.clipped.assign(channels, 0);
  result_.blocks.assign(channels, std::vector<store::ChunkRef>(grid_.blocks()));
  pack_ = std::make_unique<job::StepPack>(job, store::PackKind::results, key, earlier());
  waiting_ = {};
  for (const auto& [place, block] : encoded_)
    pack_->take_spare(block.chunk.stored_bytes + store::kChunkHeaderBytes);
  try {
    encoded_lease_ = runtime::Lease(job.budget, encoded_.size() * job::kKeptBlockBytes,
                                    "the index of encoded rows");
  } catch (const Error& e) {
    if (e.kind() != ErrorKind::budget) throw;
    encoded_ = {};  // they are encoded again
  }
}

std::uint64_t ResultCollector::index_bytes(const mesh::Lattice& page, std::size_t channels) {
  const std::uint64_t blocks = store::ResultGrid(page, channels).blocks();
  return blocks * sizeof(store::ChunkRef) * channels + blocks / 8 + 8;
}

// --- what an earlier run left --------------------------------------------------------------------

job::StepPack::Earlier ResultCollector::earlier() {
  job::StepPack::Earlier earlier;
  earlier.take = [this](store::ChunkKind kind, const store::ChunkRef& ref,
                        std::span<const std::byte> stored) {
    if (kind == store::ChunkKind::record) return take_record(stored);
    if (kind == store::ChunkKind::encoded) return take_encoded(ref, stored);
    if (kind != store::ChunkKind::block) return false;
    waiting_.push_back(ref);
    return true;
  };
  earlier.is_end = [](store::ChunkKind kind) { return kind != store::ChunkKind::block; };
  return earlier;
}

/// Counts what a record names; false, and nothing is counted, if it does not fit the chunks before
/// it, or this page.
bool ResultCollector::take_record(std::span<const std::byte> bytes) {
  const auto chunks = std::exchange(waiting_, {});
  const auto record = store::decode_record(bytes, grid_);
  if (!record || record->chunks() != chunks.size()) return false;
  const auto is_made = [&](const auto& block) { return made_[grid_.slot(block.x, block.y)]; };
  if (std::any_of(record->blocks.begin(), record->blocks.end(), is_made)) return false;
  auto next = chunks.begin();
  for (const store::ResultRecord::Block& block : record->blocks) {
    const std::size_t slot = grid_.slot(block.x, block.y);
    made_[slot] = true;
    for (std::size_t c = 0; c < grid_.channels; ++c) {
      if (block.has_chunk[c]) result_.blocks[c][slot] = *next++;
    }
  }
  result_.add(record->counts);
  kept_texels_ += record->texels();
  earlier_ms_ = record->worked_ms;
  return true;
}

bool ResultCollector::take_encoded(const store::ChunkRef& chunk,
                                   std::span<const std::byte> stored) {
  const auto rows = store::decode_encoded_rows(stored);
  if (!rows || !waiting_.empty()) return false;
  encoded_[{rows->image, rows->block}] = {chunk, rows->rows};
  return true;
}

void ResultCollector::append_record(const PieceWork& work) {
  store::ResultRecord record;
  for (std::size_t b = 0; b < work.blocks.size(); ++b) {
    const store::BlockEntry& entry = work.blocks[b];
    record.blocks.push_back({entry.x, entry.y, entry.texels, {}});
    for (std::size_t c = 0; c < grid_.channels; ++c)
      record.blocks.back().has_chunk.push_back(!work.stored[c][b].empty());
  }
  record.counts = work;
  record.counts.clipped.resize(grid_.channels);
  record.page_texels = target_.directory().texels;
  record.worked_ms = earlier_ms_ + static_cast<std::uint64_t>(pack_->worked().count());
  store::encode(record, record_);
  pack_->writer().append(store::ChunkKind::record, record_,
                         static_cast<std::uint32_t>(record_.size()));
  pack_->commit();
}

// --- what this run makes -------------------------------------------------------------------------

std::uint64_t ResultCollector::store(const PieceWork& work) {
  std::uint64_t texels = 0, bytes = 0;
  for (std::size_t b = 0; b < work.blocks.size(); ++b) {
    const store::BlockEntry& entry = work.blocks[b];
    texels += entry.texels;
    const std::size_t slot = grid_.slot(entry.x, entry.y);
    for (std::size_t c = 0; c < grid_.channels; ++c) {
      const auto& stored = work.stored[c][b];
      if (stored.empty()) continue;
      // The second block would silently replace the first one.
      if (result_.blocks[c][slot].raw_bytes != 0) target_.damaged("duplicate block");
      result_.blocks[c][slot] =
          pack_->writer().append(store::ChunkKind::block, stored, work.raw_bytes[c]);
      bytes += stored.size();
    }
  }
  result_.add(work);
  append_record(work);
  job_.meter.advance(texels);
  return bytes;
}

PageResult ResultCollector::finish() {
  result_.pack = pack_->reader();
  return std::move(result_);
}

std::unique_ptr<io::EncodedBlocks> ResultCollector::encodings(std::uint32_t image) {
  if (!pack_->is_kept()) return nullptr;
  return std::make_unique<job::KeptEncodings>(*pack_, encoded_, image);
}

}  // namespace pounce::flow
