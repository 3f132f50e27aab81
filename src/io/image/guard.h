// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "io/files/asset_file.h"

namespace pounce::io {

class Cursor;

/// A piece of a file that is hidden and says what its colours mean: a PNG's "cICP", "iCCP", "sRGB",
/// "gAMA" or "cHRM" chunk, or "ICC", a profile.
struct ColourPiece {
  std::string kind;
  std::vector<std::byte> data;
};
/// Larger ones are not read.
inline constexpr std::uint64_t kMostColourBytes = 1 << 20;

/// Hides from the decoder what is no picture, before it sees any of it: decoders keep texts,
/// profiles and EXIF blocks whole in memory, believe the sizes they claim, and inflate them. Of a
/// PNG, a JPEG and a WebP only what makes pixels is left to see (of a TIFF: guard_tiff(), of an
/// EXR: guard_exr()). Returns what of it is about colours. Throws Error(input) naming what is too
/// large or cut off, Error(storage) if the file cannot be read.
std::vector<ColourPiece> hide_metadata(ByteSource& bytes, const std::string& format);

/// Keeps a hidden piece that is about colours, the first of its kind, unless it is too large.
void keep_colours(Cursor& at, std::string_view kind, std::uint64_t begin, std::uint64_t size,
                  std::vector<ColourPiece>& colours);

}  // namespace pounce::io
