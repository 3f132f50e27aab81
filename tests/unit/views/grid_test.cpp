// SPDX-License-Identifier: Apache-2.0
#include "views/grid.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "support/random.h"

using namespace pounce;
using namespace pounce::views;

namespace {

constexpr Box3f kUnit{{-1, -1, -1}, {1, 1, 1}};

Hash128 key_of(const Grid& grid) {
  Hasher hash;
  grid.add_to(hash);
  return hash.digest();
}

}  // namespace

TEST_CASE("views look from evenly around, each along axes at right angles", "[views]") {
  for (const std::uint32_t count : {6U, 24U, 48U, 96U}) {
    const std::vector<Frame> frames = frames_around(count);
    REQUIRE(frames.size() == count);
    Vec3f sum;
    float nearest = 4;
    for (std::size_t i = 0; i < count; ++i) {
      const Frame& f = frames[i];
      for (const Vec3f axis : {f.right, f.down, f.forward}) CHECK(length(axis) == Approx(1));
      CHECK(dot(f.right, f.down) == Approx(0).margin(1e-6));
      CHECK(length(cross(f.right, f.down) - f.forward) < 1e-6);
      // What is up in space is up in a view, as far as it can be.
      if (std::abs(f.forward.y) < 0.9F) CHECK(f.down.y < 0);
      sum = sum + f.forward;
      for (std::size_t k = 0; k < i; ++k)
        nearest = std::min(nearest, length(f.forward - frames[k].forward));
    }
    CHECK(length(sum) < 0.1 * count);
    CHECK(nearest > 0.75 * std::sqrt(4 * 3.14159 / count));
  }
  // The third of 24, by hand: z = 1 - 5 / 24, two golden angles (222.492 degrees) round the axis.
  const Vec3f third = frames_around(24)[2].forward;
  const double z = 1 - 5.0 / 24, across = std::sqrt(1 - z * z), angle = 2 * 3.88322207745093;
  CHECK(third.x == Approx(across * std::cos(angle)));
  CHECK(third.y == Approx(across * std::sin(angle)));
  CHECK(third.z == Approx(z));
}

TEST_CASE("a point is seen where its view's axes say", "[views]") {
  const Grid grid(kUnit, 0, 24);
  // 1.4 thousandths of the diagonal, at the nearest power of the root of two.
  CHECK(grid.pixel() == Approx(std::pow(2.0, -7.5)));
  CHECK(grid.middle() == Vec3f{0, 0, 0});
  // The region's corners lie at sqrt(3): 313.5 pixels from the middle, with two to spare.
  CHECK(grid.tiles_across() == 10);
  std::size_t left_out = 0;
  for (std::uint32_t view = 0; view < grid.views(); ++view) {
    const Frame& f = grid.frame(view);
    const Seen middle = grid.see(view, grid.middle());
    CHECK(middle.x == static_cast<float>(grid.edge() / 2) - 0.5F);
    CHECK(middle.depth == kMostDepth / 2);
    const Seen moved = grid.see(view, f.right * (3 * grid.pixel()) + f.down * (-5 * grid.pixel()) +
                                          f.forward * (7 * grid.depth_step()));
    CHECK(moved.x - middle.x == Approx(3).margin(1e-3));
    CHECK(moved.y - middle.y == Approx(-5).margin(1e-3));
    CHECK(moved.depth - middle.depth == Approx(7).margin(0.02));
    for (int corner = 0; corner < 8; ++corner) {
      const auto side = [&](int bit) { return (corner >> bit & 1) != 0 ? 1.0F : -1.0F; };
      const Seen seen = grid.see(view, {side(0), side(1), side(2)});
      CHECK(seen.x > 1);
      CHECK(seen.y > 1);
      CHECK(seen.x < static_cast<float>(grid.edge()) - 2);
      CHECK(seen.y < static_cast<float>(grid.edge()) - 2);
      CHECK(seen.depth > kMostDepth * 0.05F);
      CHECK(seen.depth < kMostDepth * 0.95F);
      CHECK(grid.has(view, static_cast<std::uint32_t>(seen.x) / kTileEdge,
                     static_cast<std::uint32_t>(seen.y) / kTileEdge));
    }
    for (std::uint32_t tile = 0; tile < grid.tiles_across(); ++tile)
      left_out += grid.has(view, tile, 0) ? 0 : 1;
  }
  CHECK(left_out > 24);  // beside the region there is nothing to draw
  CHECK(grid.image(kSceneSamples).height == 24 * grid.edge());
  CHECK(grid.tile_row(3, 5) == 3 * grid.tiles_across() + 5);
}

TEST_CASE("targets of about one size share a grid, and coarse texels have a coarse one",
          "[views]") {
  const Hash128 key = key_of(Grid(kUnit, 0, 24));
  CHECK(key_of(Grid({{-0.95F, -0.9F, -0.99F}, {0.97F, 1, 0.98F}}, 0, 24)) == key);
  CHECK(key_of(Grid(kUnit, 0.001F, 24)) == key);
  CHECK_FALSE(key_of(Grid(kUnit, 0, 23)) == key);
  CHECK_FALSE(key_of(Grid({{-1, -1, -1}, {1.2F, 1, 1}}, 0, 24)) == key);
  const Grid coarse(kUnit, 0.1F, 24);
  CHECK(coarse.pixel() == Approx(std::pow(2.0, -3.5)));
  CHECK(coarse.tiles_across() == 1);
  test::Random random(3);
  for (int i = 0; i < 2000; ++i) {
    Box3f box;
    const float longest = std::exp(random.between(-9.0F, 9.0F));
    for (int corner = 0; corner < 2; ++corner)
      box.extend(Vec3f{longest * random.between(-1.0F, 1.0F), longest * random.between(-1.0F, 1.0F),
                       longest * random.between(-1.0F, 1.0F) * (random.one_in(3) ? 0.0F : 1.0F)});
    CHECK(Grid(box, 0, 6).tiles_across() <= Grid::kMostAcross);
  }
  // A target that is a plane, and one that is a point, have a grid, too.
  CHECK(Grid({{0, 0, 5}, {1, 1, 5}}, 0, 6).tiles_across() > 10);
  CHECK(Grid({{2, 2, 2}, {2, 2, 2}}, 0, 6).tiles_across() >= 1);
}
