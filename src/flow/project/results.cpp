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
#include <set>
#include <utility>

#include "planning/task_share.h"
#include "pounce/error.h"

namespace pounce::flow {

ResultCollector::ResultCollector(job::JobContext& job, const store::GeometryStore& target,
                                 std::size_t channels, const Hash128& key, const ResultShare& share)
    : job_(job),
      target_(target),
      index_(target.directory().pages.front(), channels),
      index_lease_(job.budget,
                   store::ResultIndex::size_bytes(target.directory().pages.front(), channels),
                   "the index of the results") {
  if (share.tasks != nullptr && share.role == TaskRole::share) {
    begin_part(key, share);
    return;
  }
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
  went_on_with_ = index_.texels();
  texels_left_ = target.directory().texels - std::min(target.directory().texels, index_.texels());
  if (share.role == TaskRole::assemble) take_parts(key, share);
}

/// Leaves out what other tasks make, and what is there.
void ResultCollector::begin_part(const Hash128& key, const ResultShare& share) {
  const job::PartFiles parts(job_, key);
  parts.count(index_);
  bool any_left = false;  // a block may have no texels
  planning::visit_tasks(target_, job_.compressor(), *share.tasks,
                        [&](const store::BlockEntry& entry, std::uint32_t task) {
                          if (has(entry)) return;
                          if (task != share.task) return index_.leave_out(entry.x, entry.y);
                          texels_left_ += entry.texels;
                          any_left = true;
                        });
  if (any_left) part_ = parts.create();
}

/// What tasks have made, and who has to make the rest.
void ResultCollector::take_parts(const Hash128& key, const ResultShare& share) {
  const std::optional<Error> unread = job::PartFiles(job_, key).copy(index_, pack_->writer());
  texels_left_ = target_.directory().texels - index_.texels();
  // What could not be read may be whole: a task that made it again would find it there.
  if (unread && texels_left_ > 0) throw Error(*unread);
  if (share.tasks == nullptr || texels_left_ == 0) return;
  std::set<std::uint32_t> tasks;
  planning::visit_tasks(target_, job_.compressor(), *share.tasks,
                        [&](const store::BlockEntry& entry, std::uint32_t task) {
                          if (!has(entry)) tasks.insert(task);
                        });
  missing_tasks_.assign(tasks.begin(), tasks.end());
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

bool ResultCollector::take_record(std::span<const std::byte> bytes) {
  const auto chunks = std::exchange(waiting_, {});
  const auto record = store::decode_record(bytes, index_.grid());
  if (!record || !index_.take(*record, chunks)) return false;
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
    for (const auto& stored : work.stored)
      record.blocks.back().has_chunk.push_back(!stored[b].empty());
  }
  record.counts = work;
  record.counts.clipped.resize(work.stored.size());
  record.page_texels = target_.directory().texels;
  record.worked_ms = earlier_ms_ + static_cast<std::uint64_t>(worked().count());
  store::encode(record, record_);
  writer().append(store::ChunkKind::record, record_, static_cast<std::uint32_t>(record_.size()));
  if (pack_ != nullptr) return pack_->commit();
  // As StepPack does: a process that is killed loses a quarter of a second, a machine fifteen.
  constexpr auto kFlushEvery = std::chrono::milliseconds(250);
  constexpr auto kSyncEvery = std::chrono::seconds(15);
  const auto now = Clock::now();
  if (now - flushed_ < kFlushEvery) return;
  flushed_ = now;
  (void)part_.writer->file().reader();  // empties its buffer
  if (now - synced_ < kSyncEvery) return;
  part_.writer->file().sync();
  synced_ = now;
}

// --- what this run makes -------------------------------------------------------------------------

std::uint64_t ResultCollector::store(const PieceWork& work) {
  std::uint64_t texels = 0, bytes = 0;
  for (std::size_t b = 0; b < work.blocks.size(); ++b) {
    const store::BlockEntry& entry = work.blocks[b];
    texels += entry.texels;
    for (std::size_t c = 0; c < work.stored.size(); ++c) {
      const auto& stored = work.stored[c][b];
      if (stored.empty()) continue;
      store::ChunkRef& chunk = index_.chunk(c, entry.x, entry.y);
      // The second block would silently replace the first one.
      if (chunk.raw_bytes != 0) target_.damaged("duplicate block");
      chunk = writer().append(store::ChunkKind::block, stored, work.raw_bytes[c]);
      bytes += stored.size();
    }
  }
  made_.add(work);
  append_record(work);
  job_.meter.advance(texels);
  return bytes;
}

PageResult ResultCollector::finish() {
  PageResult result;
  result.covered.resize(index_.grid().channels);
  result.clipped.resize(index_.grid().channels);
  result.add(made_);
  if (part_.writer != nullptr) {
    job::PartFiles(job_, part_.writer->key()).finish(part_);
    result.written_bytes = part_.writer->size_bytes();
  }
  if (pack_ == nullptr) return result;
  result.add(index_);
  result.pack = pack_->reader();
  result.written_bytes = result.pack->size_bytes();
  result.blocks = std::move(index_.blocks());
  return result;
}

PageResult ResultCollector::take(store::ResultStore known) {
  PageResult result;
  static_cast<store::ResultCounts&>(result) = std::move(known.counts);
  result.pack = std::move(known.pack);
  index_.blocks() = std::move(known.blocks);  // whose memory is leased
  result.blocks = std::move(index_.blocks());
  result.is_known = true;
  job_.meter.advance(texels_left_);
  return result;
}

void ResultCollector::forget() noexcept {
  if (pack_ != nullptr) return pack_->forget();
  try {
    if (part_.writer != nullptr) job_.files->remove(part_.path);
  } catch (const Error&) {
    // It cannot be removed: then it cannot be replaced either, and who assembles it fails.
  }
}

std::unique_ptr<io::EncodedBlocks> ResultCollector::encodings(std::uint32_t image) {
  if (pack_ == nullptr || !pack_->is_kept()) return nullptr;
  return std::make_unique<job::KeptEncodings>(*pack_, encoded_, image);
}

}  // namespace pounce::flow
