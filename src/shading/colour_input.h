// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "core/colour_space.h"
#include "shading/result_block.h"

namespace pounce::shading {

/// What an image's numbers mean, where its depth alone does not say it, and where they go.
struct ColourInput {
  bool linear = false;               ///< linear light, else sRGB-coded
  std::optional<Matrix3> primaries;  ///< to the output's, in linear light; none: they are these
  /// First of all, what makes linear light of Rec. 709 of the numbers; null: nothing. Not owned.
  const ColourTransform* transform = nullptr;
  bool is_final = false;  ///< they are the output's own, and nothing is made of them
  bool operator==(const ColourInput&) const = default;
};

/// From linear light of some primaries to that of others. A coded value is linear light then; grey
/// has no primaries and stays what it is.
void convert(const Matrix3& primaries, TexelValue& value) noexcept;

/// Gives a value that meaning, in its own primaries or in those of Rec. 709.
void enter(const ColourInput& input, TexelValue& value) noexcept;

/// The same, and converts it.
void apply(const ColourInput& input, TexelValue& value) noexcept;

}  // namespace pounce::shading
