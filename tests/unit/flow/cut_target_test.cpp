// SPDX-License-Identifier: Apache-2.0
//
// A target cut into pieces: of a share of 1000 bytes, 100 are fixed; half of the other 900 goes to
// the batch, so that a piece's texels may have 450. A block's state is as many bytes as it has
// texels.
#include <catch2/catch.hpp>

#include "flow/project/pieces.h"
#include "support/bytes.h"
#include "unit/flow/small_target.h"

using namespace pounce;
using namespace pounce::flow;
using test::small_target;
using test::SmallJob;

namespace {

const std::vector<std::vector<std::uint32_t>> kTiles{{200, 200, 200}, {500}, {10, 10, 10, 10}};
constexpr mesh::Lattice kPage{512, 512, 0, {}};

bool none_made(const store::BlockEntry&) { return false; }
std::uint64_t texels_of(const store::BlockEntry& entry) { return entry.texels; }

/// Tile, first block and number of blocks of each piece.
std::vector<std::array<std::uint32_t, 3>> pieces_of(const CutTarget& cut) {
  std::vector<std::array<std::uint32_t, 3>> pieces;
  for (const Piece& piece : cut.pieces.pieces)
    pieces.push_back({piece.tile, piece.first, piece.count});
  return pieces;
}

using Pieces = std::vector<std::array<std::uint32_t, 3>>;
using Costs = std::vector<std::uint64_t>;

TEST_CASE("pieces end at their share, at the most blocks, and with their tile") {
  SmallJob job(1 << 20);
  const auto target = small_target(job, kPage, kTiles);
  const CutTarget cut = cut_target(job.context, target, {1000, 3}, 100, 50, texels_of, none_made);
  CHECK(cut.batch_bytes == 450);
  CHECK(cut.more_bytes == 0);
  // Two blocks of 200 fit 450; one of 500 is a piece though it does not; of the small ones three.
  CHECK(pieces_of(cut) == Pieces{{0, 0, 2}, {0, 2, 1}, {1, 0, 1}, {2, 0, 3}, {2, 3, 1}});
  CHECK(cut.pieces.costs == Costs{550 + 400, 550 + 200, 550 + 500, 550 + 30, 550 + 10});
  CHECK(job.context.budget.leased() == PieceList::most_bytes(8));  // the list, and nothing else
}

TEST_CASE("pieces that settle begin with the least batch and may have the rest later") {
  SmallJob job(1 << 20);
  const auto target = small_target(job, kPage, kTiles);
  const CutTarget cut =
      cut_target(job.context, target, {1000, 3, true}, 100, 50, texels_of, none_made);
  CHECK(cut.batch_bytes == 450);
  CHECK(cut.more_bytes == 400);
  CHECK(cut.pieces.costs == Costs{150 + 400, 150 + 200, 150 + 500, 150 + 30, 150 + 10});
}

TEST_CASE("wide pieces go on into the next tile, and count what their blocks need in turn") {
  SmallJob job(1 << 20);
  const auto target = small_target(job, kPage, kTiles);
  PieceSize wide{1000, 100, true};
  wide.is_wide = true;
  const auto in_turn = [](const store::BlockEntry& entry) {
    return BlockCost(entry.texels, entry.texels / 2);
  };
  const CutTarget cut = cut_target(job.context, target, wide, 100, 50, in_turn, none_made);
  // 850 are for blocks: three of 200 and a turn of 100; then all others and a turn of 250.
  CHECK(pieces_of(cut) == Pieces{{0, 0, 3}, {1, 0, 5}});
  CHECK(cut.pieces.costs == Costs{150 + 600 + 100, 150 + 540 + 250});

  const auto second = [](const store::BlockEntry& entry) { return entry.texels == 500; };
  const CutTarget rest = cut_target(job.context, target, wide, 100, 50, in_turn, second);
  CHECK(pieces_of(rest) == Pieces{{0, 0, 3}, {2, 0, 4}});
}

TEST_CASE("where the share holds no more than what is fixed, each block is a piece") {
  SmallJob job(1 << 20);
  const auto target = small_target(job, kPage, kTiles);
  const CutTarget cut = cut_target(job.context, target, {100, 3}, 100, 50, texels_of, none_made);
  CHECK(cut.batch_bytes == 50);
  CHECK(cut.pieces.pieces.size() == 8);
  CHECK(cut.pieces.costs.front() == 150 + 200);
}

TEST_CASE("the share is the budget's by threads and pieces under way, and one more") {
  // 4 threads, 3 pieces each under way, and one more: 16 shares of 1000 bytes.
  SmallJob job(16000, 4);
  const std::vector<std::vector<std::uint32_t>> small{{10, 10}};
  const auto target = small_target(job, kPage, small);
  const PieceSize most{1 << 20, 3};
  CHECK(cut_target(job.context, target, most, 100, 50, texels_of, none_made).batch_bytes == 450);
  job.context.threads = 0;  // counts as one: 4 shares of 4000
  CHECK(cut_target(job.context, target, most, 100, 50, texels_of, none_made).batch_bytes == 1950);
  // Only what other leases leave is available.
  const runtime::Lease other(job.context.budget, 15000, "another");
  CHECK(cut_target(job.context, target, most, 100, 50, texels_of, none_made).batch_bytes == 450);
}

TEST_CASE("a piece that can never fit the budget is refused before any work") {
  SmallJob job(2000);
  const auto target = small_target(job, kPage, {{3000}});
  std::string message;
  CHECK(test::error_kind(
            [&] {
              cut_target(job.context, target, {1000, 3}, 100, 50, texels_of, none_made);
            },
            &message) == static_cast<int>(ErrorKind::budget));
  CHECK(message.find("projecting one block of the target") != std::string::npos);
  CHECK(job.context.budget.leased() == 0);
}

TEST_CASE("a target without blocks has no pieces") {
  SmallJob job(1 << 20);
  const auto target = small_target(job, kPage, {});
  CHECK(cut_target(job.context, target, {1000, 3}, 100, 50, texels_of, none_made)
            .pieces.pieces.empty());
}

TEST_CASE("blocks that are made already are in no piece, and end the one before them") {
  SmallJob job(1 << 20);
  const auto target = small_target(job, kPage, kTiles);
  job.context.threads = 1;
  const auto second = [](const store::BlockEntry& entry) { return entry.x % 2 == 1; };
  // Of the tiles' blocks 0 1 2 | 3 | 4 5 6 7 the odd ones are made; the page is eight blocks wide.
  const CutTarget cut = cut_target(job.context, target, {1000, 3}, 100, 50, texels_of, second);
  CHECK(pieces_of(cut) == Pieces{{0, 0, 1}, {0, 2, 1}, {2, 0, 1}, {2, 2, 1}});
  const auto all = [](const store::BlockEntry&) { return true; };
  CHECK(cut_target(job.context, target, {1000, 3}, 100, 50, texels_of, all).pieces.pieces.empty());
}

}  // namespace

TEST_CASE("a piece's blocks are those of the index, whichever page was read before") {
  SmallJob job(1 << 20);
  const auto target = small_target(job, kPage, kTiles);
  TargetIndex index(&target);
  const auto texels = [&](const Piece& piece) {
    std::vector<std::uint32_t> out;
    for (const auto& entry : index.blocks_of(piece, job.context.compressor()))
      out.push_back(entry.texels);
    return out;
  };
  using Texels = std::vector<std::uint32_t>;
  CHECK(texels({0, 1, 2}) == Texels{200, 200});
  CHECK(texels({0, 0, 1}) == Texels{200});
  CHECK(texels({2, 3, 1}) == Texels{10});
  CHECK(texels({1, 0, 1}) == Texels{500});
  CHECK(texels({0, 2, 4}) == Texels{200, 500, 10, 10});  // a wide one
  CHECK(texels({0, 0, 3}) == Texels{200, 200, 200});
}
