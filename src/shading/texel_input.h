// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>

#include "core/colour_space.h"
#include "pounce/options.h"
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

// --- factors of materials ------------------------------------------------------------------------

/// What a material makes of the texels of its texture: v becomes scale v + offset, colours in
/// linear light, alpha as it is.
struct Factor {
  std::array<double, 4> scale{1, 1, 1, 1};  ///< the fourth is of alpha
  std::array<double, 3> offset{};
  bool is_colour = false;
  bool spreads = false;  ///< grey texels become texels of three channels
};

/// Applies it to a texel on its way into `format`, as near as that format's samples need. A channel
/// whose scale is 1 and whose offset is 0 arrives there bit by bit as without it. A texel without
/// alpha gets one where that is scaled.
void apply(const Factor& factor, const TexelFormat& format, TexelValue& value) noexcept;

}  // namespace pounce::shading
