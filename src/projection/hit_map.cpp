// SPDX-License-Identifier: Apache-2.0
//
// A map is read by two kinds of readers. People and compositors take u, v, UDIM, distance and
// angle. `pounce apply` takes the rest: hits as they were found, so that what it paints is what a
// transfer paints, to the bit. Texel coordinates are two numbers for that, a whole one and a
// fraction: their sum as one float would lose bits.
//
// A hit's key has its distance alone: on which side of the texel the source lies, and how it is
// turned, says the facet, which is gone when the search is over. SurfacePoints keeps both while the
// facet is there.
#include "projection/hit_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/portable_math.h"
#include "mesh/uv_tiles.h"
#include "pounce/error.h"
#include "projection/search.h"

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

/// Whole numbers up to this are exact as floats. Coordinates beyond are a source whose UVs repeat
/// an image thousands of times.
constexpr std::int32_t kMostWhole = 1 << 24;
/// Instead of a page: the place is no float.
constexpr float kNoPage = -1;

enum : std::size_t {
  kCoverage = 2,
  kDistance = 4,
  kPage = 6,
  kBase = 7,
  kFrac = 9,
  kBy = 11,
  kAxes = 17,
  kEdge = 23
};

bool is_whole(float value, double most) {
  return std::abs(double{value}) <= most && std::trunc(value) == value;  // not of NaN
}

/// Reads the texels of a block in the order of its hits.
class MapReading {
 public:
  MapReading(const MapWindow& window, std::size_t pages, float max_distance,
             const std::string& name)
      : window_(window), pages_(pages), max_distance_(max_distance), name_(name) {}

  HitBlock read() {
    for (std::uint32_t place = 0; place < HitBlock::kTexels; ++place) {
      const std::uint32_t texel = hit_texel(place), x = texel % 64, y = texel / 64;
      if (x >= window_.width || y >= window_.height) continue;
      const float* const values =
          window_.texels.data() + (y * window_.stride + x) * kHitMapNames.size();
      if (values[kCoverage] == 0) continue;
      if (values[kCoverage] != 1) refuse("coverage is neither 0 nor 1");
      block_.mark(texel);
      add_hit(values);
      add_texel(values);
    }
    if (!block_.axes.empty() && !block_.per_texel.empty())
      refuse("some texels have axes and others of the same block have none");
    return std::move(block_);
  }

 private:
  [[noreturn]] void refuse(const std::string& what) const {
    throw Error(ErrorKind::input,
                fmt::format("{}: {}; write the map again, and do not edit, resize or convert it",
                            name_, what));
  }

  void add_hit(const float* values) {
    if (values[kPage] == kNoPage) {
      throw Error(ErrorKind::input,
                  fmt::format("{}: some texels lie more than {} texels from the source's origin of "
                              "UV space, and a map is not exact there; use pounce transfer",
                              name_, kMostWhole));
    }
    if (!is_whole(values[kPage], static_cast<double>(pages_ - 1)) || values[kPage] < 0)
      refuse("its hits are on materials that the source does not have");
    HitFacet facet;
    facet.page = static_cast<std::int32_t>(values[kPage]);
    for (std::size_t i = 0; i < 2; ++i) {
      if (!is_whole(values[kBase + i], kMostWhole))
        refuse("a texel coordinate is not a whole number");
      facet.base[i] = static_cast<std::int32_t>(values[kBase + i]);
      if (!(std::abs(double{values[kFrac + i]}) <= kMostWhole))
        refuse("a texel coordinate is not a number");
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      facet.x_by[axis] = values[kBy + axis];
      facet.y_by[axis] = values[kBy + 3 + axis];
    }
    const auto hint =
        std::bit_cast<std::uint32_t>(facet.x_by[0]) ^ std::bit_cast<std::uint32_t>(facet.y_by[1]);
    block_.facet.push_back(facets_.number(hint, facet));
    block_.frac_x.push_back(values[kFrac]);
    block_.frac_y.push_back(values[kFrac + 1]);
    const float distance = std::abs(values[kDistance]);
    if (!std::isfinite(distance)) refuse("a distance is not a number");
    count_distance(distance, max_distance_, block_.distances);
    block_.distance_steps += distance_steps(distance, max_distance_);
  }

  void add_texel(const float* values) {
    if (values[kEdge] != 0) {
      if (!(values[kEdge] > 0)) refuse("a texel has no size");
      block_.per_texel.push_back(values[kEdge]);
      return;
    }
    surface::TexelAxes axes;
    axes.x = {values[kAxes], values[kAxes + 1], values[kAxes + 2]};
    axes.y = {values[kAxes + 3], values[kAxes + 4], values[kAxes + 5]};
    const auto hint =
        std::bit_cast<std::uint32_t>(axes.x.x) ^ std::bit_cast<std::uint32_t>(axes.y.y);
    block_.owner.push_back(axes_.number(hint, axes));
  }

  const MapWindow& window_;
  const std::size_t pages_;
  const float max_distance_;
  const std::string& name_;
  HitBlock block_;
  NumberedValues<HitFacet> facets_{block_.facets};
  NumberedValues<surface::TexelAxes> axes_{block_.axes};
};

}  // namespace

HitMapTexel map_texel(const HitPacket& hit, const TexelPacket& texels, const SurfacePacket& surface,
                      std::size_t lane, ImageSize lattice, const surface::TexelAxes* axes) {
  HitMapTexel out{};
  out[kCoverage] = 1;
  if (lattice.width > 0) {
    const Split x = split(hit.base_x[lane], hit.frac_x[lane], lattice.width);
    const Split y = split(hit.base_y[lane], hit.frac_y[lane], lattice.height);
    out[0] = static_cast<float>(x.rest);
    out[1] = static_cast<float>(1 - y.rest);
    out[3] =
        static_cast<float>(mesh::udim_number(mesh::tile_of_period(x.period, y.period)).value_or(0));
  }
  const float distance = distance_of(hit.key[lane], texels);
  out[kDistance] = surface.height[lane] < 0 ? -distance : distance;
  const Vec3d normal{surface.nx[lane], surface.ny[lane], surface.nz[lane]};
  const Vec3d own{texels.nx[lane], texels.ny[lane], texels.nz[lane]};
  const double size = length(normal), own_size = length(own);
  if (size > 0 && own_size > 0)
    out[5] = static_cast<float>(degrees_between(normal * (1 / size), own * (1 / own_size)));
  const std::array<std::int32_t, 2> base{hit.base_x[lane], hit.base_y[lane]};
  out[kPage] = static_cast<float>(hit.page[lane]);
  for (std::size_t i = 0; i < 2; ++i) {
    out[kBase + i] = static_cast<float>(base[i]);
    if (std::abs(std::int64_t{base[i]}) > kMostWhole) out[kPage] = kNoPage;
  }
  out[kFrac] = hit.frac_x[lane];
  out[kFrac + 1] = hit.frac_y[lane];
  for (std::size_t axis = 0; axis < 3; ++axis) {
    out[kBy + axis] = hit.x_by[axis][lane];
    out[kBy + 3 + axis] = hit.y_by[axis][lane];
  }
  if (axes == nullptr) {
    out[kEdge] = texels.per_texel[lane];
  } else {
    const std::array<float, 6> six{axes->x.x, axes->x.y, axes->x.z,
                                   axes->y.x, axes->y.y, axes->y.z};
    std::copy(six.begin(), six.end(), out.begin() + kAxes);
  }
  return out;
}

HitBlock hits_of_map(const MapWindow& window, std::size_t pages, float max_distance,
                     const std::string& name) {
  return MapReading(window, pages, max_distance, name).read();
}

}  // namespace pounce::projection
