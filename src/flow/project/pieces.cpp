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
#include <tuple>
#include <utility>

#include "mesh/lattice.h"

namespace pounce::flow {
namespace {

/// Bytes of one piece's share of the budget: as if one more were under way for each thread, so that
/// blocks can be kept; of wide ones three quarters of what the leases leave, since few blocks are
/// still there when the next one asks. Never more than the leases leave, or than that of `most`.
std::uint64_t budget_share(const job::JobContext& job, const PieceSize& most) {
  const std::uint64_t threads = std::max(job.threads, 1U), limit = job.budget.limit(),
                      left = limit - job.budget.leased();
  const std::uint64_t share = most.is_wide ? left / 4 * 3 / (most.per_thread * threads)
                                           : limit / ((most.per_thread + 1) * threads);
  return std::min({most.largest_share, share, left});
}

/// Cuts the target's tiles into pieces whose blocks' state fits `state_share`; `fixed` is what a
/// piece needs besides.
PieceList cut_pieces(job::JobContext& job, const store::GeometryStore& target, std::uint64_t fixed,
                     std::uint64_t state_share, const PieceSize& most,
                     const std::function<BlockCost(const store::BlockEntry&)>& state_cost,
                     const std::function<bool(const store::BlockEntry&)>& is_made) {
  PieceList list;
  Piece piece;
  BlockCost state;  // sums
  std::uint64_t largest_turn = 0;
  const auto bytes = [&] { return state.each + std::max(largest_turn, state.in_turn / kTurns); };
  const auto finish = [&](Piece next) {
    if (piece.count > 0) {
      list.pieces.push_back(piece);
      list.costs.push_back(fixed + bytes());
    }
    piece = next;
    state = {};
    largest_turn = 0;
  };
  for (std::uint32_t t = 0; t < target.directory().tiles.size(); ++t) {
    // A piece that is not wide never reaches into another tile: it reads one page of the index, and
    // its blocks are neighbours in space.
    if (!most.is_wide || piece.count == 0) finish({t, 0, 0});
    const auto blocks = target.read_index(t, job.compressor());
    for (std::uint32_t b = 0; b < blocks.size(); ++b) {
      if (is_made(blocks[b])) {  // a gap: a piece's blocks are one run of the index
        finish({t, b + 1, 0});
        continue;
      }
      const BlockCost own = state_cost(blocks[b]);
      const auto add = [&] {
        state = {state.each + own.each, state.in_turn + own.in_turn};
        largest_turn = std::max(largest_turn, own.in_turn);
        return bytes();
      };
      const auto before = std::pair(state, largest_turn);
      if (add() > state_share || piece.count == most.most_blocks) {
        if (piece.count > 0) {
          std::tie(state, largest_turn) = before;
          finish({t, b, 0});
          add();
        }
      }
      ++piece.count;
    }
  }
  finish({});
  return list;
}

}  // namespace

CutTarget cut_target(job::JobContext& job, const store::GeometryStore& target,
                     const PieceSize& most, std::uint64_t fixed, std::uint64_t least_batch,
                     const std::function<BlockCost(const store::BlockEntry&)>& state_cost,
                     const std::function<bool(const store::BlockEntry&)>& is_made) {
  CutTarget cut;
  const std::uint64_t share = budget_share(job, most);
  cut.batch_bytes = std::max(least_batch, share > fixed ? (share - fixed) / 2 : 0);
  // A piece that settles is admitted with the least batch. What it lacks of a full one may be added
  // when its texels are known (docs/decisions/046-splat-leases.md), so it is no part of its cost.
  cut.more_bytes = most.settles ? cut.batch_bytes - least_batch : 0;
  cut.share_bytes = share;
  const std::uint64_t taken = fixed + (most.is_wide ? least_batch : cut.batch_bytes);
  std::uint64_t blocks = 0;
  for (const store::TileEntry& tile : target.directory().tiles) blocks += tile.blocks;
  cut.index = runtime::Lease(job.budget, PieceList::most_bytes(blocks), "the index of the target");
  cut.pieces = cut_pieces(job, target, fixed + cut.batch_bytes - cut.more_bytes,
                          share > taken ? share - taken : 0, most, state_cost, is_made);
  const std::vector<std::uint64_t>& costs = cut.pieces.costs;
  if (!costs.empty()) {
    // Taken and returned at once: it throws where the largest piece does not fit.
    const runtime::Lease fits(job.budget, *std::max_element(costs.begin(), costs.end()),
                              "projecting one block of the target");
  }
  return cut;
}

TargetIndex::Page TargetIndex::page(std::uint32_t tile, store::Compressor& compressor) {
  {
    const std::lock_guard lock(lock_);
    if (last_ != nullptr && tile_ == tile) return last_;
  }
  // Two pieces may read the same page at once: nobody waits for the disk with the lock.
  auto made =
      std::make_shared<const std::vector<store::BlockEntry>>(target_->read_index(tile, compressor));
  const std::lock_guard lock(lock_);
  tile_ = tile;
  last_ = made;
  return made;
}

std::vector<store::BlockEntry> TargetIndex::blocks_of(const Piece& piece,
                                                      store::Compressor& compressor) {
  std::vector<store::BlockEntry> blocks;
  std::size_t first = piece.first;
  for (std::uint32_t t = piece.tile; blocks.size() < piece.count; ++t, first = 0) {
    const Page entries = page(t, compressor);
    const std::size_t end = std::min(entries->size(), first + piece.count - blocks.size());
    blocks.insert(blocks.end(), entries->begin() + static_cast<std::ptrdiff_t>(first),
                  entries->begin() + static_cast<std::ptrdiff_t>(end));
  }
  return blocks;
}

void read_packets(job::JobContext& job, TargetIndex& index, float smallest_edge,
                  surface::TargetBlock::Start start, PieceWork& work,
                  PageVector<surface::TexelPacket>& packets,
                  std::vector<surface::PacketGroup>& groups,
                  std::vector<std::vector<surface::TexelAxes>>* axes) {
  work.blocks = index.blocks_of(work.piece, job.compressor());
  const store::GeometryStore& target = index.target();
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
                  store::PlainRoom* room, PieceWork& work) {
  work.raw_bytes[c] = shading::encode(result, format, job.compressor(), room, work.stored[c][b]);
}

}  // namespace pounce::flow
