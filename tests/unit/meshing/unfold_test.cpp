// SPDX-License-Identifier: Apache-2.0
#include "meshing/unfold.h"

#include <algorithm>
#include <catch2/catch.hpp>

namespace pounce::meshing {
namespace {

constexpr std::uint32_t kEdge = 9;

/// A square of 9 x 9 vertices a unit apart; it rises by this much of x squared.
Surface sheet(float bend) {
  Surface surface;
  for (std::uint32_t y = 0; y < kEdge; ++y) {
    for (std::uint32_t x = 0; x < kEdge; ++x) {
      const auto fx = static_cast<float>(x);
      surface.positions.push_back({fx, static_cast<float>(y), bend * fx * fx});
    }
  }
  for (std::uint32_t y = 0; y + 1 < kEdge; ++y) {
    for (std::uint32_t x = 0; x + 1 < kEdge; ++x) {
      const std::uint32_t a = y * kEdge + x;
      surface.triangles.push_back({a, a + 1, a + kEdge + 1});
      surface.triangles.push_back({a, a + kEdge + 1, a + kEdge});
    }
  }
  return surface;
}

std::ptrdiff_t facing_down(const Surface& surface) {
  return std::count_if(surface.triangles.begin(), surface.triangles.end(), [&](const Triangle& t) {
    const Vec3f a = surface.positions[t[0]], b = surface.positions[t[1]],
                c = surface.positions[t[2]];
    return cross(b - a, c - a).z <= 0;
  });
}

TEST_CASE("what is not folded stays as it is") {
  const Surface before = sheet(0.1F);
  Surface after = before;
  unfold(after, 0.2);
  CHECK(after.positions == before.positions);
}

TEST_CASE("vertices that were drawn over their neighbours go back between them") {
  Surface surface = sheet(0);
  surface.positions[4 * kEdge + 4] = {5.6F, 4.3F, 0};
  surface.positions[2 * kEdge + 6] = {6, 0.7F, 0};
  const Surface folded = surface;
  REQUIRE(facing_down(surface) == 4);
  unfold(surface, 0.2);
  CHECK(facing_down(surface) == 0);
  for (std::size_t v = 0; v < surface.positions.size(); ++v) {
    const Vec3f p = surface.positions[v];
    CHECK(p.z == 0);  // along the surface
    const std::size_t x = v % kEdge, y = v / kEdge;
    if (std::min({x, y, kEdge - 1 - x, kEdge - 1 - y}) == 0) CHECK(p == folded.positions[v]);
  }
}

TEST_CASE("a vertex on a border stays though triangles are folded there") {
  Surface surface = sheet(0);
  surface.positions[4] = {4, 1.5F, 0};  // of the lowest row, over the next one
  const Vec3f before = surface.positions[4];
  unfold(surface, 0.2);
  CHECK(surface.positions[4] == before);
}

}  // namespace
}  // namespace pounce::meshing
