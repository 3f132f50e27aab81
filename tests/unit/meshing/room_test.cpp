// SPDX-License-Identifier: Apache-2.0
//
// Rooms from within: a box with a wall around it and a cube that stands on its floor, all of thin
// shells, as splats are. A view that begins in the cube sees the cube's other side from within.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <vector>

#include "meshing/field.h"

namespace pounce::meshing {
namespace {

struct Shell {
  Vec3d low, high;
};

const Shell kRoom{{-2, -1.5, -1}, {2, 1.5, 1}}, kWall{{-2.3, -1.8, -1.3}, {2.3, 1.8, 1.3}},
    kCube{{0.6, -0.3, -1}, {1.2, 0.3, -0.3}};

double of(const Vec3d& v, std::size_t axis) { return std::array<double, 3>{v.x, v.y, v.z}[axis]; }

/// Where a ray meets a shell next; infinity: nowhere.
double next_hit(const Shell& shell, const Vec3d& from, const Vec3d& along) {
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const double side : {of(shell.low, axis), of(shell.high, axis)}) {
      const double t = (side - of(from, axis)) / of(along, axis);
      if (!(t > 0 && t < nearest)) continue;
      const Vec3d hit = from + along * t;
      bool on_face = true;
      for (std::size_t other = 0; other < 3; ++other)
        on_face = on_face && (other == axis || (of(hit, other) >= of(shell.low, other) &&
                                                of(hit, other) <= of(shell.high, other)));
      if (on_face) nearest = t;
    }
  }
  return nearest;
}

/// How far a place is from the nearest face of a box.
double from_faces(const Shell& shell, const Vec3d& p) {
  double beyond = 0, within = std::numeric_limits<double>::infinity();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double away =
        std::max(of(shell.low, axis) - of(p, axis), of(p, axis) - of(shell.high, axis));
    if (away > 0) beyond += away * away;
    within = std::min(within, std::abs(away));
  }
  return beyond > 0 ? std::sqrt(beyond) : within;
}

struct Room {
  Box3f box{{-2.5F, -2, -1.5F}, {2.5F, 2, 1.5F}};
  Vec3f middle{-0.3F, 0.1F, 0.2F};  // in the air
  views::Grid grid{box, 0.02F, 48};
  Field field{Lattice(box, 80)};

  Room() { grid.begin_within(middle); }
  std::vector<std::uint16_t> depths(std::uint32_t view) const {
    const std::uint32_t edge = grid.edge();
    std::vector<std::uint16_t> out(std::size_t{edge} * edge, views::kNoDepth);
    const Vec3d along(grid.frame(view).forward);
    for (std::uint32_t y = 0; y < edge; ++y) {
      for (std::uint32_t x = 0; x < edge; ++x) {
        const views::Seen begin{static_cast<float>(x), static_cast<float>(y), grid.begin(view)};
        const Vec3d from(grid.place(view, begin));
        const double t = std::min({next_hit(kRoom, from, along), next_hit(kWall, from, along),
                                   next_hit(kCube, from, along)});
        if (!std::isfinite(t)) continue;
        out[std::size_t{y} * edge + x] = static_cast<std::uint16_t>(std::lround(
            static_cast<double>(begin.depth) + t / static_cast<double>(grid.depth_step())));
      }
    }
    return out;
  }
  void add_all(const Air* air) {
    for (std::uint32_t view = 0; view < grid.views(); ++view) {
      auto seen = depths(view);
      if (air != nullptr) forget_solid(grid, *air, view, seen);
      field.add(grid, {view, seen}, 0, field.lattice().corners[2]);
    }
  }
};

TEST_CASE("a place in a view is where it is seen") {
  const Room room;
  const Vec3f p{0.7F, -0.4F, 0.9F};
  for (const std::uint32_t view : {0U, 13U, 47U}) {
    const Vec3f again = room.grid.place(view, room.grid.see(view, p));
    CHECK(length(again - p) < 1e-4F);
    // A view begins at the plane through the point, across its direction.
    CHECK(room.grid.begin(view) == Approx(room.grid.see(view, room.middle).depth));
  }
}

TEST_CASE("a room is its walls from within and what stands in it, and nothing beside") {
  Room room;
  room.add_all(nullptr);
  const auto air = room.field.air_around(room.middle, kTruncation / 2);
  REQUIRE(air);
  CHECK(air->has(room.middle));
  CHECK(length(air->start() - room.middle) < room.field.lattice().cell);
  // Of a point in the wall the nearest air is some cells away.
  const auto beside = room.field.air_around({2.15F, 0, 0}, kTruncation / 2);
  REQUIRE(beside);
  CHECK(length(beside->start() - Vec3f{2.15F, 0, 0}) > 3 * room.field.lattice().cell);
  CHECK(air->has(Vec3f{1.6F, 1.1F, 0.6F}));           // a corner of the room
  CHECK_FALSE(air->has(Vec3f{0.9F, 0, -0.6F}));       // within the cube
  CHECK_FALSE(air->has(Vec3f{2.15F, 0, 0}));          // within the wall
  CHECK_FALSE(air->has(Vec3f{2.45F, 1.95F, 1.45F}));  // without
  CHECK_FALSE(air->has(Vec3f{9, 0, 0}));
  room.field.clear();
  room.add_all(&*air);
  const auto kept = room.field.air_around(room.middle, 0);
  REQUIRE(kept);
  room.field.keep_air(*kept);
  const Surface surface = room.field.surface();
  CHECK(surface.triangles.size() > 8000);
  const double cell = static_cast<double>(room.field.lattice().cell);
  std::size_t of_cube = 0;
  for (const Vec3f& p : surface.positions) {
    const double away = std::min(from_faces(kRoom, Vec3d(p)), from_faces(kCube, Vec3d(p)));
    CHECK(away < 1.5 * cell);
    of_cube += from_faces(kCube, Vec3d(p)) < cell && p.z > -0.9F ? 1U : 0U;
  }
  // The cube's five faces, a vertex per cell.
  CHECK(static_cast<double>(of_cube) ==
        Approx((0.36 + 4 * 0.6 * 0.6) / (cell * cell)).epsilon(0.2));
  // Its inside is solid, turned towards the air: what the surface encloses is the room without it.
  double volume = 0;
  for (const Triangle& t : surface.triangles) {
    const Vec3d a(surface.positions[t[0]]), b(surface.positions[t[1]]), c(surface.positions[t[2]]);
    volume -= dot(a, cross(b, c)) / 6;
  }
  CHECK(volume == Approx(4 * 3 * 2 - 0.36 * 0.7).epsilon(0.03));
}

TEST_CASE("where nothing is outside there is no air") {
  const Field field{Lattice({{0, 0, 0}, {1, 1, 1}}, 8)};
  CHECK_FALSE(field.air_around({0.5F, 0.5F, 0.5F}, 0));
}

}  // namespace
}  // namespace pounce::meshing
