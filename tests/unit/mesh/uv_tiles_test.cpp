// SPDX-License-Identifier: Apache-2.0
#include "mesh/uv_tiles.h"

#include <catch2/catch.hpp>
#include <set>

namespace pounce::mesh {
namespace {

/// UDIMs that a triangle enters; v is given upwards.
std::set<std::uint32_t> entered(Vec2d a, Vec2d b, Vec2d c) {
  std::set<std::uint32_t> found;
  visit_uv_tiles({Vec2d{a.x, 1 - a.y}, Vec2d{b.x, 1 - b.y}, Vec2d{c.x, 1 - c.y}}, [&](UvTile tile) {
    const auto number = udim_number(tile);
    found.insert(number ? *number : 0);
  });
  return found;
}

}  // namespace

TEST_CASE("UDIM numbers count ten columns to the right, then upwards") {
  CHECK(udim_number({0, 0}) == 1001U);
  CHECK(udim_number({9, 0}) == 1010U);
  CHECK(udim_number({0, 1}) == 1011U);
  CHECK(udim_number({8, 899}) == 9999U);
  CHECK_FALSE(udim_number({9, 899}));
  CHECK_FALSE(udim_number({10, 0}));
  CHECK_FALSE(udim_number({-1, 0}));
  CHECK_FALSE(udim_number({0, -1}));
  CHECK_FALSE(udim_number({0, 2147483647}));
  for (const std::uint32_t udim : {1001U, 1010U, 1011U, 1234U, 9999U})
    CHECK(udim_number(udim_tile(udim)) == udim);
  CHECK(uvtile_name({0, 0}) == "u1_v1");
  CHECK(uvtile_name({2, 1}) == "u3_v2");
}

TEST_CASE("a triangle enters the tiles that it shares area with") {
  CHECK(entered({0, 0}, {1, 0}, {0, 1}) == std::set<std::uint32_t>{1001});  // borders do not count
  CHECK(entered({1, 1}, {2, 1}, {2, 2}) == std::set<std::uint32_t>{1012});
  CHECK(entered({0.5, 0.5}, {1.5, 0.5}, {0.5, 0.75}) == std::set<std::uint32_t>{1001, 1002});
  // The hypotenuse runs from (0, 2) to (2, 0): the tile at (1, 1) is only touched at its corner.
  CHECK(entered({0, 0}, {2, 0}, {0, 2}) == std::set<std::uint32_t>{1001, 1002, 1011});
  CHECK(entered({0, 0}, {2.01, 0}, {0, 2.01}) ==
        std::set<std::uint32_t>{1001, 1002, 1003, 1011, 1012, 1021});
  CHECK(entered({-0.5, 0.2}, {0.5, 0.2}, {0.2, 0.4}) == std::set<std::uint32_t>{0, 1001});
  CHECK(entered({0.2, 0.2}, {0.8, 0.8}, {0.5, 0.5}).empty());  // no area
}

TEST_CASE("a triangle over absurdly many tiles is counted and not visited") {
  int visited = 0;
  const std::uint64_t count =
      visit_uv_tiles({Vec2d{0, 0}, Vec2d{1e6, 0}, Vec2d{0, 1e6}}, [&](UvTile) { ++visited; });
  CHECK(count > 65536);
  CHECK(visited == 0);
}

}  // namespace pounce::mesh
