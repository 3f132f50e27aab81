// SPDX-License-Identifier: Apache-2.0
//
// A target texel that covers more than a texel of the source shows its mean.
//
// What is wanted is a box as wide as the footprint. A texel of level n is already a box of 2^n, and
// a cubic lookup adds no width of its own: second moments add up, so lookups spread over a side of
// length s must have the variance (s^2 - 4^n) / 12. A side of one texel asks for none: one lookup,
// as ever. `count` lookups at distance d have the variance d^2 (count^2 - 1) / 12.
//
// The level is the one whose texels go 1.5 to 3 times into the footprint's narrow side (coarser
// ones leave moire, finer ones cost more: docs/decisions/033), and 32 times at most into its long
// one.
#include "projection/footprint.h"

#include <algorithm>
#include <cmath>

namespace pounce::projection {
namespace {

double squared(Vec2d v) noexcept { return v.x * v.x + v.y * v.y; }

/// The lookups along one side.
int spread(Vec2d side, double texel, Vec2d& step) noexcept {
  const double length2 = squared(side), own = kExact * texel;
  step = {};
  if (!(length2 > own * own)) return 1;
  const double width = std::sqrt(length2 - own * own);
  const int count = static_cast<int>(
      std::clamp(std::ceil(width / (kSpacing * texel)), 2.0, double{kMostLookups}));
  const double scale = width / std::sqrt(length2 * (count * count - 1));
  step = {side.x * scale, side.y * scale};
  return count;
}

Lookups lookups_at(const Footprint& footprint, std::uint32_t level, double share) noexcept {
  Lookups out;
  out.level = level;
  out.share = share;
  const auto texel = static_cast<double>(std::uint64_t{1} << level);
  out.count_a = spread(footprint.a, texel, out.step_a);
  out.count_b = spread(footprint.b, texel, out.step_b);
  return out;
}

}  // namespace

Footprint footprint_of(const TexelGradients& gradients, Vec3f along_x, Vec3f along_y) noexcept {
  const auto texels = [&](Vec3f way) {
    return Vec2d{dot(Vec3d(gradients.x), Vec3d(way)), dot(Vec3d(gradients.y), Vec3d(way))};
  };
  return {texels(along_x), texels(along_y)};
}

Footprint footprint_of(const TexelGradients& gradients, float edge) noexcept {
  const Vec3d x(gradients.x), y(gradients.y);
  const double xx = dot(x, x), size = std::sqrt(xx);
  if (!(size > 0)) return {{0, std::sqrt(dot(y, y)) * edge}, {}};
  const double across = dot(x, y) / size;
  const double beside = std::sqrt(std::max(dot(y, y) - across * across, 0.0));
  return {{size * edge, across * edge}, {0, beside * edge}};
}

Sharpening sharpening_of(const Footprint& footprint) noexcept {
  // A box of side s has the mean f + s^2 f'' / 24; squares of a parallelogram's sides add up.
  const auto along = [](double a, double b) {
    const double finer = kFine * kFine - (a * a + b * b);
    return finer > 0 ? static_cast<std::int32_t>(kSharpest * finer / (kFine * kFine) + 0.5) : 0;
  };
  return {along(footprint.a.x, footprint.b.x), along(footprint.a.y, footprint.b.y)};
}

FootprintLookups lookups_of(const Footprint& footprint, std::uint32_t last_level) noexcept {
  FootprintLookups out;
  out.sharpening = sharpening_of(footprint);
  const double aa = squared(footprint.a), bb = squared(footprint.b);
  // What is no number, too, is one lookup.
  if (!(aa < kMostTexels2 && bb < kMostTexels2) || std::max(aa, bb) <= kExact * kExact) return out;
  // The parallelogram's widths along its ellipse's axes: singular values of (a, b).
  const double sum = aa + bb;
  const double area = footprint.a.x * footprint.b.y - footprint.a.y * footprint.b.x;
  const double apart = std::sqrt(std::max(sum * sum - 4 * area * area, 0.0));
  const double wide = std::sqrt((sum + apart) / 2);
  const double narrow = wide > 0 ? std::abs(area) / wide : 0;
  double size = std::max(narrow / kNarrow, wide / kLong);
  std::uint32_t level = 0;
  for (; level < last_level && size >= 2; ++level) size /= 2;
  double next = 0;
  if (level < last_level && size > kBlendFrom) next = (size - kBlendFrom) / (2 - kBlendFrom);
  out.sets[0] = lookups_at(footprint, level, 1 - next);
  if (next > 0) out.sets[out.count++] = lookups_at(footprint, level + 1, next);
  return out;
}

}  // namespace pounce::projection
