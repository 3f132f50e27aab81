// SPDX-License-Identifier: Apache-2.0
//
// Old texels, new texels, a weight.
//
// Mixing happens in the stored encoding: of an 8-bit sRGB texture that is the arithmetic of every
// painting program, and half a mask over equal colours changes nothing. The ends are copies, not
// arithmetic, so that what the mask leaves out keeps its bits whatever they mean (NaN included).
//
// Straight colours of two layers with alpha cannot be mixed one by one: a transparent texel's
// colour says nothing, and would darken the rim of what is painted. So they count by their opacity,
// as if both had been multiplied by alpha, mixed, and divided again.
#include "shading/paint_over.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "core/portable_math.h"

namespace pounce::shading {
namespace {

double load_sample(Depth depth, const std::byte* at) noexcept {
  switch (depth) {
    case Depth::u8:
      return static_cast<double>(*at) / 255;
    case Depth::u16: {
      std::uint16_t sample;
      std::memcpy(&sample, at, 2);
      return static_cast<double>(sample) / 65535;
    }
    case Depth::half: {
      std::uint16_t sample;
      std::memcpy(&sample, at, 2);
      return static_cast<double>(half_to_float(sample));
    }
    case Depth::float32:
      break;
  }
  float sample;
  std::memcpy(&sample, at, 4);
  return static_cast<double>(sample);
}

TexelValue load_texel(const TexelFormat& format, const std::byte* at) noexcept {
  TexelValue value;
  value.channels = format.channels;
  value.linear = format.linear;
  value.has_alpha = format.has_alpha;
  const std::size_t sample = store::depth_bytes(format.depth);
  for (std::uint32_t c = 0; c < format.channels; ++c)
    value.v[c] = load_sample(format.depth, at + c * sample);
  return value;
}

/// Stores values that need no conversion.
void store_values(const TexelFormat& format, const std::array<double, 4>& values,
                  std::byte* out) noexcept {
  TexelFormat plain = format;
  plain.is_colour = false;
  store_texel(plain, {values, format.channels, format.linear, format.has_alpha, false}, out);
}

bool alike(const TexelFormat& a, const TexelFormat& b) {
  return a.channels == b.channels && a.depth == b.depth && a.has_alpha == b.has_alpha &&
         (a.linear == b.linear || !b.is_colour);
}

double mixed(double old, double fresh, double weight) noexcept {
  // Equal values stay as they are even if they are infinite: the difference would be no number. So
  // would be a part of an infinite one: any part of what is infinite is.
  if (old == fresh) return old;
  if (std::isfinite(old) && std::isfinite(fresh)) return old + (fresh - old) * weight;
  const bool is_fresh = std::isfinite(old) ? weight > 0 : weight >= 1;
  return is_fresh ? fresh : old;
}

}  // namespace

std::uint64_t convert_texels(const TexelFormat& from, const std::byte* in, const TexelFormat& to,
                             std::size_t count, std::byte* out) {
  if (alike(from, to)) {
    std::memcpy(out, in, count * to.texel_bytes());
    return 0;
  }
  std::uint64_t clipped = 0;
  for (std::size_t i = 0; i < count; ++i) {
    clipped +=
        store_texel(to, load_texel(from, in + i * from.texel_bytes()), out + i * to.texel_bytes());
  }
  return clipped;
}

void mask_weights(const TexelFormat& mask, const std::byte* in, std::size_t count, float* weights) {
  for (std::size_t i = 0; i < count; ++i, in += mask.texel_bytes()) {
    const auto v = load_texel(mask, in).v;
    const bool grey = mask.colours() <= 2 || (v[0] == v[1] && v[1] == v[2]);
    double weight = grey ? v[0] : 0.2126 * v[0] + 0.7152 * v[1] + 0.0722 * v[2];
    if (mask.has_alpha) weight *= v[mask.channels - 1];
    weights[i] = weight > 0 ? static_cast<float>(std::min(weight, 1.0)) : 0.0F;
  }
}

void paint_over(const TexelFormat& format, PaintAlpha alpha, const float* weights,
                const std::byte* fresh, std::size_t count, std::byte* texels) {
  const std::size_t size = format.texel_bytes();
  const std::size_t sample = store::depth_bytes(format.depth);
  const std::uint32_t colours = format.colours();
  const std::uint32_t painted = alpha == PaintAlpha::keep ? colours : format.channels;
  // EXR's premultiplied colours carry their weight already and are mixed as they are.
  const bool by_opacity = alpha == PaintAlpha::mix && format.has_alpha;
  for (std::size_t i = 0; i < count; ++i, fresh += size, texels += size) {
    if (!(weights[i] > 0)) continue;
    if (weights[i] >= 1) {
      std::memcpy(texels, fresh, painted * sample);
      continue;
    }
    const auto w = static_cast<double>(weights[i]);
    const TexelValue a = load_texel(format, texels), b = load_texel(format, fresh);
    std::array<double, 4> out = a.v;
    double colour_weight = w;
    if (by_opacity) {
      const double left = a.v[colours] * (1 - w), right = b.v[colours] * w;
      // Two transparent texels have no opacity to go by, and are mixed by the mask.
      if (left + right > 0) colour_weight = right / (left + right);
      out[colours] = mixed(a.v[colours], b.v[colours], w);
    }
    for (std::uint32_t c = 0; c < (by_opacity ? colours : painted); ++c)
      out[c] = mixed(a.v[c], b.v[c], colour_weight);
    std::array<std::byte, 16> stored;
    store_values(format, out, stored.data());
    std::memcpy(texels, stored.data(), painted * sample);
  }
}

void copy_alpha(const TexelFormat& format, const std::byte* from, std::size_t count,
                std::byte* to) {
  const std::size_t size = format.texel_bytes();
  const std::size_t sample = store::depth_bytes(format.depth);
  for (std::size_t i = 0; i < count; ++i) {
    std::memcpy(to + (i + 1) * size - sample, from + (i + 1) * size - sample, sample);
  }
}

}  // namespace pounce::shading
