// SPDX-License-Identifier: Apache-2.0
//
// The value of an image at a hit: the definition, one texel at a time. The kernels for sixteen
// lanes (blend_lanes.inl) repeat it operation by operation, and a test compares their bits.
// Whatever changes here changes there.
//
// Weights are integers in steps of 2^-20. With samples of 8 and 16 bits all sums are exact, so
// neither order nor instruction set can change a byte. Tents of float samples are summed exactly
// too, in 128 bits; cubics of floats in double precision, in one order.
#include "projection/blend.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/portable_math.h"

namespace pounce::projection {
namespace {

constexpr double kWeightSteps = kOne;
constexpr double kPerSquare = 1 / (kWeightSteps * kWeightSteps);

/// A sample of an integer image as it is counted: 0..255 or 0..65535.
std::int64_t steps(Depth depth, const std::byte* at) noexcept {
  if (depth == Depth::u8) return std::to_integer<std::int64_t>(*at);
  std::uint16_t v;
  std::memcpy(&v, at, sizeof v);
  return v;
}

float float_sample(Depth depth, const std::byte* at) noexcept {
  if (depth == Depth::half) {
    std::uint16_t v;
    std::memcpy(&v, at, sizeof v);
    return half_to_float(v);
  }
  float v;
  std::memcpy(&v, at, sizeof v);
  return v;
}

/// A colour without its alpha, as the depth holds it; where there is no alpha it stays as it is.
float without_alpha(Depth depth, float colour, float alpha) noexcept {
  if (alpha == 0) return colour;
  const float straight = colour / alpha;
  constexpr float kLargest = std::numeric_limits<float>::max();
  if (!std::isfinite(straight)) return std::copysign(kLargest, straight);
  const float rounded = half_to_float(float_to_half(straight));
  return depth == Depth::half && std::isfinite(rounded) ? rounded : straight;
}

/// Four weighted float samples of one channel, summed in integers.
class FloatSum {
 public:
  void add(std::int32_t weight, float sample) noexcept {
    const auto bits = std::bit_cast<std::uint32_t>(sample);
    // sample = mantissa * 2^(exponent - 150), subnormals included.
    const auto exponent = static_cast<int>(std::max(bits >> 23 & 0xFFU, 1U));
    const std::int64_t mantissa = (bits & 0x7FFFFFU) | ((bits >> 23 & 0xFFU) != 0 ? 0x800000U : 0U);
    products_[count_] = weight * ((bits >> 31) != 0 ? -mantissa : mantissa);
    exponents_[count_++] = exponent;
    if (mantissa != 0) largest_ = std::max(largest_, exponent);
  }

  double over(std::int32_t total) const noexcept {
    Wide sum = 0;  // products of 46 bits, in steps 2^64 finer than the largest sample's
    for (std::size_t i = 0; i < count_; ++i) {
      const int up = exponents_[i] - largest_ + kFiner;
      if (up >= 0)
        sum += static_cast<Wide>(products_[i]) * (Wide{1} << up);
      else if (up > -kFiner)
        sum += products_[i] >> -up;
    }
    return std::ldexp(static_cast<double>(sum) / total, largest_ - 150 - kFiner);
  }

 private:
  __extension__ typedef __int128 Wide;
  static constexpr int kFiner = 64;
  std::array<std::int64_t, 4> products_;
  std::array<int, 4> exponents_;
  std::size_t count_ = 0;
  int largest_ = 1;
};

/// Where the texels around a hit lie in a tile.
struct Around {
  const std::byte* hit;  ///< the hit's own
  std::ptrdiff_t texel;  ///< bytes to the next in the row
  std::ptrdiff_t row;    ///< bytes to the next row

  /// The texel `x` columns and `y` rows from the hit's, -1..2.
  const std::byte* at(int x, int y) const noexcept { return hit + x * texel + y * row; }
};

Around around(const std::byte* tile, int column, int row, std::size_t texel) noexcept {
  const auto bytes = static_cast<std::ptrdiff_t>(texel);
  return {tile + ((row + store::kApron) * store::kColourTileEdge + column + store::kApron) * bytes,
          bytes, store::kColourTileEdge * bytes};
}

}  // namespace

void tent(double u, double v, Taps& taps) noexcept {
  taps.wide = taps.sharpened = false;
  const auto step = [](double w) { return static_cast<std::int32_t>(w * kWeightSteps + 0.5); };
  // Rounded one by one, so they may miss 2^20 by a few steps: the blend divides by their sum.
  taps.square = {step((1 - u) * (1 - v)), step(u * (1 - v)), step((1 - u) * v), step(u * v)};
  taps.total = taps.square[0] + taps.square[1] + taps.square[2] + taps.square[3];
}

namespace {

/// Keys' weights of the four texels in a row around a place `u` beyond the second; the nearer one
/// of the two beside it gets what rounding leaves over.
std::array<std::int32_t, 4> keys(double a, double u) noexcept {
  const double rest = 1 - u;
  const auto step = [](double w) {
    constexpr std::int32_t kAbove = kOne;  // casts round towards zero: above zero, to nearest
    return static_cast<std::int32_t>(w * kWeightSteps + (kAbove + 0.5)) - kAbove;
  };
  const std::int32_t before = step(a * u * rest * rest), after = step(a * u * u * rest);
  const auto beside = [a](double x) { return ((a + 2) * x - (a + 3)) * x * x + 1; };
  if (u < 0.5) {
    const std::int32_t right = step(beside(rest));
    return {before, kOne - before - right - after, right, after};
  }
  const std::int32_t left = step(beside(u));
  return {before, left, kOne - before - left - after, after};
}

constexpr double kCubic = -0.5, kSharp = -0.75;

void keys_taps(double a, double u, double v, Taps& taps) noexcept {
  taps.wide = true;
  taps.sharpened = false;
  taps.across = keys(a, u);
  taps.down = keys(a, v);
}

}  // namespace

void cubic(double u, double v, Taps& taps) noexcept { keys_taps(kCubic, u, v, taps); }

void sharp(double u, double v, Taps& taps) noexcept { keys_taps(kSharp, u, v, taps); }

double keys_of(BlendKernel kernel) noexcept {
  return kernel == cubic ? kCubic : kernel == sharp ? kSharp : kTent;
}

BlendKernel kernel_of(Filter filter) noexcept {
  switch (filter) {
    case Filter::tent:
      return tent;
    case Filter::sharp:
      return sharp;
    case Filter::cubic:
      break;
  }
  return cubic;
}

namespace {

/// Steeper halfway between two texels, flatter beside them, by the third difference: what is
/// straight or a parabola stays what it is.
void steepen(std::int32_t by, double place, std::array<std::int32_t, 4>& weights) noexcept {
  // Weights change by multiples of (-1, 3, -3, 1), which has no sum and no first or second moment.
  constexpr double kSteeper = 3;  // 1/8 where a texel's move is 1/24 (docs/decisions/037)
  const double share = kSteeper * by * place * (1 - place) * (1 - 2 * place);
  const auto step = static_cast<std::int32_t>(share + (share < 0 ? -0.5 : 0.5));
  weights[0] -= step;
  weights[1] += 3 * step;
  weights[2] -= 3 * step;
  weights[3] += step;
}

}  // namespace

void sharpen_wide(Sharpening by, double u, double v, Taps& taps) noexcept {
  taps.sharpened = true;
  const auto shared = [](std::int32_t all, double place) -> std::array<std::int32_t, 2> {
    const auto second = static_cast<std::int32_t>(all * place + 0.5);
    return {all - second, second};
  };
  taps.move_across = shared(by.across, u);
  taps.move_down = shared(by.down, v);
  steepen(by.across, u, taps.across);
  steepen(by.down, v, taps.down);
}

namespace {

/// wide_sum() where the target is finer; apart, so that it costs nothing where none is.
template <typename RowSum, typename Sum, typename Sample>
[[gnu::noinline]] Sum sharpened_wide_sum(const Taps& taps, RowSum one,
                                         const Sample& sample) noexcept {
  std::array<Sum, 4> rows{};
  for (int y = -1; y < 3; ++y) {
    const std::array<RowSum, 4> values = {sample(-1, y), sample(0, y), sample(1, y), sample(2, y)};
    rows[static_cast<std::size_t>(y + 1)] =
        static_cast<Sum>(sharpened_sum<RowSum>(taps.across, taps.move_across, values, one));
  }
  return sharpened_sum<Sum>(taps.down, taps.move_down, rows, static_cast<Sum>(one) * kOne);
}

/// A wide kernel's result for one channel, 2^40 times as large as its samples; `sample` gives them
/// by column and row, `one` is the largest of integers, or 1. 65535 * 2^40 and what negative
/// weights add fits an integer of 64 bits.
template <typename RowSum, typename Sum, typename Sample>
Sum wide_sum(const Taps& taps, RowSum one, const Sample& sample) noexcept {
  if (taps.sharpened) return sharpened_wide_sum<RowSum, Sum>(taps, one, sample);
  std::array<Sum, 4> rows{};
  for (int y = -1; y < 3; ++y) {
    const auto row = static_cast<std::size_t>(y + 1);
    // Along a row of texel centres the outer rows have no weight, and need not be read.
    if ((y == -1 || y == 2) && taps.down[row] == 0) continue;
    const std::array<RowSum, 4> values = {sample(-1, y), sample(0, y), sample(1, y), sample(2, y)};
    rows[row] = static_cast<Sum>(kept_sum(taps.across, values));
  }
  return kept_sum(taps.down, rows);
}

/// Whether the first or the second of the two in the middle has all the weight.
bool only_one(const std::array<std::int32_t, 4>& weights, std::size_t which) noexcept {
  return weights[1 + which] == kOne && weights[2 - which] == 0 && weights[0] == 0 &&
         weights[3] == 0;
}

/// The texel that has all the weight, if one has.
const std::byte* only_texel(const Taps& taps, const Around& texels) noexcept {
  // A finer target does not show the texel itself at its centre, but what its mean implies.
  if (taps.sharpened) return nullptr;
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 2; ++x) {
      const auto i = static_cast<std::size_t>(x), j = static_cast<std::size_t>(y);
      if (taps.wide ? only_one(taps.across, i) && only_one(taps.down, j)
                    : taps.square[j * 2 + i] == taps.total)
        return texels.at(x, y);
    }
  }
  return nullptr;
}

Blended blend_floats(const store::ColourDirectory& image, const Around& texels, const Taps& taps,
                     BlendAlpha alpha) noexcept {
  const std::size_t sample = store::depth_bytes(image.depth);
  const bool divides = image.premultiplied && alpha == BlendAlpha::straight;
  const std::size_t last = image.channels - 1;
  // A hit on a centre, as in a transfer of a mesh onto itself: one read instead of four or sixteen.
  const std::byte* const only = only_texel(taps, texels);
  Blended out{};
  for (std::size_t c = 0; c < image.channels; ++c) {
    const auto value = [&](const std::byte* texel) {
      const float v = float_sample(image.depth, texel + c * sample);
      // Each texel before the sum: divided after it, transparent texels would bring in their
      // colour.
      return divides && c != last
                 ? without_alpha(image.depth, v, float_sample(image.depth, texel + last * sample))
                 : v;
    };
    if (only != nullptr) {
      out[c] = static_cast<double>(value(only));
    } else if (taps.wide) {
      out[c] = kPerSquare * wide_sum<double, double>(taps, 1, [&](int x, int y) {
                 return static_cast<double>(value(texels.at(x, y)));
               });
    } else {
      FloatSum sum;
      for (int k = 0; k < 4; ++k) {
        const std::int32_t weight = taps.square[static_cast<std::size_t>(k)];
        if (weight != 0) sum.add(weight, value(texels.at(k % 2, k / 2)));
      }
      out[c] = sum.over(taps.total);
    }
  }
  return out;
}

/// All of an 8-bit texel's channels at once; sums of rows fit into 32 bits.
template <std::size_t kChannels>
Blended blend_bytes(const Around& texels, const Taps& taps) noexcept {
  Blended out{};
  for (std::size_t c = 0; c < kChannels; ++c) {
    const auto value = [&](int x, int y) {
      return std::to_integer<std::int32_t>(texels.at(x, y)[c]);
    };
    out[c] = static_cast<double>(wide_sum<std::int32_t, std::int64_t>(taps, 255, value)) *
             kPerSquare / 255;
  }
  return out;
}

Blended blend_integers(const store::ColourDirectory& image, const Around& texels,
                       const Taps& taps) noexcept {
  if (image.depth == Depth::u8 && taps.wide) {
    switch (image.channels) {
      case 1:
        return blend_bytes<1>(texels, taps);
      case 2:
        return blend_bytes<2>(texels, taps);
      case 3:
        return blend_bytes<3>(texels, taps);
      default:
        return blend_bytes<4>(texels, taps);
    }
  }
  const std::size_t sample = store::depth_bytes(image.depth);
  const std::int64_t largest = image.depth == Depth::u8 ? 255 : 65535;
  Blended out{};
  for (std::size_t c = 0; c < image.channels; ++c) {
    const auto value = [&](int x, int y) {
      return steps(image.depth, texels.at(x, y) + c * sample);
    };
    if (taps.wide) {
      out[c] = static_cast<double>(wide_sum<std::int64_t, std::int64_t>(taps, largest, value)) *
               kPerSquare / static_cast<double>(largest);
      continue;
    }
    const std::int64_t sum = taps.square[0] * value(0, 0) + taps.square[1] * value(1, 0) +
                             taps.square[2] * value(0, 1) + taps.square[3] * value(1, 1);
    out[c] = static_cast<double>(sum) / (taps.total * static_cast<double>(largest));
  }
  return out;
}

}  // namespace

Blended blend(const store::ColourDirectory& image, const std::byte* tile, int column, int row,
              const Taps& taps, BlendAlpha alpha) noexcept {
  const Around texels = around(tile, column, row, image.texel_bytes());
  return store::is_float(image.depth) ? blend_floats(image, texels, taps, alpha)
                                      : blend_integers(image, texels, taps);
}

namespace {

template <std::size_t kChannels>
void blend_u8_channels(const std::byte* tile, int column, int row, const Taps& taps,
                       std::byte* out) noexcept {
  const Around texels = around(tile, column, row, kChannels);
  const double per_sum = taps.wide ? kPerSquare : 1.0 / taps.total;
  for (std::size_t c = 0; c < kChannels; ++c) {
    const auto value = [&](int x, int y) {
      return std::to_integer<std::int32_t>(texels.at(x, y)[c]);
    };
    // A row's sum is at most 255 * 2^20 and what negative weights add.
    const std::int64_t sum = taps.wide
                                 ? wide_sum<std::int32_t, std::int64_t>(taps, 255, value)
                                 : taps.square[0] * value(0, 0) + taps.square[1] * value(1, 0) +
                                       taps.square[2] * value(0, 1) + taps.square[3] * value(1, 1);
    out[c] =
        static_cast<std::byte>(static_cast<std::int32_t>(static_cast<double>(sum) * per_sum + 0.5));
  }
}

}  // namespace

void blend_u8(const store::ColourDirectory& image, const std::byte* tile, int column, int row,
              const Taps& taps, std::byte* out) noexcept {
  switch (image.channels) {
    case 1:
      return blend_u8_channels<1>(tile, column, row, taps, out);
    case 2:
      return blend_u8_channels<2>(tile, column, row, taps, out);
    case 3:
      return blend_u8_channels<3>(tile, column, row, taps, out);
    default:
      return blend_u8_channels<4>(tile, column, row, taps, out);
  }
}

}  // namespace pounce::projection
