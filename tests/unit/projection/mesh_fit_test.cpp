// SPDX-License-Identifier: Apache-2.0
#include "projection/mesh_fit.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

using namespace pounce;
using namespace pounce::projection;
using surface::Place;

namespace {

/// A potato without any symmetry, of radii .7 to 1.6; its rings and sectors decide the triangles.
mesh::Mesh potato(int rings, int sectors, const std::function<Vec3d(Vec3d)>& move,
                  bool inward = false) {
  mesh::Mesh mesh;
  for (int i = 0; i <= rings; ++i) {
    for (int j = 0; j <= sectors; ++j) {
      const double a = std::numbers::pi * i / rings, b = 2 * std::numbers::pi * j / sectors;
      const Vec3d d{std::sin(a) * std::cos(b), std::cos(a), std::sin(a) * std::sin(b)};
      const double r = 1 + 0.3 * d.x * d.x * d.x + 0.25 * std::sin(2 * d.y + d.z) + 0.2 * d.x * d.z;
      mesh.positions.emplace_back(move(d * r));
    }
  }
  mesh.normals.resize(mesh.positions.size());
  const auto add = [&](int a, int b, int c) {
    if (inward) std::swap(b, c);
    const auto at = [](int v) { return static_cast<std::uint32_t>(v); };
    mesh.triangles.push_back({at(a), at(b), at(c)});
    const Vec3d p(mesh.positions[at(a)]), q(mesh.positions[at(b)]), r(mesh.positions[at(c)]);
    for (const int v : {a, b, c})
      mesh.normals[at(v)] = mesh.normals[at(v)] + Vec3f(cross(q - p, r - p));
  };
  for (int i = 0; i < rings; ++i) {
    for (int j = 0; j < sectors; ++j) {
      const int v = i * (sectors + 1) + j;
      add(v, v + 1, v + sectors + 1);
      add(v + 1, v + sectors + 2, v + sectors + 1);
    }
  }
  return mesh;
}

constexpr double kDiagonal = 4;  // about that of the potato's box

Vec3d as_it_is(Vec3d p) { return p; }

MeshFit fit(const mesh::Mesh& target, const mesh::Mesh& source, double diagonal = kDiagonal) {
  return fit_of(surface::strew(target, kTargetPlaces), surface::strew(source, kSourcePlaces),
                diagonal);
}

MeshFit fit_moved(const std::function<Vec3d(Vec3d)>& move, double diagonal = kDiagonal) {
  return fit(potato(60, 90, move), potato(100, 160, as_it_is), diagonal);
}

}  // namespace

TEST_CASE("the same surface in other triangles fits", "[projection]") {
  const MeshFit found = fit_moved(as_it_is);
  CHECK(found.fit == 1);
  CHECK_FALSE(found.better);
  CHECK_FALSE(found.opposed);
  CHECK(found.lie_near > 0.95);
}

TEST_CASE("a shift is found and measured", "[projection]") {
  const MeshFit found = fit_moved([](Vec3d p) { return p + Vec3d{0.12, 0, 0}; });
  REQUIRE(found.better);
  CHECK(found.fit < 0.8);
  CHECK(found.lie_near < 0.5);
  CHECK(found.would_lie_near > 0.95);
  const PoseParts parts = parts_of(*found.better);
  CHECK(std::abs(parts.scale - 1) < 0.003);
  CHECK(parts.axes == Axes{});
  CHECK(parts.degrees < 0.5);
  CHECK(length(found.better->shift - Vec3d{-0.12, 0, 0}) < 0.01);
}

TEST_CASE("a turn is found and measured", "[projection]") {
  const double c = std::cos(std::numbers::pi / 18), s = std::sin(std::numbers::pi / 18);
  const MeshFit found = fit_moved([&](Vec3d p) {
    return Vec3d{c * p.x + s * p.z, p.y, c * p.z - s * p.x};
  });
  REQUIRE(found.better);
  const PoseParts parts = parts_of(*found.better);
  CHECK(parts.axes == Axes{});
  CHECK(parts.degrees == Approx(10).margin(0.3));
  CHECK(parts.about.y == Approx(-1).margin(0.02));  // it goes back
}

TEST_CASE("other units and other axes are found from afar", "[projection]") {
  const MeshFit large = fit_moved([](Vec3d p) { return p * 100.6; }, 100.6 * kDiagonal);
  REQUIRE(large.better);
  CHECK(parts_of(*large.better).scale == Approx(1 / 100.6).epsilon(0.003));
  CHECK(parts_of(*large.better).axes == Axes{});
  // z up: --target-axes x,z,-y brings it back.
  const MeshFit turned = fit_moved([](Vec3d p) { return Vec3d{p.x, -p.z, p.y}; });
  REQUIRE(turned.better);
  CHECK(to_text(parts_of(*turned.better).axes) == "x,z,-y");
}

TEST_CASE("what lies off all over is a layer, not a misfit", "[projection]") {
  const MeshFit found = fit_moved([](Vec3d p) { return p * (1 + 0.04 / length(p)); });
  CHECK(found.fit == 1);
  CHECK_FALSE(found.better);
}

TEST_CASE("half a source fits where it is", "[projection]") {
  mesh::Mesh half = potato(100, 160, as_it_is);
  half.triangles.resize(half.triangles.size() / 2);
  CHECK_FALSE(fit(potato(60, 90, as_it_is), half).better);
}

TEST_CASE("normals that look inward are found on either side", "[projection]") {
  const mesh::Mesh out = potato(60, 90, as_it_is), in = potato(60, 90, as_it_is, true);
  const MeshFit target = fit(in, out), source = fit(out, in);
  CHECK(target.opposed);
  CHECK(target.target_inward);
  CHECK_FALSE(target.source_inward);
  CHECK(source.opposed);
  CHECK(source.source_inward);
  CHECK_FALSE(source.target_inward);
  CHECK_FALSE(target.better);
}

TEST_CASE("nothing is said of what has no surface", "[projection]") {
  CHECK(fit_of({}, {}, 1).fit == 1);
  const mesh::Mesh mesh = potato(8, 12, as_it_is);
  const auto places = surface::strew(mesh, 64);
  CHECK_FALSE(fit_of(places, places, 0).better);
}
