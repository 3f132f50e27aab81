// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/colour_space.h"

namespace pounce::io {

struct ColourPiece;

/// What an image file says of its colour space, where it says anything.
struct ColourTags {
  std::optional<bool> linear;  ///< linear light, or sRGB-coded
  std::optional<Chromaticities> primaries;
  std::string problem;  ///< what it says and is not understood: "its gamma is 1/1.8"
};

/// By the pieces of PNG, JPEG, TIFF and WebP: the strongest of a PNG's is cICP, then a profile,
/// sRGB, gAMA with cHRM, as its standard has it. Never throws for what is in them.
ColourTags read_colour_tags(const std::vector<ColourPiece>& pieces);

}  // namespace pounce::io
