// SPDX-License-Identifier: Apache-2.0
#include "meshing/uv_cover.h"

#include <catch2/catch.hpp>

namespace pounce::meshing {
namespace {

using Uvs = UvCover::Uvs;

// The halves of the left half of the texture, and of the right one.
constexpr Uvs kLeftLow{{{0, 0}, {0.5F, 0}, {0.5F, 1}}}, kLeftHigh{{{0, 0}, {0.5F, 1}, {0, 1}}},
    kRightLow{{{0.5F, 0}, {1, 0}, {1, 1}}}, kRightHigh{{{0.5F, 0}, {1, 1}, {0.5F, 1}}};

TEST_CASE("texels are counted by the triangles on them, which repeat") {
  UvCover cover(8);
  for (const Uvs& uvs : {kLeftLow, kLeftHigh, kRightLow, kRightHigh}) cover.add(uvs);
  CHECK(cover.shared() == 0);
  CHECK(cover.at_middle(kLeftLow) == 1);
  cover.add({{{-3, -2}, {-2.5F, -2}, {-2.5F, -1}}});  // kLeftLow in another period
  CHECK(cover.at_middle(kLeftLow) == 2);
  CHECK(cover.shared() > 8);
  CHECK(cover.shared() < 24);             // a quarter of 64
  cover.add({{{0, 0}, {9, 0}, {0, 9}}});  // tiles
  CHECK(cover.at_middle(kRightLow) == 1);
}

TEST_CASE("triangles come in others' place where no texel then has too many") {
  UvCover cover(8);
  for (const Uvs& uvs : {kLeftLow, kLeftHigh, kRightLow}) cover.add(uvs);
  const Uvs grown{{{0, 0}, {1, 1}, {0, 1}}};  // kLeftHigh and kRightHigh and some of kLeftLow
  const std::array<Uvs, 1> low{kLeftLow}, high{kLeftHigh}, right{kRightHigh}, new_one{grown};
  // Over what is free: yes. Over kRightLow: no, and nothing is done, unless two may lie there.
  CHECK_FALSE(cover.replace(high, new_one, 1));
  CHECK(cover.shared() == 0);
  CHECK(cover.replace(high, right, 1));
  CHECK(cover.shared() == 0);
  CHECK(cover.at_middle(kLeftHigh) == 0);
  CHECK_FALSE(cover.replace(right, low, 1));
  CHECK(cover.replace(right, low, 2));
  CHECK(cover.at_middle(kLeftLow) == 2);
  CHECK(cover.at_middle(kRightHigh) == 0);
  // More than that already: it may stay so.
  CHECK(cover.replace(low, low, 1));
  CHECK(cover.at_middle(kLeftLow) == 2);
}

TEST_CASE("what is refused over several periods leaves nothing behind") {
  UvCover cover(16);
  const std::array<Uvs, 1> wide{{{{{-0.5F, 0}, {1.4F, 0}, {-0.5F, 1.9F}}}}},
      shifted{{{{{0.5F, 1}, {2.4F, 1}, {0.5F, 2.9F}}}}}, tall{{{{{0, 0}, {0.2F, 0}, {0, 1.9F}}}}};
  cover.add(wide[0]);
  const std::uint32_t at_middle = cover.at_middle(wide[0]);
  const std::uint64_t shared = cover.shared();
  CHECK(shared > 0);  // it lies on itself
  const std::array<Uvs, 2> both{wide[0], tall[0]};
  CHECK_FALSE(cover.replace(wide, both, 1));
  CHECK(cover.texels_looked_at() > 0);
  CHECK(cover.at_middle(wide[0]) == at_middle);
  CHECK(cover.shared() == shared);
  CHECK(cover.replace(wide, both, 9));
  CHECK(cover.shared() > shared);
  CHECK(cover.replace(both, wide, 1));
  CHECK(cover.shared() == shared);
  CHECK(cover.replace(wide, shifted, 9));
  CHECK(cover.replace(shifted, {}, 1));
  CHECK(cover.shared() == 0);
  CHECK(cover.at_middle(wide[0]) == 0);
}

}  // namespace
}  // namespace pounce::meshing
