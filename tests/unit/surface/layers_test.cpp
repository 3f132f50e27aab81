// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>

#include "surface/strewn_places.h"

using namespace pounce;
using namespace pounce::surface;

namespace {

constexpr float kFacing = 0.17F, kNone = std::numeric_limits<float>::infinity();

/// Adds a square of 1 x 1 at that height, one side of it facing up (or down).
void add_square(mesh::Mesh& mesh, Vec3f at, float up) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  for (const Vec3f& corner : {Vec3f{0, 0, 0}, Vec3f{1, 0, 0}, Vec3f{1, 1, 0}, Vec3f{0, 1, 0}}) {
    mesh.positions.push_back(at + corner);
    mesh.normals.push_back({0, 0, up});
  }
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.triangles.push_back({first, first + 2, first + 3});
}

}  // namespace

TEST_CASE("gaps are those of the nearest layer that faces alike", "[target]") {
  mesh::Mesh mesh;
  add_square(mesh, {0, 0, 0}, 1);
  add_square(mesh, {0.5F, 0, 0.25F}, 1);  // above the right half
  add_square(mesh, {0.5F, 0, -0.5F}, 1);  // below it, farther away
  add_square(mesh, {0, 0, 0.125F}, -1);   // nearer, but facing down
  add_square(mesh, {0, 0, 2}, 1);         // too far away
  const std::vector<Place> places{{{0.25F, 0.5F, 0}, {0, 0, 1}},
                                  {{0.75F, 0.5F, 0}, {0, 0, 1}},
                                  {{0.75F, 0.25F, 0.25F}, {0, 0, 1}},
                                  {{0.75F, 0.5F, -0.5F}, {0, 0, 1}},
                                  {{0.25F, 0.5F, 0.125F}, {0, 0, -1}}};
  const std::vector<float> expected{kNone, 0.25F, 0.25F, 0.5F, kNone};
  CHECK(layer_gaps(mesh, places, kFacing, 1) == expected);
  // Not beyond what is asked for, which is a distance either way.
  CHECK(layer_gaps(mesh, places, kFacing, 0.3F) ==
        std::vector<float>{kNone, 0.25F, 0.25F, kNone, kNone});
  CHECK(layer_gaps(mesh, {}, kFacing, 1).empty());
}

TEST_CASE("gaps are those that a look at all triangles finds", "[target]") {
  std::minstd_rand random(5);
  std::uniform_real_distribution<float> at(-1, 1);
  mesh::Mesh mesh;
  for (int i = 0; i < 400; ++i) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    const Vec3f corner{at(random), at(random), at(random)};
    for (int k = 0; k < 3; ++k) {
      const float size = i % 10 == 0 ? 1.0F : 0.2F;
      mesh.positions.push_back(corner + Vec3f{at(random), at(random), at(random)} * size);
      mesh.normals.push_back({0, 0, 1});
    }
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  const std::vector<Place> places = strew(mesh, 200);
  const auto gaps = layer_gaps(mesh, places, kFacing, 0.25F);
  std::size_t found = 0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    double least = 0.25;
    bool any = false;
    for (const auto& corners : mesh.triangles) {
      const Vec3d a(mesh.positions[corners[0]]), b(mesh.positions[corners[1]]),
          c(mesh.positions[corners[2]]), p(places[i].position), n(places[i].normal);
      Vec3d facing = cross(b - a, c - a);
      facing = facing * ((facing.z < 0 ? -1 : 1) / length(facing));
      if (dot(facing, n) < double{kFacing}) continue;
      const double t = dot(a - p, facing) / dot(n, facing);
      const Vec3d at_plane = p + n * t;
      const auto side = [&](Vec3d from, Vec3d to) {
        return dot(cross(to - from, at_plane - from), facing);
      };
      const double u = side(a, b), v = side(b, c), w = side(c, a);
      const bool inside = (u > 0 && v > 0 && w > 0) || (u < 0 && v < 0 && w < 0);
      if (!inside || std::abs(t) < 1e-6 || std::abs(t) > least) continue;
      least = std::abs(t);
      any = true;
    }
    CHECK((gaps[i] < kNone) == any);
    if (any) CHECK(gaps[i] == Approx(least).margin(1e-6));
    found += any ? 1 : 0;
  }
  CHECK(found > 50);
  CHECK(found < 200);
}
