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
#include <array>
#include <optional>
#include <utility>

#include "core/bytes.h"
#include "mesh/lattice.h"
#include "pounce/error.h"
#include "store/pack/pack_layout.h"

namespace pounce::flow {
namespace {

std::uint32_t blocks_across(std::uint32_t texels) {
  return (texels + mesh::kBlockEdge - 1) / mesh::kBlockEdge;
}

/// What a record states is held against what can be before it is believed.
constexpr std::uint64_t kMostTexels = store::kTexelsPerBlock;

/// What a record states. Layout: docs/tile-format-colours.md.
struct Record {
  struct Block {
    std::int32_t x = 0, y = 0;
    std::vector<bool> has_chunk;  ///< [channel]
  };
  std::vector<Block> blocks;
  std::size_t chunks = 0;    ///< that precede it
  std::uint64_t texels = 0;  ///< of its blocks, which the target covers
  outcome::PageFound found;
  std::vector<std::uint64_t> clipped;
  std::uint64_t target_texels = 0;  ///< of the whole page
  std::uint64_t worked_ms = 0;      ///< by all runs so far
};

/// What is the same for all records of a pack.
struct RecordFrame {
  std::uint32_t across = 0, down = 0;
  std::size_t channels = 0;
};

bool names_twice(const Record& record) {
  std::vector<std::pair<std::int32_t, std::int32_t>> places;
  for (const Record::Block& block : record.blocks) places.emplace_back(block.x, block.y);
  std::sort(places.begin(), places.end());
  return std::adjacent_find(places.begin(), places.end()) != places.end();
}

/// Nothing where it states what cannot be.
std::optional<Record> parse_record(std::span<const std::byte> bytes, const RecordFrame& frame) {
  try {
    ByteReader in(bytes, "a record of results");
    Record record;
    const auto count = in.get<std::uint32_t>();
    if (count > std::uint64_t{frame.across} * frame.down) return std::nullopt;
    for (std::uint32_t b = 0; b < count; ++b) {
      const auto x = in.get<std::uint32_t>(), y = in.get<std::uint32_t>();
      const auto texels = in.get<std::uint32_t>();
      if (x >= frame.across || y >= frame.down || texels > kMostTexels) return std::nullopt;
      Record::Block& block = record.blocks.emplace_back();
      block.x = static_cast<std::int32_t>(x);
      block.y = static_cast<std::int32_t>(y);
      record.texels += texels;
      for (std::size_t c = 0; c < frame.channels; ++c) {
        block.has_chunk.push_back(in.get<std::uint8_t>() != 0);
        record.chunks += block.has_chunk.back() ? 1 : 0;
      }
    }
    record.found.covered.resize(frame.channels);
    record.clipped.resize(frame.channels);
    in.get_span(std::span(record.found.covered));
    in.get_span(std::span(record.clipped));
    in.get_span(std::span<std::uint64_t>(record.found.distances));
    in.get_all(record.found.distance_steps, record.target_texels, record.worked_ms);
    if (in.left() != 0 || names_twice(record)) return std::nullopt;
    return record;
  } catch (const Error& e) {
    if (e.kind() != ErrorKind::damaged_store) throw;
    return std::nullopt;
  }
}

/// Of a map's entry, with what it and the allocator add.
constexpr std::uint64_t kEncodedIndexBytes = 128;
/// Before the bytes of an encoded block: image, number, hash of its rows.
constexpr std::size_t kEncodedHeaderBytes = 24;

/// Encoded rows in the pack of a step's results.
class KeptEncodings final : public io::EncodedBlocks {
 public:
  KeptEncodings(job::StepPack& pack, const EncodedIndex& index, std::uint32_t image)
      : pack_(pack), reader_(pack.reader()), index_(index), image_(image) {}

  bool find(std::uint32_t block, const Hash128& rows, std::vector<std::byte>& encoded) override {
    const auto found = index_.find({image_, block});
    if (found == index_.end() || found->second.rows != rows) return false;
    reader_->read(found->second.chunk, store::ChunkKind::encoded, encoded);
    encoded.erase(encoded.begin(), encoded.begin() + kEncodedHeaderBytes);
    return true;
  }

  void put(std::uint32_t block, const Hash128& rows, std::span<const std::byte> encoded) override {
    if (is_full_) return;
    chunk_.clear();
    ByteWriter out(chunk_);
    out.put_all(image_, block, rows.hi, rows.lo);
    out.put_span(encoded);
    try {
      pack_.writer().append(store::ChunkKind::encoded, chunk_,
                            static_cast<std::uint32_t>(chunk_.size()));
      pack_.commit();
    } catch (const Error& e) {
      // This job needs them not: a disk that has no room for them may have some for the image.
      if (e.kind() != ErrorKind::storage) throw;
      is_full_ = true;
    }
  }

 private:
  job::StepPack& pack_;
  const std::unique_ptr<store::PackReader> reader_;
  const EncodedIndex& index_;
  const std::uint32_t image_;
  bool is_full_ = false;
  std::vector<std::byte> chunk_;
};

}  // namespace

ResultCollector::ResultCollector(job::JobContext& job, const store::GeometryStore& target,
                                 std::size_t channels, const Hash128& key)
    : job_(job),
      target_(target),
      across_(blocks_across(target.directory().pages.front().width)),
      down_(blocks_across(target.directory().pages.front().height)),
      index_lease_(job.budget, index_bytes(target.directory().pages.front(), channels),
                   "the index of the results"),
      result_([&] {
        PageResult none;
        none.covered.assign(channels, 0);
        none.clipped.assign(channels, 0);
        none.blocks.assign(channels, std::vector<store::ChunkRef>(std::size_t{across_} * down_));
        return none;
      }()),
      made_(std::size_t{across_} * down_, false),
      pack_(std::make_unique<job::StepPack>(job, store::PackKind::results, key, earlier())) {
  waiting_ = {};
  try {
    encoded_lease_ = runtime::Lease(job.budget, encoded_.size() * kEncodedIndexBytes,
                                    "the index of encoded rows");
  } catch (const Error& e) {
    if (e.kind() != ErrorKind::budget) throw;
    encoded_ = {};  // they are encoded again
  }
}

std::uint64_t ResultCollector::index_bytes(const mesh::Lattice& page, std::size_t channels) {
  const std::uint64_t blocks =
      std::uint64_t{blocks_across(page.width)} * blocks_across(page.height);
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
  const auto record = parse_record(bytes, {across_, down_, result_.blocks.size()});
  if (!record || record->chunks != chunks.size()) return false;
  for (const Record::Block& block : record->blocks) {
    if (made_[slot_of(block.x, block.y)]) return false;
  }
  auto next = chunks.begin();
  for (const Record::Block& block : record->blocks) {
    const std::size_t slot = slot_of(block.x, block.y);
    made_[slot] = true;
    for (std::size_t c = 0; c < result_.blocks.size(); ++c) {
      if (block.has_chunk[c]) result_.blocks[c][slot] = *next++;
    }
  }
  for (std::size_t c = 0; c < result_.covered.size(); ++c) {
    result_.covered[c] += record->found.covered[c];
    result_.clipped[c] += record->clipped[c];
  }
  for (std::size_t i = 0; i < kDistanceBins; ++i)
    result_.distances[i] += record->found.distances[i];
  result_.distance_steps += record->found.distance_steps;
  kept_texels_ += record->texels;
  earlier_ms_ = record->worked_ms;
  return true;
}

bool ResultCollector::take_encoded(const store::ChunkRef& chunk,
                                   std::span<const std::byte> stored) {
  if (!waiting_.empty() || stored.size() < kEncodedHeaderBytes) return false;
  ByteReader in(stored, "encoded rows");
  const auto image = in.get<std::uint32_t>(), block = in.get<std::uint32_t>();
  const auto hi = in.get<std::uint64_t>(), lo = in.get<std::uint64_t>();
  encoded_[{image, block}] = {chunk, {hi, lo}};
  return true;
}

void ResultCollector::append_record(const PieceWork& work) {
  record_.clear();
  ByteWriter out(record_);
  out.put(static_cast<std::uint32_t>(work.blocks.size()));
  for (std::size_t b = 0; b < work.blocks.size(); ++b) {
    const store::BlockEntry& entry = work.blocks[b];
    out.put_all(static_cast<std::uint32_t>(entry.x), static_cast<std::uint32_t>(entry.y),
                static_cast<std::uint32_t>(entry.texels));
    for (std::size_t c = 0; c < result_.blocks.size(); ++c)
      out.put(static_cast<std::uint8_t>(work.stored[c][b].empty() ? 0 : 1));
  }
  std::vector<std::uint64_t> clipped = work.clipped;
  clipped.resize(result_.clipped.size());
  out.put_span(std::span<const std::uint64_t>(work.covered));
  out.put_span(std::span<const std::uint64_t>(clipped));
  out.put_span(std::span<const std::uint64_t>(work.distances));
  out.put_all(work.distance_steps, target_.directory().texels,
              earlier_ms_ + static_cast<std::uint64_t>(pack_->worked().count()));
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
    const std::size_t slot = slot_of(entry.x, entry.y);
    for (std::size_t c = 0; c < result_.blocks.size(); ++c) {
      const auto& stored = work.stored[c][b];
      if (stored.empty()) continue;
      // The second block would silently replace the first one.
      if (result_.blocks[c][slot].raw_bytes != 0) target_.damaged("duplicate block");
      result_.blocks[c][slot] =
          pack_->writer().append(store::ChunkKind::block, stored, work.raw_bytes[c]);
      bytes += stored.size();
    }
  }
  for (std::size_t c = 0; c < result_.covered.size(); ++c) result_.covered[c] += work.covered[c];
  for (std::size_t i = 0; i < kDistanceBins; ++i) result_.distances[i] += work.distances[i];
  result_.distance_steps += work.distance_steps;
  for (std::size_t c = 0; c < work.clipped.size(); ++c) result_.clipped[c] += work.clipped[c];
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
  return std::make_unique<KeptEncodings>(*pack_, encoded_, image);
}

// --- for a plan ----------------------------------------------------------------------------------

Hash128 results_key(const planning::PassPlan& pass, const planning::TargetPlan& target,
                    std::size_t page) {
  Hasher hasher;
  hasher.add(std::string_view("results"));
  hasher.add(store::kFormatVersion);
  for (const std::size_t c : pass.channels)
    hasher.add(std::string_view(target.images[c][page].job));
  return hasher.digest();
}

std::optional<HalfDone> half_done(job::JobContext& job, const mesh::Lattice& page,
                                  std::size_t channels, const Hash128& key) {
  const auto file = job::StepPack::find(job, key);
  if (file == nullptr) return std::nullopt;
  const RecordFrame frame{blocks_across(page.width), blocks_across(page.height), channels};
  HalfDone done;
  store::scan_pack(*file, store::PackKind::results, key,
                   [&](store::ChunkKind kind, const store::ChunkRef&,
                       std::span<const std::byte> stored, const store::PackScan&) {
                     if (kind != store::ChunkKind::record) return true;
                     const auto record = parse_record(stored, frame);
                     if (!record) return false;
                     done.blocks += record->blocks.size();
                     done.texels += record->texels;
                     done.of_texels = record->target_texels;
                     done.worked_s = static_cast<double>(record->worked_ms) / 1000;
                     return true;
                   });
  if (done.blocks == 0) return std::nullopt;
  return done;
}

}  // namespace pounce::flow
