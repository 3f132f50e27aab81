// SPDX-License-Identifier: Apache-2.0
//
// A target cut into pieces under the budget.
//
// A lease has three parts: what a piece needs in any case (`fixed`), a batch of source blocks, and
// the state of its texels. Half of what `fixed` leaves of a share goes to the batch, the rest to
// texels. More batch means fewer rounds per piece; more texels mean fewer pieces, which would read
// the same source blocks again.
//
// A share is a wish. A target block that needs more is a piece of its own, and a batch holds the
// largest source block in any case. Both may exceed the share, so cut_target() checks that the
// largest piece fits the budget before any work begins.
#include "flow/project/pieces.h"

#include <algorithm>

#include "mesh/lattice.h"

namespace pounce::flow {
namespace {

/// Bytes of one piece's share of the budget: as if one more were under way for each thread, so that
/// blocks can be kept; never more than what the leases leave, or than that of `most`.
std::uint64_t budget_share(const job::JobContext& job, const PieceSize& most) {
  const std::uint64_t pieces = (most.per_thread + 1) * std::uint64_t{std::max(job.threads, 1U)};
  return std::min(
      {most.largest_share, job.budget.limit() / pieces, job.budget.limit() - job.budget.leased()});
}

/// Cuts the target's tiles into pieces whose blocks' state fits `state_share`; `fixed` is what a
/// piece needs besides.
PieceList cut_pieces(job::JobContext& job, const store::GeometryStore& target, std::uint64_t fixed,
                     std::uint64_t state_share, std::uint32_t most_blocks,
                     const std::function<std::uint64_t(const store::BlockEntry&)>& state_bytes,
                     const std::function<bool(const store::BlockEntry&)>& is_made) {
  PieceList list;
  for (std::uint32_t t = 0; t < target.directory().tiles.size(); ++t) {
    // A piece never reaches into another tile: it reads one page of the index, and its blocks are
    // neighbours in space.
    const auto blocks = target.read_index(t, job.compressor());
    Piece piece{t, 0, 0};
    std::uint64_t state = 0;
    const auto finish = [&] {
      if (piece.count == 0) return;
      list.pieces.push_back(piece);
      list.costs.push_back(fixed + state);
    };
    for (std::uint32_t b = 0; b < blocks.size(); ++b) {
      if (is_made(blocks[b])) {  // a gap: a piece's blocks are one run of the index
        finish();
        piece = {t, b + 1, 0};
        state = 0;
        continue;
      }
      const std::uint64_t more = state_bytes(blocks[b]);
      if (piece.count > 0 && (piece.count == most_blocks || state + more > state_share)) {
        finish();
        piece = {t, b, 0};
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

CutTarget cut_target(job::JobContext& job, const store::GeometryStore& target,
                     const PieceSize& most, std::uint64_t fixed, std::uint64_t least_batch,
                     const std::function<std::uint64_t(const store::BlockEntry&)>& state_bytes,
                     const std::function<bool(const store::BlockEntry&)>& is_made) {
  CutTarget cut;
  const std::uint64_t share = budget_share(job, most);
  cut.batch_bytes = std::max(least_batch, share > fixed ? (share - fixed) / 2 : 0);
  // A piece that settles is admitted with the least batch. What it lacks of a full one may be added
  // when its texels are known (docs/decisions/046-splat-leases.md), so it is no part of its cost.
  cut.more_bytes = most.settles ? cut.batch_bytes - least_batch : 0;
  cut.share_bytes = share;
  const std::uint64_t taken = fixed + cut.batch_bytes;
  std::uint64_t blocks = 0;
  for (const store::TileEntry& tile : target.directory().tiles) blocks += tile.blocks;
  cut.index = runtime::Lease(job.budget, PieceList::most_bytes(blocks), "the index of the target");
  cut.pieces = cut_pieces(job, target, taken - cut.more_bytes, share > taken ? share - taken : 0,
                          most.most_blocks, state_bytes, is_made);
  const std::vector<std::uint64_t>& costs = cut.pieces.costs;
  if (!costs.empty()) {
    // Taken and returned at once: it throws where the largest piece does not fit.
    const runtime::Lease fits(job.budget, *std::max_element(costs.begin(), costs.end()),
                              "projecting one block of the target");
  }
  return cut;
}

void read_packets(job::JobContext& job, const store::GeometryStore& target, float smallest_edge,
                  surface::TargetBlock::Start start, PieceWork& work,
                  PageVector<surface::TexelPacket>& packets,
                  std::vector<surface::PacketGroup>& groups,
                  std::vector<std::vector<surface::TexelAxes>>* axes) {
  const auto entries = target.read_index(work.piece.tile, job.compressor());
  const auto first = entries.begin() + work.piece.first;
  work.blocks.assign(first, first + work.piece.count);
  std::size_t most_packets = 0;
  for (const auto& entry : work.blocks)
    most_packets += surface::TargetBlock::most_packets(entry.texels);
  packets.reserve(most_packets);
  for (std::uint32_t b = 0; b < work.blocks.size(); ++b) {
    const store::BlockEntry& entry = work.blocks[b];
    const surface::TargetBlock maps(target.read_block(entry, job.compressor()),
                                    target.directory().pages[entry.page], smallest_edge, start);
    maps.make_packets(b, packets, groups, surface::TargetBlock::order_of(start));
    if (axes != nullptr) axes->push_back(maps.axes());
  }
}

void finish_block(job::JobContext& job, const shading::TexelFormat& format,
                  const shading::ResultBlock& result, std::size_t c, std::size_t b,
                  PieceWork& work) {
  std::vector<std::byte> raw;
  shading::encode(result, format, raw);
  work.raw_bytes[c] = static_cast<std::uint32_t>(raw.size());
  job.compressor().compress(raw, work.stored[c][b], store::kFastLevel, job.scratch_room());
}

}  // namespace pounce::flow
