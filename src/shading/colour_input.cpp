// SPDX-License-Identifier: Apache-2.0
#include "shading/colour_input.h"

#include "core/colour_space.h"

namespace pounce::shading {

void convert(const Matrix3& m, TexelValue& value) noexcept {
  const std::uint32_t colours = value.channels - (value.has_alpha ? 1U : 0U);
  if (colours < 3) return;
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
