// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "core/portable_math.h"
#include "pounce/error.h"
#include "projection/hit_block.h"

namespace pounce::projection {
namespace {

/// One lane that hit, 0.25 away from a facet that faces the texel.
struct Hit {
  TexelPacket texels{};
  HitPacket hit{};
  SurfacePacket surface{};

  Hit(std::int32_t base_x, float frac_x, std::int32_t base_y, float frac_y) {
    texels.coarseness = 1;
    texels.nz[3] = 1;
    hit.key[3] = key_of(0.25F, texels);
    hit.base_x[3] = base_x;
    hit.frac_x[3] = frac_x;
    hit.base_y[3] = base_y;
    hit.frac_y[3] = frac_y;
    surface.height[3] = 0.2F;  // of the triangle's own point: the hit lies outside of it
    surface.nz[3] = 2;         // interpolated normals are not of unit length
  }
  HitMapTexel all(ImageSize lattice, const surface::TexelAxes* axes = nullptr) const {
    return map_texel(hit, texels, surface, 3, lattice, axes);
  }
  /// What people read of it.
  std::array<float, 6> texel(ImageSize lattice) const {
    const HitMapTexel all = this->all(lattice);
    std::array<float, 6> first{};
    std::copy_n(all.begin(), first.size(), first.begin());
    return first;
  }
};

}  // namespace

TEST_CASE("a map has the place on the source's image, v up", "[map]") {
  // Column 2 and a half of 8: its place in UV space is 3/8. Row 0 of 4 has its centre at v = 7/8.
  CHECK(Hit(2, 0.5F, 0, 0).texel({8, 4}) ==
        std::array<float, 6>{0.375F, 0.875F, 1, 1001, 0.25F, 0});
  // One tile to the right and one up: columns from 8 on, rows from -4 on.
  CHECK(Hit(9, 0.5F, -4, 0).texel({8, 4}) ==
        std::array<float, 6>{0.25F, 0.875F, 1, 1012, 0.25F, 0});
  // Left of all UDIMs: a place, but no tile.
  CHECK(Hit(-8, 0.5F, 0, 0).texel({8, 4}) == std::array<float, 6>{0.125F, 0.875F, 1, 0, 0.25F, 0});
  // A page without image.
  CHECK(Hit(2, 0.5F, 0, 0).texel({0, 0}) == std::array<float, 6>{0, 0, 1, 0, 0.25F, 0});
}

TEST_CASE("a map has the distance with its side, and the angle", "[map]") {
  Hit hit(0, 0, 0, 0);
  hit.surface.height[3] = -0.1F;
  CHECK(hit.texel({8, 4})[4] == -0.25F);
  hit.surface.nx[3] = 2;  // and nz: 45 degrees
  CHECK(hit.texel({8, 4})[5] == Approx(45).epsilon(1e-7));
  hit.surface.nz[3] = 0;
  CHECK(hit.texel({8, 4})[5] == Approx(90).epsilon(1e-7));
  hit.surface.nx[3] = 1e-6F;  // where an arc cosine would say 0
  hit.surface.nz[3] = 1;
  CHECK(hit.texel({8, 4})[5] == Approx(1e-6 * 180 / 3.14159265358979).epsilon(1e-5));
}

TEST_CASE("the arc tangent is that of the C library", "[map]") {
  for (double x = 0; x < 4; x += 1.0 / 512) CHECK(std::abs(atan_same(x) - std::atan(x)) < 1e-15);
  CHECK(atan_same(1e300) == Approx(std::atan(1e300)).epsilon(1e-15));
}

namespace {

/// A part of a map of 3 x 2 texels, wider in memory, that holds what a test puts there.
struct Window {
  std::vector<float> values = std::vector<float>(5 * 2 * kHitMapNames.size());

  void put(std::size_t x, std::size_t y, const HitMapTexel& texel) {
    std::copy(texel.begin(), texel.end(), values.begin() + index(x, y, 0));
  }
  float& at(std::size_t x, std::size_t y, const std::string& name) {
    const auto place = std::find(kHitMapNames.begin(), kHitMapNames.end(), name);
    return values[static_cast<std::size_t>(
        index(x, y, static_cast<std::size_t>(place - kHitMapNames.begin())))];
  }
  HitBlock read(std::size_t pages = 3) const {
    return hits_of_map({values, 5, 3, 2}, pages, 1, "m.exr");
  }
  std::string refusal(std::size_t pages = 3) const {
    try {
      read(pages);
    } catch (const Error& error) {
      CHECK(error.kind() == ErrorKind::input);
      return error.what();
    }
    return "";
  }

 private:
  static std::ptrdiff_t index(std::size_t x, std::size_t y, std::size_t value) {
    return static_cast<std::ptrdiff_t>((y * 5 + x) * kHitMapNames.size() + value);
  }
};

}  // namespace

TEST_CASE("a map gives back the hits that went into it, bit for bit", "[map]") {
  const bool has_axes = GENERATE(true, false);
  CAPTURE(has_axes);
  Hit one(16777216, 0.1F, -9, -0.3F), other(4, 2.5F, 7, 0.7F);
  for (Hit* hit : {&one, &other}) {
    hit->hit.page[3] = 2;
    hit->texels.per_texel[3] = 0.1F;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      hit->hit.x_by[axis][3] = 1.0F / (3 + static_cast<float>(axis));
      hit->hit.y_by[axis][3] = -1e-30F * static_cast<float>(axis);
    }
  }
  const surface::TexelAxes axes{{0.1F, -0.2F, 0}, {1e-20F, 3, -0.0F}};
  const surface::TexelAxes* const given = has_axes ? &axes : nullptr;
  Window window;
  window.put(2, 0, one.all({8, 4}, given));
  window.put(0, 1, other.all({8, 4}, given));
  window.put(1, 1, one.all({8, 4}, given));
  window.put(3, 0, other.all({8, 4}, given));  // beyond the block: its neighbour's
  const HitBlock block = window.read();
  REQUIRE(block.size() == 3);
  CHECK(block.mask[0] == 1 << 2);
  CHECK(block.mask[8] == 3);
  // In the order of a block: row 0 of the window, then row 1.
  CHECK(block.facet == std::vector<std::uint16_t>{0, 1, 0});
  CHECK(block.frac_x == std::vector<float>{0.1F, 2.5F, 0.1F});
  CHECK(block.frac_y == std::vector<float>{-0.3F, 0.7F, -0.3F});
  REQUIRE(block.facets.size() == 2);
  const HitFacet first{
      2, {16777216, -9}, {1.0F / 3, 1.0F / 4, 1.0F / 5}, {-0.0F, -1e-30F, -2e-30F}};
  CHECK(std::memcmp(&block.facets[0], &first, sizeof first) == 0);
  if (has_axes) {
    CHECK(block.owner == std::vector<std::uint16_t>{0, 0, 0});
    REQUIRE(block.axes.size() == 1);
    CHECK(std::memcmp(&block.axes[0], &axes, sizeof axes) == 0);
    CHECK(block.per_texel.empty());
  } else {
    CHECK(block.per_texel == std::vector<float>{0.1F, 0.1F, 0.1F});
    CHECK(block.axes.empty());
  }
  CHECK(block.distances[4] == 3);  // 0.25 of 1, in sixteenths
  CHECK(block.distance_steps == 3 * 16384);
}

TEST_CASE("a map is refused where it is not what was written", "[map]") {
  Hit hit(4, 0.5F, 3, 0.5F);
  hit.texels.per_texel[3] = 1;
  Window window;
  window.put(1, 1, hit.all({8, 4}));
  CHECK(window.read().size() == 1);
  const float infinity = std::numeric_limits<float>::infinity(), nan = std::nanf("");
  const auto spoil = [&](const std::string& name, float value, const std::string& message) {
    CAPTURE(name, value);
    Window spoilt = window;
    spoilt.at(1, 1, name) = value;
    CHECK_THAT(spoilt.refusal(), Catch::Contains(message) && Catch::StartsWith("m.exr: "));
  };
  spoil("A", 0.5F, "coverage is neither 0 nor 1");
  spoil("A", nan, "coverage is neither 0 nor 1");
  for (const float page : {3.0F, 0.5F, -2.0F, nan, infinity})
    spoil("hit.page", page, "materials that the source does not have");
  for (const float place : {0.5F, 16777218.0F, -16777218.0F, nan, infinity}) {
    spoil("hit.column", place, "texel coordinate");
    spoil("hit.row", place, "texel coordinate");
  }
  for (const float rest : {nan, infinity}) spoil("hit.fx", rest, "texel coordinate");
  spoil("distance", nan, "distance");
  spoil("texel.edge", -1, "no size");
  spoil("texel.edge", nan, "no size");
  // A place that no float holds: known when the map is written, and said when it is read.
  Window far;
  far.put(0, 0, Hit(16777217, 0.5F, 3, 0.5F).all({8, 4}));
  CHECK_THAT(far.refusal(), Catch::Contains("use pounce transfer"));
  // Both kinds of texels in one block.
  const surface::TexelAxes axes{{1, 0, 0}, {0, 1, 0}};
  window.put(0, 0, hit.all({8, 4}, &axes));
  CHECK_THAT(window.refusal(), Catch::Contains("have none"));
}

}  // namespace pounce::projection
