// SPDX-License-Identifier: Apache-2.0
//
// Which TIFFs are read, decided by their directory before any decoder sees it.
#pragma once

#include <cstdint>
#include <vector>

#include "io/files/asset_file.h"
#include "io/image/guard.h"

namespace pounce::io {

/// What the first directory of a TIFF says, checked.
struct TiffPicture {
  enum class Colours : std::uint8_t { grey, grey_inverted, rgb, palette };
  std::uint32_t width = 0, height = 0;
  std::uint32_t samples = 1;  ///< per texel in the file; a palette has one
  std::uint32_t bits = 1;     ///< of each: 1, 2, 4, 8, 16; of floats 16, 32
  bool floats = false;
  Colours colours = Colours::grey;
  bool planes = false;                            ///< each sample has strips or tiles of its own
  bool compressed = false;                        ///< LZW, Deflate or PackBits
  bool says_extra_samples = false;                ///< what the samples beyond the colours are
  std::uint32_t part_width = 0, part_height = 0;  ///< of a tile, or of a strip
  bool tiled = false;

  /// What a decoder hands out per texel.
  std::uint32_t channels() const { return colours == Colours::palette ? 3 : samples; }
  /// Decoded bytes of a whole strip or tile of one plane.
  std::uint64_t part_bytes() const;
};

/// Checks the directory against the combinations of colours, samples, planes, compression, strips
/// and tiles that are read, each of which has a test, and shows it as the only one, with nothing
/// but the fields that were checked. Throws Error(input) with what is not read and what to do, or
/// naming the field that is damaged. Nothing a decoder may make room for is larger than what is
/// returned.
TiffPicture guard_tiff(ByteSource& bytes, std::vector<ColourPiece>& colours);

}  // namespace pounce::io
