// SPDX-License-Identifier: Apache-2.0
//
// Results of one page on their way to its images: blocks of finished texels in a scratch pack.
//
// They come in the order in which pieces are finished, and are found again by an index that is in
// memory: 16 bytes per block and channel.
//
// Images need rows from top to bottom, and padding needs the rows below as well. Waiting for those
// in memory would cost an image's size; on disk it costs a scratch file. The index is not part of
// the pack, which nobody else opens.
#include "flow/project/results.h"

#include "mesh/lattice.h"

namespace pounce::flow {
namespace {

std::uint32_t blocks_across(std::uint32_t texels) {
  return (texels + mesh::kBlockEdge - 1) / mesh::kBlockEdge;
}

}  // namespace

void finish_block(job::JobContext& job, const shading::TexelFormat& format,
                  const shading::ResultBlock& result, std::size_t c, std::size_t b,
                  PieceWork& work) {
  std::vector<std::byte> raw;
  shading::encode(result, format, raw);
  work.raw_bytes[c] = static_cast<std::uint32_t>(raw.size());
  job.compressor().compress(raw, work.stored[c][b], store::kScratchLevel);
}

ResultCollector::ResultCollector(job::JobContext& job, const store::GeometryStore& target,
                                 std::size_t channels)
    : job_(job),
      target_(target),
      across_(blocks_across(target.directory().pages.front().width)),
      index_lease_(job.budget, index_bytes(target.directory().pages.front(), channels),
                   "the index of the results"),
      writer_(job.scratch->create(store::PackKind::results, Hash128{})) {
  result_.covered.assign(channels, 0);
  result_.blocks.assign(
      channels, std::vector<store::ChunkRef>(
                    std::size_t{across_} * blocks_across(target.directory().pages.front().height)));
  result_.clipped.assign(channels, 0);
}

std::uint64_t ResultCollector::index_bytes(const mesh::Lattice& page, std::size_t channels) {
  return std::uint64_t{blocks_across(page.width)} * blocks_across(page.height) *
         sizeof(store::ChunkRef) * channels;
}

std::uint64_t ResultCollector::store(const PieceWork& work) {
  std::uint64_t texels = 0, bytes = 0;
  for (std::size_t b = 0; b < work.blocks.size(); ++b) {
    const store::BlockEntry& entry = work.blocks[b];
    texels += entry.texels;
    const auto slot =
        static_cast<std::size_t>(entry.y) * across_ + static_cast<std::size_t>(entry.x);
    for (std::size_t c = 0; c < result_.blocks.size(); ++c) {
      const auto& stored = work.stored[c][b];
      if (stored.empty()) continue;
      // The second block would silently replace the first one.
      if (result_.blocks[c][slot].raw_bytes != 0) target_.damaged("duplicate block");
      result_.blocks[c][slot] = writer_->append(store::ChunkKind::block, stored, work.raw_bytes[c]);
      bytes += stored.size();
    }
  }
  for (std::size_t c = 0; c < result_.covered.size(); ++c) result_.covered[c] += work.covered[c];
  for (std::size_t i = 0; i < kDistanceBins; ++i) result_.distances[i] += work.distances[i];
  result_.distance_steps += work.distance_steps;
  for (std::size_t c = 0; c < work.clipped.size(); ++c) result_.clipped[c] += work.clipped[c];
  job_.meter.advance(texels);
  return bytes;
}

PageResult ResultCollector::finish() {
  // A pack ends with a directory. This one's is empty.
  std::vector<std::byte> nothing(1), stored;
  job_.compressor().compress(nothing, stored);
  writer_->finish(writer_->append(store::ChunkKind::directory, stored, 1));
  result_.pack = publish_scratch(job_, std::move(writer_));
  return std::move(result_);
}

}  // namespace pounce::flow
