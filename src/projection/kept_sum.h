// SPDX-License-Identifier: Apache-2.0
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
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

namespace pounce::projection {

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
