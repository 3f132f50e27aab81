// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "pounce/options.h"
#include "projection/footprint.h"
#include "store/blocks/colour_store.h"

namespace pounce::projection {

/// A texel coordinate of an image: the whole texel at or below it and the rest, 0 <= rest < 1.
struct Coordinate {
  std::int32_t texel = 0;
  double rest = 0;
};

/// Brings a coordinate of an image, a texel and a rest, into it as its wrap mode says: -1 <= texel
/// < size, so that the tile exists and its apron holds every tap.
inline Coordinate placed(Coordinate at, std::uint32_t size, mesh::Wrap wrap) noexcept {
  const auto n = static_cast<std::int32_t>(size);
  if (at.texel >= 0 && at.texel < n) return at;
  if (wrap == mesh::Wrap::clamp)
    return at.texel < 0 ? Coordinate{-1, at.texel < -1 ? 0 : at.rest} : Coordinate{n - 1, 0};
  if (wrap == mesh::Wrap::repeat)
    return {static_cast<std::int32_t>(store::wrapped(at.texel, n, wrap)), at.rest};
  const std::int32_t inside =
      static_cast<std::int32_t>(store::wrapped(at.texel, std::int64_t{2} * n, mesh::Wrap::repeat));
  if (inside < n) return {inside, at.rest};
  // The mirrored period runs backwards: x becomes 2 n - 1 - x.
  return at.rest > 0 ? Coordinate{2 * n - 2 - inside, 1 - at.rest}
                     : Coordinate{2 * n - 1 - inside, 0};
}

/// The same of a hit's coordinate base + frac.
inline Coordinate placed(std::int32_t base, float frac, std::uint32_t size,
                         mesh::Wrap wrap) noexcept {
  auto whole = static_cast<std::int32_t>(frac);
  if (static_cast<float>(whole) > frac)
    --whole;  // rounded towards zero: towards minus infinity instead
  return placed({base + whole, static_cast<double>(frac) - whole}, size, wrap);
}

/// The same of a coordinate that is one number.
inline Coordinate placed(double texel, std::uint32_t size, mesh::Wrap wrap) noexcept {
  constexpr double kFarthest = 2e9;
  if (!(texel > -kFarthest && texel < kFarthest)) texel = texel > 0 ? kFarthest : -kFarthest;
  auto whole = static_cast<std::int32_t>(texel);
  if (whole > texel) --whole;
  return placed(Coordinate{whole, texel - whole}, size, wrap);
}

/// A texel coordinate over a row of UDIM tiles: which tile holds it, and where in it.
struct TileCoordinate {
  std::int32_t period = 0;  ///< tiles to the right of (below) the one at 0
  double texel = 0;         ///< in the tile, -0.5 <= texel < size - 0.5
};

/// The tile of a hit's coordinate base + frac, on a lattice whose tiles are `size` texels.
inline TileCoordinate in_tile(std::int32_t base, float frac, std::uint32_t size) noexcept {
  const double texel = static_cast<double>(base) + frac;
  const auto n = static_cast<std::int64_t>(size);
  const auto nearest = static_cast<std::int64_t>(std::floor(texel + 0.5));
  const std::int64_t period = (nearest >= 0 ? nearest : nearest - n + 1) / n;
  return {static_cast<std::int32_t>(period), texel - static_cast<double>(period * n)};
}

/// Float images: a place within 1/512 texel of a centre is that centre, so that a texel that meets
/// a texel has its samples bit by bit, however large those beside it are (docs/decisions/008:
/// places of a surface on itself are off by up to 1/1500). Integer images round to the same by
/// themselves.
inline double settled(double rest) noexcept {
  constexpr double kNear = 1.0 / 512;
  return rest < kNear ? 0 : rest > 1 - kNear ? 1 : rest;
}

/// A place in a tile of `size` texels, in an image of `image_size` texels that shows the same tile:
/// -1 <= texel < image_size.
inline Coordinate scaled(double texel, std::uint32_t size, std::uint32_t image_size) noexcept {
  if (size != image_size) texel = (texel + 0.5) * image_size / size - 0.5;
  const double whole = std::floor(texel);
  return {static_cast<std::int32_t>(whole), texel - whole};
}

/// Weights of the texels around a hit, in steps of 2^-20.
struct Taps {
  /// Whether a kernel reaches beyond the four texels around the hit.
  bool wide = false;
  /// If not, of these four, row by row, and their sum.
  std::array<std::int32_t, 4> square{};
  std::int32_t total = 0;
  /// If so, of four columns and of four rows, the first before the hit's texel: 2^20 each.
  std::array<std::int32_t, 4> across{}, down{};
  /// Where the target is finer: what the sum takes of the moves of the two columns and rows in the
  /// middle (kept_sum()), the first one's first.
  bool sharpened = false;
  std::array<std::int32_t, 2> move_across{}, move_down{};
};

/// A blend kernel: weights for a hit at `u`, `v` (0..1) beyond its texel. It may reach from texel -
/// 1 to texel + 2 (the apron). Replaceable: everything else does not know which one it is.
using BlendKernel = void (*)(double u, double v, Taps& taps) noexcept;

/// The tent (1 - |du|)(1 - |dv|) in the hit Gaussian's texel frame.
void tent(double u, double v, Taps& taps) noexcept;

/// Keys' cubic convolution with a = -1/2 (Catmull-Rom): what is straight stays straight.
void cubic(double u, double v, Taps& taps) noexcept;

/// The same with a = -3/4: steeper at edges.
void sharp(double u, double v, Taps& taps) noexcept;

BlendKernel kernel_of(Filter filter) noexcept;
/// The a of Keys' kernels, or kTent.
inline constexpr double kTent = 0;
double keys_of(BlendKernel kernel) noexcept;

/// Changes a wide kernel's weights for a hit at `u`, `v` to what a finer target asks for.
void sharpen_wide(Sharpening by, double u, double v, Taps& taps) noexcept;
/// The same of any kernel's: the tent's stay as they are.
inline void sharpen(Sharpening by, double u, double v, Taps& taps) noexcept {
  if (taps.wide && by.any()) sharpen_wide(by, u, v, taps);
}

/// One texel's blended channels: 0..1 for integer images, as stored for float ones.
using Blended = std::array<double, 4>;

/// What happens to colours that an image holds multiplied by their alpha.
enum class BlendAlpha : std::uint8_t {
  straight,  ///< each texel's are divided by its alpha before they are blended
  stored     ///< they are blended as they are
};

/// Blends the texels around a hit. `tile` is a decoded colour tile of `image`; column and row are
/// the hit's texel in it, apron excluded, -1..63. Sums over four texels are integers and come out
/// the same in any order: integer samples are counted as they are, float samples times their
/// weights in 2^-64 of the largest one's exponent. A wide kernel goes along rows first and then
/// down: each row's sum is kept between the row's two texels beside the hit, the column's between
/// the two rows beside it (docs/decisions/028, of finer targets 037); floats are summed in that
/// order, in double precision. A hit that has one texel alone gives its samples exactly. noexcept,
/// thread-safe.
Blended blend(const store::ColourDirectory& image, const std::byte* tile, int column, int row,
              const Taps& taps, BlendAlpha alpha) noexcept;
/// The same for 8-bit images, rounded to 8 bits at `out` (image.channels of them).
void blend_u8(const store::ColourDirectory& image, const std::byte* tile, int column, int row,
              const Taps& taps, std::byte* out) noexcept;

// --- sums of four in a row -----------------------------------------------------------------------
//
// A wide kernel's sum of four in a row, and what it is kept between.
//
// Without a bound a cubic rings beside edges and shows what another chart painted. So the sum stays
// between the two in the middle, those beside the hit (docs/decisions/028).
//
// A source's texel is a mean over its square: where it is a peak, the picture is higher in its
// middle. For a target that is finer, the two in the middle are therefore moved first, away from
// their neighbours' line, and the sum stays between what they have become
// (docs/decisions/037). Each one's move depends on itself and its two neighbours alone, and the sum
// takes of it 1 - t at a place t beyond it: so nothing jumps where the next four come in. It is no
// more than half the lesser of the steps to the neighbours. So rising values go on rising; and what
// lies beyond the two in the middle moves the result by no more than half of what they differ.

constexpr std::int32_t kOne = 1 << 20;  // a weight of 1

template <typename Sum>
Sum weighted(const std::array<std::int32_t, 4>& weights,
             const std::array<Sum, 4>& values) noexcept {
  Sum sum = 0;
  for (std::size_t i = 0; i < 4; ++i) sum += static_cast<Sum>(weights[i]) * values[i];
  return sum;
}

/// The sum of four in a row, kept between the two in the middle; 2^20 times as large as they are.
template <typename Sum>
Sum kept_sum(const std::array<std::int32_t, 4>& weights,
             const std::array<Sum, 4>& values) noexcept {
  return std::clamp<Sum>(weighted(weights, values), std::min(values[1], values[2]) * kOne,
                         std::max(values[1], values[2]) * kOne);
}

/// How far a value lies from its neighbours' line, twice, by the steps to it and from it; 1/24 of
/// that is taken at most. No more than twelve times the lesser step; and no more than takes the
/// value to 0 or to `one`, so that what is in 0..1 stays there and no sign changes, without a jump.
template <typename Sum>
[[gnu::always_inline]] inline Sum bend(Sum value, Sum to, Sum from, Sum one) noexcept {
  Sum room = std::min(value, one - value);  // of integers, which are in 0..one
  if constexpr (std::is_floating_point_v<Sum>) {
    room = std::min({std::abs(value), std::abs(one - value),
                     one * std::numeric_limits<float>::max() - std::abs(value)});
  }
  const Sum most = std::min(12 * std::min(std::abs(to), std::abs(from)), 24 * room);
  return std::clamp<Sum>(to - from, -most, most);
}

/// kept_sum() where a target is finer: of the moves of the two in the middle the sum takes `moves`,
/// in steps of 2^-20, together 1/24 at most. `one` is what 1 is among the values, or the largest
/// sample of integers.
template <typename Sum>
[[gnu::always_inline]] inline Sum sharpened_sum(const std::array<std::int32_t, 4>& weights,
                                                const std::array<std::int32_t, 2>& moves,
                                                const std::array<Sum, 4>& values,
                                                Sum one) noexcept {
  const Sum between = values[2] - values[1];
  const Sum left = bend<Sum>(values[1], values[1] - values[0], between, one);
  const Sum right = bend<Sum>(values[2], between, values[3] - values[2], one);
  const auto whole = static_cast<Sum>(moves[0] + moves[1]);
  const Sum first = values[1] * kOne + whole * left, second = values[2] * kOne + whole * right;
  const Sum sum = weighted(weights, values) + static_cast<Sum>(moves[0]) * left +
                  static_cast<Sum>(moves[1]) * right;
  return std::clamp<Sum>(sum, std::min(first, second), std::max(first, second));
}

}  // namespace pounce::projection
