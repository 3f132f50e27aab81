// SPDX-License-Identifier: Apache-2.0
//
// Gives the numbers of an image their meaning: the first thing that happens to a filtered texel,
// before factors and vertex colours (docs/decisions/036). Images are never converted as a whole:
// that would need a column of its own for each space that a job asks for.
#include "shading/texel_input.h"

#include <algorithm>

#include "core/colour_space.h"

namespace pounce::shading {

void convert(const Matrix3& m, TexelValue& value) noexcept {
  const std::uint32_t colours = value.channels - (value.has_alpha ? 1U : 0U);
  if (colours < 3) return;
  // A matrix of primaries holds in linear light only.
  std::array<double, 3> c;
  for (std::size_t i = 0; i < 3; ++i) c[i] = value.linear ? value.v[i] : srgb_to_linear(value.v[i]);
  for (std::size_t i = 0; i < 3; ++i)
    value.v[i] = m[3 * i] * c[0] + m[3 * i + 1] * c[1] + m[3 * i + 2] * c[2];
  value.linear = true;
}

void enter(const ColourInput& input, TexelValue& value) noexcept {
  if (input.transform != nullptr) transform_colour(*input.transform, value);
  value.linear = input.linear;
  value.is_final = input.is_final;
}

void apply(const ColourInput& input, TexelValue& value) noexcept {
  enter(input, value);
  if (input.primaries) convert(*input.primaries, value);
}

// --- factors of materials ------------------------------------------------------------------------
//
// A material's constant over its texture (docs/decisions/032). The order matters: a texture is
// filtered in its own encoding, then multiplied in linear light, since a material's constants are
// linear. Channels whose factor is 1 are left alone rather than multiplied by 1: the way through
// linear light and back would move their last bit.

namespace {

/// An alpha of its own, or the first one.
void scale_alpha(double scale, TexelValue& value) noexcept {
  if (scale == 1) return;
  if (value.has_alpha) {
    value.v[value.channels - 1] *= scale;
    // Premultiplied colours hold the alpha, and shrink with it.
    for (std::uint32_t c = 0; value.premultiplied && c + 1 < value.channels; ++c)
      value.v[c] *= scale;
  } else if (value.channels < value.v.size()) {
    value.v[value.channels++] = scale;
    value.has_alpha = true;
  }
}

}  // namespace

void apply(const Factor& factor, const TexelFormat& format, TexelValue& value) noexcept {
  std::uint32_t colours = value.channels - (value.has_alpha ? 1U : 0U);
  if (factor.spreads && colours == 1) {
    spread_grey(value);
    colours = 3;
  }
  const std::uint32_t scaled = std::min(colours, 3U);
  if (factor.is_colour && format.linear && !value.linear) {  // one conversion does for both
    for (std::uint32_t c = 0; c < scaled; ++c) value.v[c] = to_linear(value.v[c], format.depth);
    value.linear = true;
  }
  for (std::uint32_t c = 0; c < scaled; ++c) {
    const double scale = factor.scale[c], offset = factor.offset[c];
    if (scale == 1 && offset == 0) continue;
    double& v = value.v[c];
    const bool coded = factor.is_colour && !value.linear;
    if (coded) v = to_linear(v, format.depth);
    v = v * scale + offset;
    if (coded) v = to_coded(v, format.depth);
  }
  scale_alpha(factor.scale[3], value);
}

}  // namespace pounce::shading
