// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "pounce/options.h"
#include "shading/result_block.h"

namespace pounce::shading {

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
