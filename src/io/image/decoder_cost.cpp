// SPDX-License-Identifier: Apache-2.0
#include "io/image/decoder_cost.h"

#include <algorithm>

#include "io/image/guard.h"
#include "io/image/header.h"

namespace pounce::io {
namespace {

/// Rows that an EXR file compresses together.
int exr_block_rows(const std::string& compression) {
  if (compression.starts_with("dwab")) return 256;
  if (compression == "piz" || compression.starts_with("dwaa") || compression.starts_with("b44"))
    return 32;
  if (compression == "zip" || compression == "pxr24") return 16;
  return 1;
}

constexpr std::uint64_t kBase = 1U << 20;

}  // namespace

std::uint64_t jpeg_row_cost(std::uint64_t width) { return (1U << 20) + width * 3 * 64; }

std::uint64_t whole_cost(std::uint64_t decoded_bytes, const ByteSource& bytes) {
  return kBase + decoded_bytes + bytes.size_bytes();
}

std::uint32_t block_rows(const OIIO::ImageSpec& spec, const std::string& format) {
  int rows = 1;
  if (spec.tile_width > 0) {
    rows = spec.tile_height;
  } else if (format == "openexr") {
    rows = exr_block_rows(spec.get_string_attribute("compression"));
  } else if (format == "tiff") {
    rows = spec.get_int_attribute("tiff:RowsPerStrip", spec.height);
  }
  return static_cast<std::uint32_t>(std::clamp(rows, 1, spec.height));
}

std::uint64_t decoder_cost(const OIIO::ImageSpec& spec, const std::string& format,
                           ByteSource& bytes) {
  const auto row = static_cast<std::uint64_t>(spec.scanline_bytes(true));
  const std::uint64_t whole = row * static_cast<std::uint64_t>(spec.height);
  const std::uint64_t block = row * block_rows(spec, format);
  if (spec.tile_width > 0) {  // whole tiles, which may be larger than the image
    const auto tile = static_cast<std::uint64_t>(spec.tile_bytes(true));
    const auto across = static_cast<std::uint64_t>((spec.width - 1) / spec.tile_width + 1);
    return kBase + 4 * std::max(block, tile * across);
  }
  if (format == "png") return kBase + (is_interlaced_png(bytes) ? whole : 4 * row);
  if (format == "jpeg") return jpeg_row_cost(static_cast<std::uint64_t>(spec.width));
  if (format == "openexr") return kBase + 6 * block;
  if (format == "hdr") return kBase + 4 * row;
  // libtiff holds a strip as it is in the file, however large.
  if (format == "tiff") {
    const std::uint64_t rows = std::min(block_rows(spec, format), kMostRowsAtOnce);
    return kBase + 4 * row * rows + std::min(block, bytes.size_bytes());
  }
  return whole_cost(whole, bytes);
}

}  // namespace pounce::io
