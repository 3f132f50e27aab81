// SPDX-License-Identifier: Apache-2.0
#include "views.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <vector>

#include "around.h"
#include "two_discs.h"

using namespace pounce;
using namespace pounce::score;
using namespace pounce::test;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A square of edge 2 across z, seen from +z, without UVs.
mesh::Mesh square(float z) {
  mesh::Mesh mesh;
  mesh.positions = {{-1, -1, z}, {1, -1, z}, {1, 1, z}, {-1, 1, z}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

/// Opaque, across z = 0, of one colour.
SplatPlyBuilder sheet(Vec3d colour) {
  SplatPlyBuilder ply;
  for (double x = -2; x <= 2; x += 0.1) {
    for (double y = -2; y <= 2; y += 0.1) {
      SplatPlyBuilder::Row row = disc(0, 0.99, colour);
      row["x"] = x;
      row["y"] = y;
      ply.rows.push_back(row);
    }
  }
  return ply;
}

/// So many pixels of one kind.
Seen pixels(std::size_t count, Vec3d colour, double cover, double depth) {
  return {std::vector<Vec3d>(count, colour), std::vector<double>(count, cover),
          std::vector<double>(count, depth)};
}

}  // namespace

TEST_CASE("directions are spread evenly, and turned ones lie between them", "[score]") {
  for (const std::size_t count : {6U, 24U, 26U, 48U}) {
    const std::vector<Vec3d> all = directions(count);
    REQUIRE(all.size() == count);
    Vec3d sum;
    double nearest = 4;
    for (std::size_t i = 0; i < count; ++i) {
      CHECK(length(all[i]) == Approx(1));
      sum = sum + all[i];
      for (std::size_t k = 0; k < i; ++k) nearest = std::min(nearest, length(all[i] - all[k]));
    }
    CHECK(length(sum) < 0.1 * static_cast<double>(count));
    // Of points each of which has 4 pi / count to itself.
    CHECK(nearest > 0.75 * std::sqrt(4 * 3.14159 / static_cast<double>(count)));
  }
  CHECK(directions(26, 0.31)[3].z == Approx(directions(26)[3].z));
  CHECK(length(directions(26, 0.31)[13] - directions(26)[13]) > 1);
}

TEST_CASE("pixels of several samples know how much of them is taken", "[score]") {
  // The square ends half a pixel before the picture does on each side: cover 1 inside, 1/2 at
  // edges.
  View view{{1, 0, 0}, {0, -1, 0}, {0, 0, -1}, {-1, 1, 5}, 0.5, 5};
  const Seen seen = see_mesh(square(2), nullptr, view, 4);
  CHECK(seen.cover[12] == 1);
  CHECK(seen.depth[12] == Approx(3));
  CHECK(seen.cover[10] == 0.5);
  CHECK(seen.cover[0] == 0.25);
  CHECK(seen.depth[0] == kInfinity);
  CHECK(seen.before(0, {0, 0, 1}).z == Approx(0.25 * 0.5 + 0.75));
}

TEST_CASE("structural similarity is that of its formula", "[score]") {
  const std::vector<Vec3d> dark(64, Vec3d{0.2, 0.2, 0.2}), light(64, Vec3d{0.6, 0.6, 0.6});
  CHECK(ssim(dark, dark, 8)[10] == Approx(1));
  // Nothing varies: what is left is (2 a b + c) / (a^2 + b^2 + c), c = 0.01^2.
  CHECK(ssim(dark, light, 8)[10] == Approx((2 * 0.12 + 1e-4) / (0.04 + 0.36 + 1e-4)));
  std::vector<Vec3d> stripes, others;
  for (int i = 0; i < 64; ++i) {
    const double v = i % 2 == 0 ? 0.25 : 0.75;
    stripes.push_back({v, v, v});
    others.push_back({1 - v, 1 - v, 1 - v});
  }
  CHECK(ssim(stripes, others, 8)[27] < -0.9);
}

TEST_CASE("likeness counts pixels of either, errors, gradients and depths", "[score]") {
  // Four pixels: the scene is in the first three, the mesh in the last three.
  Seen scene = pixels(4, {0.5, 0.5, 0.5}, 1, 2), mesh = pixels(4, {0.5, 0.5, 0.5}, 1, 2);
  scene.cover[3] = mesh.cover[0] = 0;
  scene.depth[3] = mesh.depth[0] = kInfinity;
  scene.colours[0] = {0.9, 0.5, 0.5};
  scene.colours[1] = {0.5, 0.7, 0.5};
  mesh.colours[1] = {0.5, 0.5, 0.5};
  mesh.depth[2] = 3;
  const Likeness is = likeness(scene, mesh, nullptr, 2, 10);
  CHECK(is.either == 4);
  CHECK(is.both == 2);
  CHECK(is.iou() == 0.5);
  // The first lies before grey in the other picture.
  CHECK(is.either_squares == Approx(0.16 + 0.04));
  CHECK(is.both_squares == Approx(0.04));
  CHECK(is.both_db() == Approx(10 * std::log10(3 * 2 / 0.04)));
  CHECK(is.depth(0) == 0);
  CHECK(is.depth(1) == Approx(0.1));
  CHECK(is.gradient == 0);  // pixels 1 and 2 are no neighbours
  Likeness twice = is;
  twice.add(is);
  CHECK(twice.either_db() == Approx(is.either_db()));
  CHECK(twice.mean_ssim() == Approx(is.mean_ssim()));
}

TEST_CASE("gradient energy tells soft from sharp", "[score]") {
  Seen scene = pixels(4, {}, 1, 1), mesh = scene;
  scene.colours[1] = scene.colours[3] = {1, 1, 1};
  mesh.colours[1] = mesh.colours[3] = {0.5, 0.5, 0.5};
  CHECK(likeness(scene, mesh, nullptr, 2, 1).sharpness() == Approx(0.25));
}

TEST_CASE("errors are told apart by confidence", "[score]") {
  Seen scene = pixels(9, {0.5, 0.5, 0.5}, 1, 1), mesh = scene, trust = scene;
  for (std::size_t i = 0; i < 9; ++i) {
    mesh.colours[i].x += 0.03 * static_cast<double>(i);
    trust.colours[i] = Vec3d{1, 1, 1} * (1 - 0.1 * static_cast<double>(i));
  }
  scene.cover[0] = 0;  // only where both are
  const auto errors = errors_by_trust(likeness(scene, mesh, &trust, 3, 1).trusted);
  CHECK(errors[0] == Approx(0.075));  // a third of 0.24 and 0.21
  CHECK(errors[1] == Approx(0.055));
  CHECK(errors[2] == Approx(0.035));
  CHECK(errors[3] == Approx(0.015));
  CHECK(errors_by_trust({})[3] == 0);
}

TEST_CASE("a texel has the colour that the views show which see it", "[score]") {
  const Scene scene = scene_of(sheet(kFront));
  Points points;
  points.diagonal = std::sqrt(8.0);
  points.points = {{{0.1, 0.2, 0}, {0, 0, 1}, 0.01, 0, 0}, {{0.1, 0.2, 0}, {0, 0, -1}, 0.01, 1, 0}};
  AroundOptions options;
  options.size = 64;
  for (const auto& seen : around(scene, square(0), points, options)) {
    CHECK(seen.weight > 0.5);
    CHECK(seen.colour.x == Approx(kFront.x).margin(0.02));
    CHECK(seen.colour.y == Approx(kFront.y).margin(0.02));
  }
  // Beneath the target's surface nobody sees it; where the scene is thin, neither.
  points.points = {{{0.1, 0.2, -0.5}, {0, 0, 1}, 0.01, 0, 0}};
  CHECK(around(scene, square(0), points, options).front().weight == 0);
  points.points = {{{0, 0, 0.99}, {0, 0, 1}, 0.01, 0, 0}};
  SplatPlyBuilder thin;
  thin.rows = {disc(1, 0.4, kFront)};
  CHECK(around(scene_of(thin), square(0.99F), points, options).front().weight == 0);
  thin.rows = {disc(1, 0.9, kFront)};
  CHECK(around(scene_of(thin), square(0.99F), points, options).front().weight > 0);
}

TEST_CASE("what hides a texel does not colour it where another view is clear", "[score]") {
  // A sheet at z = 0 that is the target's, and a small disc one unit above the middle.
  SplatPlyBuilder ply = sheet(kBack);
  for (int i = 0; i < 4; ++i) ply.rows.push_back(disc(1, 0.99, kFront));
  Points points;
  points.diagonal = std::sqrt(8.0);
  points.points = {{{0, 0, 0}, {0, 0, 1}, 0.01, 0, 0}};
  AroundOptions options;
  options.size = 64;
  const auto clear = around(scene_of(ply), square(0), points, options).front();
  CHECK(clear.colour.x == Approx(kBack.x).margin(0.05));
  options.hidden = 10;  // of the diagonal: nothing counts as hidden
  CHECK(around(scene_of(ply), square(0), points, options).front().colour.x > kBack.x + 0.1);
}

TEST_CASE("the nearest Gaussian's colour", "[score]") {
  Points points;
  points.points = {{{0, 0, 0.6}, {0, 0, 1}, 0.01, 0, 0}, {{0, 0, 0.4}, {0, 0, 1}, 0.01, 1, 0}};
  const auto colours = nearest_colours(two_discs(), points);
  CHECK(colours[0].x == Approx(kFront.x).margin(1e-5));
  CHECK(colours[1].x == Approx(kBack.x).margin(1e-5));
}
