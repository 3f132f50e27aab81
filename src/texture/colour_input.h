// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "core/colour_space.h"
#include "texture/result_block.h"

namespace pounce::texture {

/// What an image's numbers mean, where its depth alone does not say it, and where they go.
struct ColourInput {
  bool linear = false;               ///< linear light, else sRGB-coded
  std::optional<Matrix3> primaries;  ///< to the output's, in linear light; none: they are these
  bool operator==(const ColourInput&) const = default;
};

/// Gives a value that meaning, and the output's primaries: with a matrix it is linear light then.
/// Grey has none and stays what it is.
void apply(const ColourInput& input, TexelValue& value) noexcept;

}  // namespace pounce::texture
