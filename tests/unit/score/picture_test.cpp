// SPDX-License-Identifier: Apache-2.0
#include "picture.h"

#include <catch2/catch.hpp>
#include <vector>

#include "pounce/error.h"
#include "two_discs.h"

using namespace pounce;
using namespace pounce::score;
using namespace pounce::test;

namespace {

constexpr Vec3d kWhite{1, 1, 1};

/// Squares of edge 2 across z, v down; each shows the column of texels that begins at `u`.
mesh::Mesh squares(const std::vector<std::pair<float, float>>& z_and_u) {
  mesh::Mesh mesh;
  mesh.uv_sets.resize(1);
  for (const auto& [z, u] : z_and_u) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    for (const Vec2f at : {Vec2f{-1, 1}, Vec2f{-1, -1}, Vec2f{1, -1}, Vec2f{1, 1}}) {
      mesh.positions.push_back({at.x, at.y, z});
      mesh.uv_sets[0].push_back({u, at.y > 0 ? 0.0F : 1.0F});
    }
    mesh.triangles.push_back({first, first + 1, first + 2});
    mesh.triangles.push_back({first, first + 2, first + 3});
  }
  return mesh;
}

/// Two texels wide, four high: red left, green right, blue growing downward.
Image two_columns() {
  Image image{2, 4, 3, {}};
  for (int y = 0; y < 4; ++y) {
    const float blue = static_cast<float>(y) / 4;
    image.samples.insert(image.samples.end(), {1, 0, blue, 0, 1, blue});
  }
  return image;
}

void check_colour(Vec3d a, Vec3d b) {
  CHECK(a.x == Approx(b.x).margin(1e-6));
  CHECK(a.y == Approx(b.y).margin(1e-6));
  CHECK(a.z == Approx(b.z).margin(1e-6));
}

}  // namespace

TEST_CASE("a view holds the mesh upright", "[score]") {
  const mesh::Mesh mesh = squares({{0.0F, 0.25F}});
  const View view = view_of(mesh, {.from = {0, 0, 5}, .size = 8});
  CHECK(view.right == Vec3d{1, 0, 0});
  CHECK(view.down == Vec3d{0, -1, 0});
  CHECK(view.forward == Vec3d{0, 0, -1});
  CHECK(view.pixel == Approx(2 * 1.06 / 8));
  CHECK(view.place(3.5, 3.5).x == Approx(0).margin(1e-12));
  CHECK(view.place(3.5, 3.5).y == Approx(0).margin(1e-12));
  CHECK(view.place(7, 0).y == Approx(1.06 * 7 / 8));
  const View part =
      view_of(mesh, {.from = {0, 0, 5}, .middle = Vec3d{1, 0.5, 0}, .edge = 4.0, .size = 8});
  CHECK(part.pixel == 0.5);
  CHECK(part.place(0, 0).x == Approx(1 - 1.75));
  CHECK(part.place(0, 0).y == Approx(0.5 + 1.75));
  CHECK_THROWS_AS(view_of(mesh, {.from = {0, 2, 0}}), Error);
  CHECK_THROWS_AS(view_of(squares({}), {}), Error);
}

TEST_CASE("the nearest surface shows its texture", "[score]") {
  // Seen from +z the square at 1 is before the one at 0, in whatever order they come.
  const mesh::Mesh mesh = squares({{1.0F, 0.25F}, {0.0F, 0.75F}});
  const Framing above{.from = {0, 0, 1}, .edge = 2.0, .size = 4};
  const auto front = draw_mesh(mesh, two_columns(), view_of(mesh, above), kWhite);
  const auto back = draw_mesh(mesh, two_columns(),
                              view_of(mesh, {.from = {0, 0, -1}, .edge = 2.0, .size = 4}), kWhite);
  for (std::size_t x = 0; x < 4; ++x) {
    // A pixel per texel: its samples lie a quarter of a texel above and below the centre.
    check_colour(front[1 * 4 + x], {1, 0, 0.25});
    check_colour(front[2 * 4 + x], {1, 0, 0.5});
    check_colour(back[1 * 4 + x], {0, 1, 0.25});
  }
  // Twice as wide: a pixel of background all around, two rows of texels to a pixel.
  const auto wide = draw_mesh(mesh, two_columns(),
                              view_of(mesh, {.from = {0, 0, 1}, .edge = 4.0, .size = 4}), kWhite);
  check_colour(wide[0], kWhite);
  check_colour(wide[1 * 4 + 0], kWhite);
  check_colour(wide[2 * 4 + 2] + wide[1 * 4 + 2], {2, 0, 0.75});
}

TEST_CASE("a picture of a scene has it before its background", "[score]") {
  const mesh::Mesh mesh = squares({{0.0F, 0.25F}});
  const View view = view_of(mesh, {.from = {0, 0, 1}, .edge = 2.0, .size = 5});
  const auto seen = draw_scene(two_discs(), view, false, kWhite);
  // The middle pixel is on the axis; 0.08 of the light passes.
  check_colour(seen[2 * 5 + 2], kFront * 0.6 + kBack * 0.32 + kWhite * 0.08);
  check_colour(seen[0], kWhite);
}
