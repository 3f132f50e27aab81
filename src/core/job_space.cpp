// SPDX-License-Identifier: Apache-2.0
//
// Two things are done to positions as a file is read. Axes are permuted and negated, which is
// exact, so turning a file and turning it back gives the same bytes. And a scan at map coordinates,
// hundreds of kilometres from 0, is moved near 0: single precision has steps of 3 to 50 cm there.
// What is subtracted must not add an error of its own, hence a multiple of a power of two as large
// as the box: such a difference of floats is exact. One origin serves source and targets, so it
// depends on the source's box alone.
#include "core/job_space.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "pounce/error.h"

namespace pounce {
namespace {

[[noreturn]] void fail(std::string_view text) {
  throw Error(ErrorKind::usage,
              fmt::format("\"{}\" are not valid axes; write x, y and z once each in the wanted "
                          "order, with a minus for each reversed one, such as x,-y,-z",
                          text));
}

/// A box farther away than so many times its size has an origin (docs/decisions/042-origin.md).
constexpr double kFarOverSize = 64;

double largest(Vec3d v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); }

}  // namespace

bool Axes::mirrors() const {
  // Cyclic orders are rotations; the others swap two axes, which mirrors, as each minus does.
  const bool even = from[1] == (from[0] + 1) % 3;
  return (even ? 1 : -1) * sign[0] * sign[1] * sign[2] < 0;
}

void Axes::apply(Vec3f& sigma, std::array<float, 4>& rotation) const {
  const std::array<float, 3> old{sigma.x, sigma.y, sigma.z};
  sigma = {old[from[0]], old[from[1]], old[from[2]]};
  // The axis of a rotation is a pseudovector: a mirror turns it round.
  const float turn = mirrors() ? -1.0F : 1.0F;
  const Vec3f v = apply(Vec3f{rotation[1], rotation[2], rotation[3]}) * turn;
  rotation = {rotation[0], v.x, v.y, v.z};
}

// All three must be named, each once: two of them would leave a guess about the third one's sign.
Axes parse_axes(std::string_view text) {
  Axes axes;
  std::string_view rest = text;
  unsigned seen = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t comma = rest.find(',');
    if ((comma == std::string_view::npos) != (i == 2)) fail(text);
    std::string_view name = rest.substr(0, comma);
    if (i < 2) rest.remove_prefix(comma + 1);
    if (name.starts_with('-') || name.starts_with('+')) {
      axes.sign[i] = name.front() == '-' ? -1 : 1;
      name.remove_prefix(1);
    }
    if (name.size() != 1 || name[0] < 'x' || name[0] > 'z') fail(text);
    axes.from[i] = static_cast<std::uint8_t>(name[0] - 'x');
    seen |= 1U << axes.from[i];
  }
  if (seen != 7) fail(text);
  return axes;
}

std::string to_text(const Axes& axes) {
  std::string text;
  for (std::size_t i = 0; i < 3; ++i) {
    if (i > 0) text += ',';
    if (axes.sign[i] < 0) text += '-';
    text += static_cast<char>('x' + axes.from[i]);
  }
  return text;
}

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
