// SPDX-License-Identifier: Apache-2.0
#include "projection/hit_map.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "core/portable_math.h"

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
  HitMapTexel texel(ImageSize lattice) const { return map_texel(hit, texels, surface, 3, lattice); }
};

}  // namespace

TEST_CASE("a map has the place on the source's image, v up", "[map]") {
  // Column 2 and a half of 8: its place in UV space is 3/8. Row 0 of 4 has its centre at v = 7/8.
  CHECK(Hit(2, 0.5F, 0, 0).texel({8, 4}) == HitMapTexel{0.375F, 0.875F, 1, 1001, 0.25F, 0});
  // One tile to the right and one up: columns from 8 on, rows from -4 on.
  CHECK(Hit(9, 0.5F, -4, 0).texel({8, 4}) == HitMapTexel{0.25F, 0.875F, 1, 1012, 0.25F, 0});
  // Left of all UDIMs: a place, but no tile.
  CHECK(Hit(-8, 0.5F, 0, 0).texel({8, 4}) == HitMapTexel{0.125F, 0.875F, 1, 0, 0.25F, 0});
  // A page without image.
  CHECK(Hit(2, 0.5F, 0, 0).texel({0, 0}) == HitMapTexel{0, 0, 1, 0, 0.25F, 0});
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

}  // namespace pounce::projection
