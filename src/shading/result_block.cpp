// SPDX-License-Identifier: Apache-2.0
//
// Where a blended value becomes an output's sample: channels are matched, the colour space is
// changed if source and output differ, the number is rounded. Filters work on what the source
// stores (docs/decisions/008), so the conversion comes last, and what comes after this only moves
// bytes.
//
// Result blocks then wait in a scratch pack until their row of the image is due: as they are where
// the job has room for that, else as differences of neighbouring texels in planes of bytes, which a
// fast compression level shrinks well.
#include "shading/result_block.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "core/colour_space.h"
#include "core/portable_math.h"
#include "pounce/error.h"
#include "store/blocks/colour_store.h"
#include "store/pack/codec.h"

namespace pounce::shading {
namespace {

/// A transfer function over 0..1 at 4097 places, straight between them: off by less than 2e-5, a
/// fiftieth of a step of 8 bits, and by less than 1e-5 of the value towards linear, a fiftieth of a
/// half's. Everything exact would cost five times the rest of a transfer.
class CoarseCurve {
 public:
  explicit CoarseCurve(double (*exact)(double) noexcept) {
    for (std::size_t i = 0; i < knots_.size(); ++i)
      knots_[i] = exact(static_cast<double>(i) / kIntervals);
  }
  double operator()(double v) const noexcept {
    const double at = v * kIntervals;
    const auto i = static_cast<std::size_t>(at);
    if (i >= kIntervals) return knots_[kIntervals];
    return knots_[i] + (at - static_cast<double>(i)) * (knots_[i + 1] - knots_[i]);
  }

 private:
  static constexpr std::size_t kIntervals = 4096;
  std::array<double, kIntervals + 1> knots_;
};

/// Is the coarse curve near enough for this?
bool is_coarse(Depth depth, double v) noexcept {
  return (depth == Depth::u8 || depth == Depth::half) && v >= 0 && v <= 1;
}

double converted(const TexelFormat& format, const TexelValue& value, std::uint32_t channel,
                 double v) noexcept {
  // Alpha, and whatever follows after three colours, has no transfer function.
  const bool is_data = channel >= std::min(format.colours(), 3U);
  if (!format.is_colour || is_data || format.linear == value.linear) return v;
  return format.linear ? to_linear(v, format.depth) : to_coded(v, format.depth);
}

/// Output channel c of a value that may have fewer or more channels.
double pick(const TexelFormat& format, const TexelValue& value, std::uint32_t c) noexcept {
  // Materials of one output may have grey and colour images. Grey is the same in red, green and
  // blue; an alpha that an image lacks is opaque.
  if (c >= format.colours()) return value.has_alpha ? value.v[value.channels - 1] : 1.0;
  const std::uint32_t colours = value.channels - (value.has_alpha ? 1U : 0U);
  if (colours == 1 && c < 3) return value.v[0];
  return c < colours ? value.v[c] : 0.0;
}

/// Rounds to the steps of an integer of 0..`most`. Returns 1 if it is too far off for that; what is
/// no number counts as 0.
template <class Sample>
std::uint32_t store_integer(double v, double most, std::byte* out) noexcept {
  // Counted before clamping, and not within half a step: what only rounding moved out is not
  // clipped.
  const bool outside = !(v * most >= -0.5 && v * most < most + 0.5);
  const auto sample = static_cast<Sample>(std::isnan(v) ? 0 : std::clamp(v, 0.0, 1.0) * most + 0.5);
  std::memcpy(out, &sample, sizeof sample);
  return outside ? 1 : 0;
}

std::uint32_t store_sample(Depth depth, double v, std::byte* out) noexcept {
  switch (depth) {
    case Depth::u8:
      return store_integer<std::uint8_t>(v, 255, out);
    case Depth::u16:
      return store_integer<std::uint16_t>(v, 65535, out);
    case Depth::half: {
      constexpr double kLargest = 65504, kRoundsBeyond = 65520;
      const std::uint16_t sample =
          float_to_half(static_cast<float>(std::clamp(v, -kLargest, kLargest)));
      std::memcpy(out, &sample, 2);
      return v > -kRoundsBeyond && v < kRoundsBeyond ? 0 : 1;
    }
    case Depth::float32:
      break;
  }
  const auto sample = static_cast<float>(v);
  std::memcpy(out, &sample, 4);
  return 0;
}

}  // namespace

std::size_t TexelFormat::texel_bytes() const { return channels * store::depth_bytes(depth); }

double to_linear(double coded, Depth depth) noexcept {
  // The choice depends on depth and value alone, so equal values become equal samples in every
  // path.
  static const CoarseCurve coarse(srgb_to_linear);
  return is_coarse(depth, coded) ? coarse(coded) : srgb_to_linear(coded);
}

double to_coded(double linear, Depth depth) noexcept {
  static const CoarseCurve coarse(linear_to_srgb);
  return is_coarse(depth, linear) ? coarse(linear) : linear_to_srgb(linear);
}

void spread_grey(TexelValue& value) noexcept {
  value.v[3] = value.v[1];  // alpha, where there is one
  value.v[1] = value.v[2] = value.v[0];
  value.channels += 2;
}

void transform_colour(const ColourTransform& transform, TexelValue& value) noexcept {
  const std::uint32_t colours = value.channels - (value.has_alpha ? 1U : 0U);
  if (colours == 2) return;
  if (colours == 1) spread_grey(value);
  // A transform is not linear, so it must see the colour itself, not the colour times its alpha.
  const double alpha = value.has_alpha && value.premultiplied ? value.v[value.channels - 1] : 1;
  const double share = alpha != 0 ? alpha : 1;  // light that covers nothing is what it is
  std::array<double, 3> colour{value.v[0] / share, value.v[1] / share, value.v[2] / share};
  transform.apply(colour);
  for (std::size_t c = 0; c < 3; ++c) value.v[c] = colour[c] * share;
}

namespace {

TexelValue in_space_of(const TexelFormat& format, TexelValue value) noexcept {
  const std::uint32_t colours = std::min(3U, value.channels - (value.has_alpha ? 1U : 0U));
  for (std::size_t c = 0; c < colours && !value.linear; ++c)
    value.v[c] = srgb_to_linear(value.v[c]);
  transform_colour(*format.transform, value);
  value.linear = format.linear;
  value.is_final = true;
  return value;
}

}  // namespace

std::uint32_t store_texel(const TexelFormat& format, const TexelValue& value,
                          std::byte* out) noexcept {
  if (format.transform != nullptr && !value.is_final)
    return store_texel(format, in_space_of(format, value), out);
  std::uint32_t clipped = 0;
  const std::size_t size = store::depth_bytes(format.depth);
  const bool multiplies = format.premultiplied && value.has_alpha && !value.premultiplied;
  for (std::uint32_t c = 0; c < format.channels; ++c, out += size) {
    double v = converted(format, value, c, pick(format, value, c));
    if (multiplies && c < format.colours()) v *= value.v[value.channels - 1];
    clipped += store_sample(format.depth, v, out);
  }
  return clipped;
}

namespace {

/// store_integer() of all lanes, in loops that become vectors. Returns which are clipped.
std::uint32_t round_to_bytes(const double* v, std::uint8_t* bytes) noexcept {
  constexpr double kMost = 255;
  std::int32_t samples[kValues], outside[kValues];
  for (int i = 0; i < kValues; ++i) {
    const double inside = v[i] > 0 ? (v[i] < 1 ? v[i] : 1.0) : 0.0;  // what is no number is 0
    samples[i] = static_cast<std::int32_t>(inside * kMost + 0.5);
    outside[i] = v[i] * kMost >= -0.5 && v[i] * kMost < kMost + 0.5 ? 0 : 1;
  }
  std::uint32_t clipped = 0;
  for (int i = 0; i < kValues; ++i) {
    bytes[i] = static_cast<std::uint8_t>(samples[i]);
    clipped |= static_cast<std::uint32_t>(outside[i]) << i;
  }
  return clipped;
}

}  // namespace

std::uint32_t store_texels(const TexelFormat& format, const TexelValues& values,
                           std::uint32_t lanes, const std::uint16_t* texel,
                           std::byte* out) noexcept {
  const std::size_t size = format.texel_bytes();
  std::uint32_t clipped = 0;
  const bool is_plain = format.depth == Depth::u8 && format.transform == nullptr &&
                        !format.premultiplied && format.channels == values.channels &&
                        format.has_alpha == values.has_alpha &&
                        (!format.is_colour || format.linear == values.linear);
  if (!is_plain) {
    for (; lanes != 0; lanes &= lanes - 1) {
      const auto i = static_cast<std::size_t>(std::countr_zero(lanes));
      TexelValue value{{},    values.channels, values.linear, values.has_alpha,
                       false, values.is_final};
      for (std::size_t c = 0; c < values.channels; ++c) value.v[c] = values.v[c][i];
      clipped += store_texel(format, value, out + texel[i] * size);
    }
    return clipped;
  }
  std::uint8_t bytes[4][kValues];
  for (std::size_t c = 0; c < format.channels; ++c)
    clipped +=
        static_cast<std::uint32_t>(std::popcount(round_to_bytes(values.v[c], bytes[c]) & lanes));
  for (; lanes != 0; lanes &= lanes - 1) {
    const auto i = static_cast<std::size_t>(std::countr_zero(lanes));
    for (std::size_t c = 0; c < size; ++c)
      out[texel[i] * size + c] = static_cast<std::byte>(bytes[c][i]);
  }
  return clipped;
}

std::uint32_t encode(const ResultBlock& block, const TexelFormat& format,
                     store::Compressor& compressor, store::PlainRoom* room,
                     std::vector<std::byte>& stored) {
  std::vector<std::byte> raw;
  raw.reserve(kMaskBytes + block.texels.size());
  const auto mask = std::as_bytes(std::span(block.mask));
  raw.insert(raw.end(), mask.begin(), mask.end());
  raw.insert(raw.end(), block.texels.begin(), block.texels.end());
  const auto size = static_cast<std::uint32_t>(raw.size());
  if (store::Compressor::keep_as_is(raw, stored, room)) return size;
  std::vector<std::byte> differences(block.texels.begin(), block.texels.end());
  store::delta(differences, store::depth_bytes(format.depth), format.channels);
  store::shuffle(differences, format.texel_bytes(), std::span(raw).subspan(kMaskBytes));
  compressor.compress(raw, stored, store::kFastLevel);
  return size;
}

void decode(store::StoredChunk stored, std::uint32_t size_bytes, const TexelFormat& format,
            store::Compressor& compressor, const std::string& name, ResultBlock& block) {
  const std::size_t size = 64 * 64 * format.texel_bytes();
  if (size_bytes != kMaskBytes + size)
    throw Error(ErrorKind::damaged_store, name + ": a result of another size");
  UnsetBytes raw(size_bytes);
  compressor.decompress(stored.payload(), raw);
  const bool as_is = store::is_as_is(stored.payload());
  stored = {};  // its memory
  const auto samples = std::span<const std::byte>(raw).subspan(kMaskBytes);
  std::memcpy(block.mask.data(), raw.data(), kMaskBytes);
  block.texels.resize(size);
  if (as_is) {
    std::memcpy(block.texels.data(), samples.data(), size);
    return;
  }
  store::unshuffle(samples, format.texel_bytes(), block.texels);
  store::undelta(block.texels, store::depth_bytes(format.depth), format.channels);
}

}  // namespace pounce::shading
