// SPDX-License-Identifier: Apache-2.0
//
// A hit's key has its distance alone: on which side of the texel the source lies, and how it is
// turned, says the facet, which is gone when the search is over. SurfacePoints keeps both while the
// facet is there.
#include "projection/hit_map.h"

#include <cmath>

#include "core/portable_math.h"
#include "mesh/uv_tiles.h"

namespace pounce::projection {
namespace {

/// A coordinate in images side by side: which of them, and where in it, 0 to 1.
struct Split {
  std::int32_t period = 0;
  double rest = 0;
};

Split split(std::int32_t base, float frac, std::uint32_t size) {
  const double in_images = (static_cast<double>(base) + frac + 0.5) / size;
  const double whole = std::floor(in_images);
  return {static_cast<std::int32_t>(whole), in_images - whole};
}

/// Between two directions of unit length. The halves of their sum and difference are the cosine and
/// sine of half the angle, both exact where an arc cosine is not: at small angles.
double degrees_between(Vec3d a, Vec3d b) {
  constexpr double kDegrees = 0x1.ca5dc1a63c1f8p+5;  // 180 / pi
  return 2 * kDegrees * atan_same(length(a - b) / length(a + b));
}

}  // namespace

HitMapTexel map_texel(const HitPacket& hit, const TexelPacket& texels, const SurfacePacket& surface,
                      std::size_t lane, ImageSize lattice) {
  HitMapTexel out{};
  out[2] = 1;
  if (lattice.width > 0) {
    const Split x = split(hit.base_x[lane], hit.frac_x[lane], lattice.width);
    const Split y = split(hit.base_y[lane], hit.frac_y[lane], lattice.height);
    out[0] = static_cast<float>(x.rest);
    out[1] = static_cast<float>(1 - y.rest);
    out[3] =
        static_cast<float>(mesh::udim_number(mesh::tile_of_period(x.period, y.period)).value_or(0));
  }
  const float distance = distance_of(hit.key[lane], texels);
  out[4] = surface.height[lane] < 0 ? -distance : distance;
  const Vec3d normal{surface.nx[lane], surface.ny[lane], surface.nz[lane]};
  const Vec3d own{texels.nx[lane], texels.ny[lane], texels.nz[lane]};
  const double size = length(normal), own_size = length(own);
  if (size > 0 && own_size > 0)
    out[5] = static_cast<float>(degrees_between(normal * (1 / size), own * (1 / own_size)));
  return out;
}

}  // namespace pounce::projection
