// SPDX-License-Identifier: Apache-2.0
//
// Gives the numbers of an image their meaning: the first thing that happens to a filtered texel,
// before factors and vertex colours (docs/decisions/036). Images are never converted as a whole:
// that would need a column of its own for each space that a job asks for.
#include "shading/colour_input.h"

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

}  // namespace pounce::shading
