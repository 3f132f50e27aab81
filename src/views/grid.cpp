// SPDX-License-Identifier: Apache-2.0
#include "views/grid.h"

#include <algorithm>
#include <cmath>

#include "core/directions.h"

namespace pounce::views {
namespace {

/// Pixels are not finer, of a target's diagonal: finer views show the scene's noise, and give less.
constexpr double kLeastPixel = 1.4e-3;
/// A target's box is cut to multiples of a power of two, at least so many of which are its length.
constexpr int kLeastUnitsLog2 = 3;
/// Of the region's radius: depths reach so much farther, both ways. What lies beyond is told from
/// what hides a texel by this much.
constexpr float kDepthMargin = 0.125F;

/// The nearest power of the square root of two, by comparing: logarithms are not the same
/// everywhere.
double rounded_pixel(double wanted) {
  int exponent;
  const double fraction = std::frexp(wanted, &exponent);  // in [1/2, 1)
  const double low = std::ldexp(1.0, exponent - 1);
  constexpr double kQuarter = 0.59460355750136051, kThreeQuarters = 0.84089641525371461;
  return fraction < kQuarter ? low : fraction < kThreeQuarters ? low * 1.4142135623730951 : 2 * low;
}

}  // namespace

std::vector<Frame> frames_around(std::uint32_t views) {
  // Each direction is a golden angle (2 pi / phi) round the axis from the one before.
  constexpr double kCosine = -0.73736887807831986, kSine = -0.67549029426152333;
  std::vector<Frame> frames;
  double x = 1, y = 0;
  for (std::uint32_t i = 0; i < views; ++i) {
    const double z = 1 - (2.0 * i + 1) / views, across = std::sqrt(1 - z * z);
    const Vec3d forward{across * x, across * y, z};
    const Vec3d up = std::abs(forward.y) < 0.9 ? Vec3d{0, 1, 0} : Vec3d{0, 0, 1};
    const Vec3d right = cross(forward, up);
    frames.push_back({Vec3f(unit_vector(right)), Vec3f(unit_vector(cross(forward, right))),
                      Vec3f(unit_vector(forward))});
    const double turned = x * kCosine - y * kSine;
    y = x * kSine + y * kCosine;
    x = turned;
  }
  return frames;
}

Grid::Grid(const Box3f& target, float edge, std::uint32_t views) : frames_(frames_around(views)) {
  const Vec3d lo(target.lo), hi(target.hi), size = hi - lo;
  const double longest = std::max({size.x, size.y, size.z, 1e-30});
  int exponent;
  std::frexp(longest, &exponent);
  const double round = std::ldexp(1.0, exponent - 1 - kLeastUnitsLog2);
  const auto cut = [&](double low, double high) {
    return Vec2d{std::floor(low / round) * round, std::ceil(high / round) * round};
  };
  const Vec2d x = cut(lo.x, hi.x), y = cut(lo.y, hi.y), z = cut(lo.z, hi.z);
  region_ = {Vec3f(Vec3d{x.x, y.x, z.x}), Vec3f(Vec3d{x.y, y.y, z.y})};
  middle_ = Vec3f(Vec3d{(x.x + x.y) / 2, (y.x + y.y) / 2, (z.x + z.y) / 2});
  const double radius = length(Vec3d{x.y - x.x, y.y - y.x, z.y - z.x}) / 2;
  diagonal_ = static_cast<float>(2 * radius);
  const double pixel =
      rounded_pixel(std::max({kLeastPixel * length(size), double{edge}, longest * 1e-6}));
  pixel_ = static_cast<float>(pixel);
  per_pixel_ = static_cast<float>(1 / pixel);
  across_ = static_cast<std::uint32_t>(2 * (radius / pixel + 2) / kTileEdge) + 1;
  middle_pixel_ = static_cast<float>(across_ * kTileEdge / 2) - 0.5F;
  depth_step_ = static_cast<float>(2 * (1 + kDepthMargin) * std::max(radius, 1e-30) / kMostDepth);
  per_step_ = 1 / depth_step_;
}

void Grid::begin_within(Vec3f point) {
  begins_.clear();
  for (std::uint32_t view = 0; view < views(); ++view) begins_.push_back(see(view, point).depth);
}

bool Grid::has(std::uint32_t view, std::uint32_t tile_x, std::uint32_t tile_y) const {
  const Frame& f = frames_[view];
  const Vec3f half = (region_.hi - region_.lo) * 0.5F;
  const auto meets = [&](Vec3f axis, std::uint32_t tile) {
    const float reach =
        (std::abs(axis.x) * half.x + std::abs(axis.y) * half.y + std::abs(axis.z) * half.z) *
        per_pixel_;
    const float low = static_cast<float>(tile * kTileEdge) - kApron,
                high = low + static_cast<float>(kStoredEdge);
    return middle_pixel_ - reach <= high && low <= middle_pixel_ + reach;
  };
  return meets(f.right, tile_x) && meets(f.down, tile_y);
}

std::uint64_t Grid::tiles() const {
  std::uint64_t count = 0;
  for (std::uint32_t view = 0; view < views(); ++view) {
    for (std::uint32_t y = 0; y < across_; ++y) {
      for (std::uint32_t x = 0; x < across_; ++x) count += has(view, x, y) ? 1 : 0;
    }
  }
  return count;
}

store::ColourDirectory Grid::image(std::uint32_t samples) const {
  store::ColourDirectory image;
  image.width = edge();
  image.height = views() * edge();
  image.channels = samples;
  image.depth = Depth::u16;
  image.wrap_u = image.wrap_v = mesh::Wrap::clamp;
  return image;
}

void Grid::add_to(Hasher& hash) const {
  hash.add(views());
  hash.add(pixel_);
  for (const float begin : begins_) hash.add(begin);
  for (const Vec3f corner : {region_.lo, region_.hi}) {
    hash.add(corner.x);
    hash.add(corner.y);
    hash.add(corner.z);
  }
}

}  // namespace pounce::views
