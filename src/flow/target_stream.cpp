// SPDX-License-Identifier: Apache-2.0
#include "flow/target_stream.h"

#include <algorithm>

namespace pounce::flow {
namespace {

constexpr std::uint64_t kLargestShare = 32ULL << 20;  // beyond this a larger batch saves nothing

std::uint32_t blocks_across(std::uint32_t texels) {
  return (texels + mesh::kBlockEdge - 1) / mesh::kBlockEdge;
}

/// Bytes of one thread's share of the budget: a quarter of an equal one, so that pieces overlap.
std::uint64_t budget_share(const JobContext& job) {
  return std::min(kLargestShare,
                  job.budget.limit() / (4 * std::uint64_t{std::max(job.threads, 1U)}));
}

/// Cuts the target's tiles into pieces whose blocks' state fits `state_share`; `fixed` is what a
/// piece needs besides.
PieceList cut_pieces(JobContext& job, const tiles::GeometryStore& target, std::uint64_t fixed,
                     std::uint64_t state_share,
                     const std::function<std::uint64_t(const tiles::BlockEntry&)>& state_bytes) {
  PieceList list;
  for (std::uint32_t t = 0; t < target.directory().tiles.size(); ++t) {
    const auto blocks = target.read_index(t, job.compressor());
    Piece piece{blocks.front().page, t, 0, 0};
    if (!list.pieces.empty() && piece.page < list.pieces.back().page)
      target.damaged("its pages are out of order");
    std::uint64_t state = 0;
    const auto finish = [&] {
      if (piece.count == 0) return;
      list.pieces.push_back(piece);
      list.costs.push_back(fixed + state);
    };
    for (std::uint32_t b = 0; b < blocks.size(); ++b) {
      const std::uint64_t more = state_bytes(blocks[b]);
      if (piece.count > 0 && (piece.count == kMostBlocksPerPiece || state + more > state_share)) {
        finish();
        piece = {piece.page, t, b, 0};
        state = 0;
      }
      ++piece.count;
      state += more;
    }
    finish();
  }
  return list;
}

}  // namespace

std::pair<std::size_t, std::size_t> PieceList::of_page(std::uint32_t page) const {
  const auto [first, last] =
      std::equal_range(pieces.begin(), pieces.end(), Piece{page, 0, 0, 0},
                       [](const Piece& a, const Piece& b) { return a.page < b.page; });
  return {static_cast<std::size_t>(first - pieces.begin()),
          static_cast<std::size_t>(last - pieces.begin())};
}

CutTarget cut_target(JobContext& job, const tiles::GeometryStore& target, std::uint64_t fixed,
                     std::uint64_t least_batch,
                     const std::function<std::uint64_t(const tiles::BlockEntry&)>& state_bytes) {
  CutTarget cut;
  const std::uint64_t share = budget_share(job);
  cut.batch_bytes = std::max(least_batch, share > fixed ? (share - fixed) / 2 : 0);
  const std::uint64_t taken = fixed + cut.batch_bytes;
  cut.pieces = cut_pieces(job, target, taken, share > taken ? share - taken : 0, state_bytes);
  cut.index = Lease(job.budget, cut.pieces.size_bytes(), "the index of the target");
  const std::vector<std::uint64_t>& costs = cut.pieces.costs;
  if (!costs.empty()) {
    const Lease fits(job.budget, *std::max_element(costs.begin(), costs.end()),
                     "projecting one block of the target");
  }
  return cut;
}

void read_packets(JobContext& job, const tiles::GeometryStore& target, const Piece& piece,
                  float smallest_edge, target::TargetBlock::Start start, PieceWork& work,
                  PageVector<target::TexelPacket>& packets,
                  std::vector<target::PacketGroup>& groups) {
  const auto entries = target.read_index(piece.tile, job.compressor());
  work.blocks.assign(entries.begin() + piece.first, entries.begin() + piece.first + piece.count);
  std::size_t most_packets = 0;
  for (const auto& entry : work.blocks)
    most_packets += target::TargetBlock::most_packets(entry.texels);
  packets.reserve(most_packets);
  for (std::uint32_t b = 0; b < work.blocks.size(); ++b) {
    const tiles::BlockEntry& entry = work.blocks[b];
    const target::TargetBlock maps(target.read_block(entry, job.compressor()),
                                   target.directory().pages[entry.page], smallest_edge, start);
    maps.make_packets(b, packets, groups);
  }
}

void finish_block(JobContext& job, const texture::TexelFormat& format,
                  const texture::ResultBlock& result, std::size_t c, std::size_t b,
                  PieceWork& work) {
  std::vector<std::byte> raw;
  texture::encode(result, format, raw);
  work.raw_bytes[c] = static_cast<std::uint32_t>(raw.size());
  job.compressor().compress(raw, work.stored[c][b], tiles::kScratchLevel);
}

ResultCollector::ResultCollector(JobContext& job, const tiles::GeometryStore& target,
                                 const mesh::Lattice& page, std::size_t channels)
    : job_(job),
      target_(target),
      across_(blocks_across(page.width)),
      index_lease_(job.budget, index_bytes(page, channels), "the index of the results"),
      writer_(job.scratch->create(tiles::PackKind::results, Hash128{})) {
  result_.covered.assign(channels, 0);
  result_.blocks.assign(
      channels, std::vector<tiles::ChunkRef>(std::size_t{across_} * blocks_across(page.height)));
  result_.clipped.assign(channels, 0);
}

std::uint64_t ResultCollector::index_bytes(const mesh::Lattice& page, std::size_t channels) {
  return std::uint64_t{blocks_across(page.width)} * blocks_across(page.height) *
         sizeof(tiles::ChunkRef) * channels;
}

void ResultCollector::store(const PieceWork& work) {
  std::uint64_t texels = 0;
  for (std::size_t b = 0; b < work.blocks.size(); ++b) {
    const tiles::BlockEntry& entry = work.blocks[b];
    texels += entry.texels;
    const auto slot =
        static_cast<std::size_t>(entry.y) * across_ + static_cast<std::size_t>(entry.x);
    for (std::size_t c = 0; c < result_.blocks.size(); ++c) {
      const auto& stored = work.stored[c][b];
      if (stored.empty()) continue;
      if (result_.blocks[c][slot].raw_bytes != 0) target_.damaged("a block is there twice");
      result_.blocks[c][slot] = writer_->append(tiles::ChunkKind::block, stored, work.raw_bytes[c]);
    }
  }
  for (std::size_t c = 0; c < result_.covered.size(); ++c) result_.covered[c] += work.covered[c];
  for (std::size_t i = 0; i < kDistanceBins; ++i) result_.distances[i] += work.distances[i];
  for (std::size_t c = 0; c < work.clipped.size(); ++c) result_.clipped[c] += work.clipped[c];
  job_.meter.advance(texels);
}

PageResult ResultCollector::finish() {
  std::vector<std::byte> nothing(1), stored;
  job_.compressor().compress(nothing, stored);
  writer_->finish(writer_->append(tiles::ChunkKind::directory, stored, 1));
  result_.pack = publish_scratch(job_, std::move(writer_));
  return std::move(result_);
}

}  // namespace pounce::flow
