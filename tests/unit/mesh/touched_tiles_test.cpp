// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <numeric>

#include "mesh/lattice.h"
#include "store/blocks/colour_store.h"
#include "support/random.h"

using namespace pounce;
using namespace pounce::mesh;
using pounce::test::Random;

namespace {

/// A mesh of one triangle with these corners in texels.
Mesh triangle(const Lattice& lattice, const std::array<Vec2d, 3>& corners) {
  Mesh mesh;
  mesh.uv_sets.resize(1);
  mesh.uv_present.resize(1);
  for (const Vec2d t : corners) {
    mesh.uv_sets[0].push_back({static_cast<float>((t.x + 0.5) / lattice.width),
                               static_cast<float>((t.y + 0.5) / lattice.height)});
  }
  mesh.triangles.push_back({0, 1, 2});
  return mesh;
}

TileMask touched(const Lattice& lattice, const std::array<Vec2d, 3>& corners, Wrap u, Wrap v,
                 double margin) {
  const Mesh mesh = triangle(lattice, corners);
  TileMask mask(lattice.width, lattice.height);
  add_touched(mesh, lattice, std::array<std::uint32_t, 1>{0}, u, v, margin, mask);
  return mask;
}

}  // namespace

TEST_CASE("a triangle touches the tiles that are near it, by hand") {
  const Lattice lattice{256, 256, 0, {}};  // 4 x 4 tiles
  const auto repeat = Wrap::repeat;
  SECTION("well inside one tile") {
    const TileMask mask =
        touched(lattice, {Vec2d{90, 90}, Vec2d{100, 90}, Vec2d{90, 100}}, repeat, repeat, 10);
    CHECK(mask.count() == 1);
    CHECK(mask.has(1, 1));
    CHECK(mask.has_row(1));
    CHECK_FALSE(mask.has_row(0));
    CHECK(mask.end_row() == 2);
  }
  SECTION("so near to a border that the margin crosses it") {
    const TileMask mask =
        touched(lattice, {Vec2d{90, 90}, Vec2d{120, 90}, Vec2d{90, 100}}, repeat, repeat, 10);
    CHECK(mask.count() == 2);
    CHECK(mask.has(2, 1));
  }
  SECTION("a thin diagonal leaves out the corners that it does not come near") {
    const TileMask mask =
        touched(lattice, {Vec2d{10, 10}, Vec2d{240, 240}, Vec2d{241, 240}}, repeat, repeat, 2);
    for (std::uint32_t i = 0; i < 4; ++i) CHECK(mask.has(i, i));
    CHECK_FALSE(mask.has(3, 0));
    CHECK_FALSE(mask.has(0, 3));
    CHECK(mask.count() <= 10);
  }
  SECTION("beyond the image's border it comes back on the other side, or stays at the edge") {
    const std::array corners{Vec2d{-10, 90}, Vec2d{-5, 90}, Vec2d{-10, 100}};
    const TileMask repeated = touched(lattice, corners, repeat, repeat, 2);
    CHECK(repeated.count() == 1);
    CHECK(repeated.has(3, 1));
    const TileMask clamped = touched(lattice, corners, Wrap::clamp, repeat, 2);
    CHECK(clamped.count() == 1);
    CHECK(clamped.has(0, 1));
  }
}

TEST_CASE("every texel near a triangle is in a tile that counts as touched") {
  Random random(11);
  const auto number = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random.bits() % 1000003) / 1000002;
  };
  std::uint64_t left_out = 0;
  for (int round = 0; round < 400; ++round) {
    const Lattice lattice{static_cast<std::uint32_t>(number(65, 700)),
                          static_cast<std::uint32_t>(number(65, 700)),
                          0,
                          {}};
    const auto u = static_cast<Wrap>(random.bits() % 3), v = static_cast<Wrap>(random.bits() % 3);
    const Vec2d middle{number(-800, 1500), number(-800, 1500)};
    const double size = number(1, 150), margin = number(0, 30);
    std::array<Vec2d, 3> corners;
    for (Vec2d& corner : corners)
      corner = {middle.x + number(-size, size), middle.y + number(-size, size)};
    CAPTURE(round, lattice.width, lattice.height, static_cast<int>(u), static_cast<int>(v), margin);
    const TileMask mask = touched(lattice, corners, u, v, margin);
    left_out += mask.tiles() - mask.count();
    bool all = true;
    for (int sample = 0; sample < 300; ++sample) {
      double a = number(0, 1), b = number(0, 1);
      if (a + b > 1) a = 1 - a, b = 1 - b;
      const double x = corners[0].x + a * (corners[1].x - corners[0].x) +
                       b * (corners[2].x - corners[0].x) + 0.99 * number(-margin, margin);
      const double y = corners[0].y + a * (corners[1].y - corners[0].y) +
                       b * (corners[2].y - corners[0].y) + 0.99 * number(-margin, margin);
      for (const double column : {std::floor(x), std::ceil(x)}) {
        for (const double row : {std::floor(y), std::ceil(y)}) {
          const auto in_x = store::wrapped(static_cast<std::int64_t>(column), lattice.width, u);
          const auto in_y = store::wrapped(static_cast<std::int64_t>(row), lattice.height, v);
          all = all && mask.has(static_cast<std::uint32_t>(in_x / kBlockEdge),
                                static_cast<std::uint32_t>(in_y / kBlockEdge));
        }
      }
    }
    CHECK(all);
  }
  CHECK(left_out > 1000);  // most triangles are small
}
