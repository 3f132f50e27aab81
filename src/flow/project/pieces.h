// SPDX-License-Identifier: Apache-2.0
//
// A target cut into pieces: the unit of projection work, of its memory, and of what is under way.
//
// A piece is a few neighbouring blocks of one target, cut so that its lease (its texels' state, its
// result, and room for what it reads of the source) is at most its share of the budget: budget /
// (4 x threads) for meshes, / (2 x threads) for Gaussians.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

#include "job/job_context.h"
#include "shading/result_block.h"
#include "store/blocks/geometry_store.h"
#include "store/blocks/result_records.h"
#include "store/pack/pack.h"
#include "surface/target_block.h"

namespace pounce::flow {

/// Neighbouring blocks of one target tile; a wide piece goes on into the tiles behind.
struct Piece {
  std::uint32_t tile = 0, first = 0, count = 0;
};

/// What a block's texels cost the piece that it is in.
struct BlockCost {
  BlockCost(std::uint64_t bytes = 0, std::uint64_t bytes_in_turn = 0)
      : each(bytes), in_turn(bytes_in_turn) {}
  std::uint64_t each;     ///< beside the other blocks
  std::uint64_t in_turn;  ///< while it is its turn: see kTurns
};
/// Of the blocks of a piece an eighth have their turn at once, the largest one in any case.
inline constexpr std::uint64_t kTurns = 8;

/// The pieces of a target and what each costs.
struct PieceList {
  std::vector<Piece> pieces;
  std::vector<std::uint64_t> costs;  ///< bytes of a piece's lease

  /// Of a target of so many blocks: no piece has less than one.
  static std::uint64_t most_bytes(std::uint64_t blocks) {
    return blocks * (sizeof(Piece) + sizeof(std::uint64_t));
  }
};

/// A target cut for one projection under the budget.
struct CutTarget {
  PieceList pieces;
  /// Of a piece's lease: for the source blocks it searches at once. Where pieces settle, what most
  /// of them may have: their costs hold the least.
  std::uint64_t batch_bytes = 0;
  std::uint64_t more_bytes = 0;   ///< what a piece may have beyond its cost, once it settles
  std::uint64_t share_bytes = 0;  ///< what it may have in any case: its share of the budget
  runtime::Lease index;           ///< of the list itself
};
/// How large pieces are made where the budget holds larger ones, too.
struct PieceSize {
  std::uint64_t largest_share = 0;  ///< of the budget
  std::uint32_t most_blocks = 0;
  /// It begins with the smallest batch, and its lease becomes what it needs once its texels are
  /// known.
  bool settles = false;
  /// So many are under way for each thread.
  std::uint32_t per_thread = 3;
  /// What a piece reads costs the same for few texels as for many: blocks of several tiles are one
  /// piece, and all of its share but the smallest batch is for them.
  bool is_wide = false;
};

/// Shares the budget out, to a piece no more than `most`: beside `fixed`, half of a piece's
/// share goes to a batch of source blocks (at least `least_batch`), half to its texels' state, of
/// which a block needs state_cost(entry). Blocks that are made already are in no piece. Throws
/// Error(budget) if the largest piece does not fit.
CutTarget cut_target(job::JobContext& job, const store::GeometryStore& target,
                     const PieceSize& most, std::uint64_t fixed, std::uint64_t least_batch,
                     const std::function<BlockCost(const store::BlockEntry&)>& state_cost,
                     const std::function<bool(const store::BlockEntry&)>& is_made);

/// A piece on its way through the graph, and its result. A projection adds its own state. Owned by
/// whichever node has it; the piece's lease covers all of it.
struct PieceWork : store::ResultCounts {
  std::size_t index = 0;
  Piece piece;
  bool begun = false;             ///< its packets have been read
  std::uint64_t batch_bytes = 0;  ///< of its lease: for the source blocks it searches at once
  std::vector<store::BlockEntry> blocks;
  /// [channel][block], encoded and compressed; empty: nothing covered.
  std::vector<std::vector<std::vector<std::byte>>> stored;
  std::vector<std::uint32_t> raw_bytes;  ///< [channel]
  /// [block]: what its texels hit, encoded and compressed, where that is kept; empty: nothing.
  std::vector<std::vector<std::byte>> hits;
  std::vector<std::uint32_t> hit_bytes;  ///< [block], before compression
};

/// A target's blocks by tile, for the pieces that it was cut into: they ask for one page of the
/// index after the other, so that the last one stays decoded. Thread-safe. What a page takes (64
/// entries at most) is in the scratch that every piece counts.
class TargetIndex {
 public:
  /// Without a target nothing may be asked.
  explicit TargetIndex(const store::GeometryStore* target) : target_(target) {}

  const store::GeometryStore& target() const { return *target_; }
  /// The piece's blocks.
  std::vector<store::BlockEntry> blocks_of(const Piece& piece, store::Compressor& compressor);

 private:
  using Page = std::shared_ptr<const std::vector<store::BlockEntry>>;
  Page page(std::uint32_t tile, store::Compressor& compressor);

  const store::GeometryStore* target_;
  std::mutex lock_;
  std::uint32_t tile_ = 0;
  Page last_;  ///< of that tile; null: none yet
};

/// Reads a piece's blocks into work.blocks and appends their packets to `packets` and `groups`.
/// `smallest_edge` and `start`: see TargetBlock; `axes`: those of each block, if asked for.
void read_packets(job::JobContext& job, TargetIndex& index, float smallest_edge,
                  surface::TargetBlock::Start start, PieceWork& work,
                  PageVector<surface::TexelPacket>& packets,
                  std::vector<surface::PacketGroup>& groups,
                  std::vector<std::vector<surface::TexelAxes>>* axes = nullptr);

// --- results -------------------------------------------------------------------------------------

/// Encodes a finished result block of channel `c` and block `b` into the work, compressed unless
/// there is `room` for it as it is.
void finish_block(job::JobContext& job, const shading::TexelFormat& format,
                  const shading::ResultBlock& result, std::size_t c, std::size_t b,
                  store::PlainRoom* room, PieceWork& work);

}  // namespace pounce::flow
