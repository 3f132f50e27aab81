// SPDX-License-Identifier: Apache-2.0
#include "surface/source_block.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "mesh/block_bins.h"
#include "support/random.h"

using namespace pounce;
using namespace pounce::surface;
using pounce::test::Random;

namespace {

constexpr mesh::Lattice kImage{8, 8, 0, {}};

/// A block of triangles with corners at texels of an image.
struct BlockMaker {
  mesh::Lattice lattice;
  store::GeometryBlock block;

  void add(std::array<Vec3f, 3> positions, std::array<Vec2d, 3> texels, Vec3f normal = {0, 0, 1}) {
    const auto first = static_cast<std::uint16_t>(block.positions.size());
    for (std::size_t k = 0; k < 3; ++k) {
      block.positions.push_back(positions[k]);
      block.normals.push_back(normal);
      block.uvs.push_back({static_cast<float>((texels[k].x + 0.5) / lattice.width),
                           static_cast<float>((texels[k].y + 0.5) / lattice.height)});
      block.tangents.push_back({});
    }
    block.triangles.push_back(
        {first, static_cast<std::uint16_t>(first + 1), static_cast<std::uint16_t>(first + 2)});
    block.ids.push_back(static_cast<std::uint32_t>(40 + block.ids.size()));
  }
  SourceBlock make() const { return make_source_block(block, lattice); }
};

Vec3f vec(const float (&v)[3]) { return {v[0], v[1], v[2]}; }

Vec2d texel_at(const Facet& f, double w1, double w2) {
  return {f.base[0] + double{f.frac[0]} + f.du[0] * w1 + f.du[1] * w2,
          f.base[1] + double{f.frac[1]} + f.dv[0] * w1 + f.dv[1] * w2};
}

bool holds(const Box3f& box, Vec3d p) {
  return box.lo.x <= p.x && p.x <= box.hi.x && box.lo.y <= p.y && p.y <= box.hi.y &&
         box.lo.z <= p.z && p.z <= box.hi.z;
}

}  // namespace

TEST_CASE("plane, gradients and texel frame of a right triangle are exact") {
  BlockMaker maker{kImage, {}};
  maker.block.page = 3;
  maker.add({Vec3f{0, 0, 5}, {2, 0, 5}, {0, 4, 5}}, {Vec2d{1, 1}, {5, 1}, {1, 5}});
  const SourceBlock out = maker.make();
  REQUIRE(out.facets.size() == 1);
  CHECK(out.degenerate == 0);
  const Facet& f = out.facets[0];
  CHECK(vec(f.n) == Vec3f{0, 0, 1});
  CHECK(vec(f.m) == Vec3f{0, 0, 5});
  CHECK(vec(f.g1) == Vec3f{0.5F, 0, 0});
  CHECK(vec(f.g2) == Vec3f{0, 0.25F, 0});
  CHECK(vec(f.e1) == Vec3f{2, 0, 0});
  CHECK(vec(f.e2) == Vec3f{0, 4, 0});
  CHECK(f.id == 40);
  CHECK(f.page == 3);
  CHECK(f.base[0] == 1);
  CHECK(f.base[1] == 1);
  CHECK(f.frac[0] == 0);
  CHECK(f.frac[1] == 0);
  CHECK(texel_at(f, 0, 0) == Vec2d{1, 1});
  CHECK(texel_at(f, 1, 0) == Vec2d{5, 1});
  CHECK(texel_at(f, 0, 1) == Vec2d{1, 5});
  CHECK(texel_at(f, 0.5, 0.5) == Vec2d{3, 3});
  // 4 square units over 8 square texels: a texel's edge is sqrt(1/2).
  const double edge = std::sqrt(0.5);
  CHECK(f.tolerance == Approx(edge));
  CHECK(f.reach[1] == Approx(edge * 0.5));
  CHECK(f.reach[2] == Approx(edge * 0.25));
  CHECK(f.reach[0] == Approx(edge * std::sqrt(0.25 + 0.0625)));
}

TEST_CASE("texel coordinates left of the image floor downwards, and count the shifts") {
  BlockMaker maker{kImage, {}};
  maker.add({Vec3f{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {Vec2d{-3.25, -0.5}, {1, 0}, {0, 2.5}});
  SourceBlock out = maker.make();
  CHECK(out.facets[0].base[0] == -4);
  CHECK(out.facets[0].frac[0] == 0.75F);
  CHECK(out.facets[0].base[1] == -1);
  CHECK(out.facets[0].frac[1] == 0.5F);
  maker.block.shifts = {{-1, 2}};
  out = maker.make();
  CHECK(out.facets[0].base[0] == 4);
  CHECK(out.facets[0].base[1] == -17);
}

TEST_CASE("the front is where the vertex normals point, else where the winding says") {
  const std::array<Vec3f, 3> corners{Vec3f{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const std::array<Vec2d, 3> texels{Vec2d{0, 0}, {4, 0}, {0, 4}};
  BlockMaker maker{kImage, {}};
  maker.add(corners, texels, {0, 0.6F, 0.8F});
  maker.add({corners[0], corners[2], corners[1]}, texels, {0, 0.6F, 0.8F});
  maker.add(corners, texels, {0, 0, -1});
  maker.add(corners, texels, {0, 0, 0});
  maker.add({corners[0], corners[2], corners[1]}, texels, {0, 0, 0});
  const SourceBlock out = maker.make();
  REQUIRE(out.facets.size() == 5);
  CHECK(vec(out.facets[0].n) == Vec3f{0, 0, 1});
  CHECK(vec(out.facets[1].n) == Vec3f{0, 0, 1});
  CHECK(vec(out.facets[2].n) == Vec3f{0, 0, -1});
  CHECK(vec(out.facets[3].n) == Vec3f{0, 0, 1});
  CHECK(vec(out.facets[4].n) == Vec3f{0, 0, -1});
}

TEST_CASE("a facet knows its vertices' normals and how far they lean from its plane's") {
  const std::array<Vec3f, 3> corners{Vec3f{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const std::array<Vec2d, 3> texels{Vec2d{0, 0}, {4, 0}, {0, 4}};
  BlockMaker maker{kImage, {}};
  for (int i = 0; i < 4; ++i) maker.add(corners, texels);
  maker.block.normals[3] = {0, 0.6F, 0.8F};
  maker.block.normals[4] = {0.28F, 0, 0.96F};
  maker.block.normals[7] = {0, 1, 0};  // 90 degrees: what lies between may lean anywhere
  for (std::size_t i = 9; i < 12; ++i) maker.block.normals[i] = {};
  const SourceBlock out = maker.make();
  REQUIRE(out.facets.size() == 4);
  CHECK(out.facets[0].lean == Approx(0).margin(2e-5));
  CHECK(vec(out.facets[0].s) == Vec3f{0, 0, 1});
  CHECK(vec(out.facets[0].s1) == Vec3f{});
  CHECK(out.facets[1].lean == Approx(std::sqrt(0.4)).margin(2e-5));
  CHECK(out.facets[1].lean > std::sqrt(0.4F));
  CHECK(vec(out.facets[1].s) == Vec3f{0, 0.6F, 0.8F});
  CHECK(vec(out.facets[1].s1) == Vec3f{0.28F, -0.6F, 0.96F - 0.8F});
  CHECK(vec(out.facets[1].s2) == Vec3f{0, -0.6F, 1 - 0.8F});
  CHECK(out.facets[2].lean == 4);
  CHECK(vec(out.facets[3].s) == Vec3f{0, 0, 1});  // no normals: the plane's
  CHECK(vec(out.facets[3].s2) == Vec3f{});
}

TEST_CASE("the tolerance is a texel's edge, but never more than the triangle's own size") {
  const std::array<Vec3f, 3> corners{Vec3f{0, 0, 0}, {2, 0, 0}, {0, 4, 0}};  // 4 square units
  BlockMaker maker{kImage, {}};
  maker.add(corners, {Vec2d{0, 0}, {4, 0}, {0, 4}});         // 1/2 square unit per texel
  maker.add(corners, {Vec2d{0, 0}, {0.125, 0}, {0, 0.25}});  // stretched: 256 per texel
  maker.add(corners, {Vec2d{0, 0}, {2, 2}, {4, 4}});         // no area in the image
  SourceBlock out = maker.make();
  CHECK(out.facets[0].tolerance == Approx(std::sqrt(0.5)));
  CHECK(out.facets[1].tolerance == Approx(2));
  CHECK(out.facets[2].tolerance == Approx(2));
  maker.lattice = {};  // a constant colour: no texels at all
  out = maker.make();
  CHECK(out.facets[0].tolerance == Approx(2));
  CHECK(out.patches.size() == 3);
}

TEST_CASE("triangles without area in space are left out and counted") {
  const std::array<Vec2d, 3> texels{Vec2d{0, 0}, {4, 0}, {0, 4}};
  BlockMaker maker{kImage, {}};
  maker.add({Vec3f{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}, texels);
  maker.add({Vec3f{0, 0, 0}, {1, 1, 1}, {2, 2, 2}}, texels);
  maker.add({Vec3f{0, 0, 0}, {1e-30F, 0, 0}, {0, 1e-30F, 0}}, texels);  // gradients overflow
  maker.add({Vec3f{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, texels);
  const SourceBlock out = maker.make();
  CHECK(out.facets.size() + out.degenerate == 4);
  CHECK(out.degenerate >= 2);
  CHECK(out.facets.back().id == 43);
  CHECK(out.patches.back().facet == out.facets.size() - 1);
  for (const Facet& f : out.facets) {
    for (std::size_t k = 0; k < 3; ++k) CHECK(std::isfinite(f.g1[k] + f.g2[k] + f.n[k]));
  }
}

TEST_CASE("patches hold their triangle within the block's window, or whole") {
  Random random(21);
  std::size_t cut = 0, whole = 0, samples = 0;
  for (int round = 0; round < 300; ++round) {
    BlockMaker maker{{4096, 4096, 0, {}}, {}};
    maker.block.x = static_cast<std::int32_t>(random.whole(-2, 2));
    maker.block.y = static_cast<std::int32_t>(random.whole(-2, 2));
    const double size = random.one_in(2) ? 15 : 150;
    std::array<Vec3f, 3> p;
    std::array<Vec2d, 3> t;
    for (std::size_t k = 0; k < 3; ++k) {
      p[k] = {random.between(-3.0F, 3.0F), random.between(-3.0F, 3.0F),
              random.between(9.0F, 12.0F)};
      t[k] = {maker.block.x * 64 + random.between(-size, size + 64),
              maker.block.y * 64 + random.between(-size, size + 64)};
      if (size == 15) t[k] = {std::fmod(t[k].x, 15.0), std::fmod(t[k].y, 15.0)};
    }
    maker.add(p, t);
    const SourceBlock out = maker.make();
    REQUIRE(out.facets.size() == 1);
    const Facet& f = out.facets[0];
    const bool is_whole =
        mesh::is_whole(maker.block.texel_corners(maker.lattice, 0), maker.lattice);
    is_whole ? ++whole : ++cut;
    if (is_whole) CHECK(out.patches.size() == 1);
    CHECK(out.patches.size() <= 1);
    const Vec3d p0(p[0]), e1 = Vec3d(p[1]) - p0, e2 = Vec3d(p[2]) - p0;
    for (int i = 0; i <= 60; ++i) {
      for (int k = 0; k <= 60 - i; ++k) {
        const double w1 = i / 60.0, w2 = k / 60.0;
        const Vec2d texel = texel_at(f, w1, w2);
        const double x = texel.x - maker.block.x * 64.0, y = texel.y - maker.block.y * 64.0;
        if (!is_whole && !(x >= 0 && x <= 64 && y >= 0 && y <= 64)) continue;
        const Vec3d at = p0 + e1 * w1 + e2 * w2;
        bool held = false;
        for (const Patch& patch : out.patches) {
          held = held || (patch.facet == 0 && holds(patch.box, at) &&
                          length(at - Vec3d(patch.centre)) <= double{patch.radius});
        }
        if (!held) FAIL("round " << round << ": " << x << "," << y << " is in no patch");
        ++samples;
      }
    }
  }
  CHECK(cut > 100);
  CHECK(whole > 100);
  CHECK(samples > 100000);
}

TEST_CASE("a cut triangle's patch is no larger than the block's window") {
  // A square unit per texel; the block's window of 64 texels is 64 units wide. The triangle covers
  // a 512th of its image.
  BlockMaker maker{{4096, 4096, 0, {}}, {}};
  maker.add({Vec3f{0, 0, 0}, {256, 0, 0}, {0, 256, 0}}, {Vec2d{0, 0}, {256, 0}, {0, 256}});
  const SourceBlock out = maker.make();
  REQUIRE(out.patches.size() == 1);
  const Patch& patch = out.patches[0];
  CHECK(patch.box.hi.x - patch.box.lo.x == Approx(64 + 2).epsilon(0.01));  // a texel each side
  CHECK(patch.box.hi.x <= 64 + 1.01F);
  CHECK(patch.radius == Approx(std::sqrt(2.0) * 32 + 1).epsilon(0.01));
}
