// SPDX-License-Identifier: Apache-2.0
#include "meshing/wedges.h"

#include <catch2/catch.hpp>

namespace pounce::meshing {
namespace {

TEST_CASE("a place has a wedge for each of its UVs and materials, whatever the file repeats") {
  // Two squares side by side; what lies on their common edge is in the file twice.
  const std::vector<Vec3f> positions{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                     {1, 0, 0}, {2, 0, 0}, {2, 1, 0}, {1, 1, 0}};
  const std::vector<Triangle> triangles{{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}, {1, 4, 5}};
  const auto uvs = [&](float shift) {
    std::vector<std::array<Vec2f, 3>> all;
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      auto& own = all.emplace_back();
      for (std::size_t k = 0; k < 3; ++k) {
        const Vec3f p = positions[triangles[t][k]];
        own[k] = {p.x + (t >= 2 ? shift : 0), p.y};
      }
    }
    return all;
  };
  const std::vector<std::uint32_t> one(5), two{0, 0, 1, 1, 1};
  // The last triangle has two corners at one place.
  CHECK(joined(positions, triangles, uvs(0), one).triangles.size() == 4);
  CHECK(joined(positions, triangles, uvs(0), one).places.size() == 6);
  CHECK(joined(positions, triangles, uvs(0), one).wedges.size() == 6);
  CHECK(joined(positions, triangles, uvs(0.5F), one).wedges.size() == 8);
  CHECK(joined(positions, triangles, uvs(0), two).wedges.size() == 8);
  const WedgeSurface made = joined(positions, triangles, uvs(0.5F), two);
  REQUIRE(made.triangles.size() == 4);
  for (std::size_t t = 0; t < 4; ++t) {
    CHECK(uvs_of(made, made.triangles[t]) == uvs(0.5F)[t]);
    for (std::size_t k = 0; k < 3; ++k) {
      const Wedge& w = made.wedges[made.triangles[t][k]];
      CHECK(made.places[w.place] == positions[triangles[t][k]]);
      CHECK(w.material == two[t]);
    }
  }
  const Surface places = welded(made);
  CHECK(places.positions.size() == 6);
  CHECK(places.positions[places.triangles[3][1]] == Vec3f{2, 1, 0});
}

TEST_CASE("a triangle's turn is twice its area, and below 0 where it is mirrored") {
  CHECK(turn_of({{{0, 0}, {2, 0}, {0, 3}}}) == 6);
  CHECK(turn_of({{{0, 0}, {0, 3}, {2, 0}}}) == -6);
  CHECK(turn_of({{{1, 1}, {1, 1}, {2, 0}}}) == 0);
}

}  // namespace
}  // namespace pounce::meshing
