// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/colour_space.h"

namespace pounce::io {

/// What an ICC profile (ICC.1:2010) says that matters here.
struct IccProfile {
  std::string description;  ///< without control characters; "" if it has none
  /// What it stands for, if that is a matrix and curves, linear or sRGB's: the primaries of sRGB,
  /// Display P3, ACES or BT.2020 if it is nearly these, else its own, of the white D50.
  std::optional<ColourSpace> space;
};

/// Nothing: this is not a profile of RGB colours. Never throws for what is in it.
std::optional<IccProfile> read_icc(std::span<const std::byte> profile);

/// A profile for a space: version 4.3, matrix and curves, always the same bytes.
std::vector<std::byte> make_icc(const ColourSpace& space);

/// A piece of a file that says what its colours mean: a PNG's "cICP", "iCCP", "sRGB", "gAMA" or
/// "cHRM" chunk, or "ICC", a profile.
struct ColourPiece {
  std::string kind;
  std::vector<std::byte> data;
};
/// Larger ones are not kept.
inline constexpr std::uint64_t kMostColourBytes = 1 << 20;
/// Keeps a piece, unless it is too large or not the first of its kind.
void add_piece(const std::string& kind, std::span<const std::byte> data,
               std::vector<ColourPiece>& pieces);

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
