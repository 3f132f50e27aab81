// SPDX-License-Identifier: Apache-2.0
//
// Unlike the pack of a job that is under way (result_records.h), which may end anywhere, this one
// is whole: its directory holds the place of every block, as that of hits does, and the sums.
#include "store/blocks/result_store.h"

#include <algorithm>
#include <utility>

#include "core/bytes.h"
#include "store/pack/pack_layout.h"

namespace pounce::store {
namespace {

/// Instead of a block that covers nothing: the first place that a chunk may have.
constexpr ChunkRef kNothing{kPackHeaderBytes, 0, 0};
constexpr std::size_t kHeaderBytes = 12, kChunkRefBytes = 16;

std::size_t directory_bytes(const ResultGrid& grid) {
  return kHeaderBytes + grid.blocks() * grid.channels * kChunkRefBytes +
         (2 * grid.channels + kDistanceBins + 1) * sizeof(std::uint64_t);
}

/// What does not compress grows by a 256th, and by some bytes.
bool may_be_stored_as(const ChunkRef& block, std::uint32_t raw_bytes) {
  constexpr std::uint32_t kSome = 1024;
  return block.raw_bytes == raw_bytes && block.stored_bytes <= raw_bytes + raw_bytes / 128 + kSome;
}

void check(const ResultCounts& counts, const ResultStore::Facts& facts, const ByteReader& in) {
  constexpr std::uint64_t kMostSamples = 4, kDistanceSteps = 65536;
  const auto is_most = [](const auto& values, std::uint64_t most) {
    return std::all_of(values.begin(), values.end(), [&](auto value) { return value <= most; });
  };
  std::uint64_t found = 0;
  const bool may_be = is_most(counts.covered, facts.texels) &&
                      is_most(counts.clipped, kMostSamples * facts.texels) &&
                      is_most(counts.distances, facts.texels) &&
                      counts.distance_steps <= kDistanceSteps * facts.texels;
  for (const std::uint64_t of_bin : counts.distances) found += of_bin;
  if (!may_be || found > facts.texels) in.fail("counts more texels than its image has");
}

}  // namespace

ResultStoreWriter::ResultStoreWriter(std::unique_ptr<PackWriter> pack, const ResultGrid& grid)
    : pack_(std::move(pack)),
      grid_(grid),
      blocks_(grid.channels, std::vector<ChunkRef>(grid.blocks(), kNothing)) {}

void ResultStoreWriter::add(std::size_t channel, std::int32_t x, std::int32_t y,
                            std::span<const std::byte> stored, std::uint32_t raw_bytes) {
  blocks_[channel][grid_.slot(x, y)] = pack_->append(ChunkKind::block, stored, raw_bytes);
}

std::unique_ptr<PackWriter> ResultStoreWriter::finish(const ResultCounts& counts,
                                                      Compressor& compressor) {
  std::vector<std::byte> raw;
  raw.reserve(directory_bytes(grid_));
  ByteWriter out(raw);
  out.put_all(grid_.across, grid_.down, static_cast<std::uint32_t>(grid_.channels));
  for (const auto& of_channel : blocks_) {
    for (const ChunkRef& block : of_channel) put_chunk(out, block);
  }
  const auto put_each = [&](std::vector<std::uint64_t> values) {
    values.resize(grid_.channels);
    out.put_span(std::span<const std::uint64_t>(values));
  };
  put_each(counts.covered);
  put_each(counts.clipped);
  out.put_span(std::span<const std::uint64_t>(counts.distances));
  out.put(counts.distance_steps);
  pack_->finish(append_payload(*pack_, ChunkKind::directory, raw, compressor));
  return std::move(pack_);
}

ResultStore ResultStore::open(std::unique_ptr<PackReader> pack, const Facts& facts,
                              Compressor& compressor) {
  const ResultGrid& grid = facts.grid;
  const auto raw = read_payload(*pack, pack->directory(), ChunkKind::directory,
                                directory_bytes(grid), compressor);
  ByteReader in(raw, pack->name() + ": directory");
  std::uint32_t across = 0, down = 0, channels = 0;
  in.get_all(across, down, channels);
  // The key names both stores and the formats, so others mean damage, not another job.
  if (across != grid.across || down != grid.down || channels != grid.channels)
    in.fail("belongs to another image");
  if (raw.size() != directory_bytes(grid)) in.fail("has a different size than its image requires");
  ResultStore store{std::move(pack), {}, {}};
  store.blocks.assign(grid.channels, std::vector<ChunkRef>(grid.blocks()));
  for (std::size_t c = 0; c < grid.channels; ++c) {
    for (ChunkRef& block : store.blocks[c]) {
      const ChunkRef read = get_chunk(in);
      if (read == kNothing) continue;
      if (!may_be_stored_as(read, facts.block_bytes[c])) in.fail("has a block of another size");
      block = read;
    }
  }
  store.counts.covered.resize(grid.channels);
  store.counts.clipped.resize(grid.channels);
  in.get_span(std::span(store.counts.covered));
  in.get_span(std::span(store.counts.clipped));
  in.get_span(std::span<std::uint64_t>(store.counts.distances));
  in.get_all(store.counts.distance_steps);
  check(store.counts, facts, in);
  return store;
}

}  // namespace pounce::store
