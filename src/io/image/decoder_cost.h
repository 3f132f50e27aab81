// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <OpenImageIO/imageio.h>

#include <cstdint>
#include <string>

#include "io/files/asset_file.h"

namespace pounce::io {

/// Rows asked of a decoder in one call: of a TIFF strip that is asked for whole it would make two
/// copies.
inline constexpr std::uint32_t kMostRowsAtOnce = 64;

/// Rows that the decoder unpacks together: a row of tiles, an EXR block, a TIFF strip; else 1.
std::uint32_t block_rows(const OIIO::ImageSpec& spec, const std::string& format);

/// The most memory that decoding such an image takes beyond the rows handed out. Upper bounds,
/// checked against resident memory by tests/unit/io/test_image_memory.cpp.
std::uint64_t decoder_cost(const OIIO::ImageSpec& spec, const std::string& format,
                           ByteSource& bytes);

/// The same of a JPEG by its width: libjpeg holds a few rows of blocks per component.
std::uint64_t jpeg_row_cost(std::uint64_t width);
/// Of a format that only decodes whole, from a copy of the file.
std::uint64_t whole_cost(std::uint64_t decoded_bytes, const ByteSource& bytes);

}  // namespace pounce::io
