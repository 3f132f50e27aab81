// SPDX-License-Identifier: Apache-2.0
#include "core/origin.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace pounce {
namespace {

/// A box farther away than so many times its size has an origin (docs/decisions/042-origin.md).
constexpr double kFarOverSize = 64;

double largest(Vec3d v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); }

}  // namespace

Vec3d origin_for(const Box3f& box) {
  if (box.empty()) return {};
  const Vec3d middle = (Vec3d(box.lo) + Vec3d(box.hi)) * 0.5;
  const double away = largest(middle);
  // What a small box measures in single precision is a matter of rounding.
  constexpr double kLastPlace = std::numeric_limits<float>::epsilon();
  const double size = std::max(largest(Vec3d(box.hi) - Vec3d(box.lo)), away * kLastPlace);
  if (!(away > kFarOverSize * size) || !std::isfinite(away)) return {};
  int exponent = 0;
  std::frexp(size, &exponent);  // size < 2^exponent
  const double unit = std::ldexp(1.0, exponent);
  const auto rounded = [unit](double v) { return std::round(v / unit) * unit; };
  return {rounded(middle.x), rounded(middle.y), rounded(middle.z)};
}

}  // namespace pounce
