// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "io/files/asset_file.h"
#include "pounce/options.h"

namespace pounce::io {

/// The format of an image, told by its content alone: "png", "jpeg", "openexr", "tiff", "webp",
/// "hdr", "pnm" (binary), and "bmp" and "targa" where they are allowed. These are OpenImageIO's
/// names. Throws Error(input) for everything else, with how to convert it where it is known.
std::string image_format(ByteSource& bytes, const std::string& path,
                         std::span<const ImageFormat> allowed);

/// True for an interlaced PNG: it decodes whole or not at all.
bool is_interlaced_png(ByteSource& bytes);

/// What a JPEG's markers before its first scan say. Throws Error(input) if they are damaged.
struct JpegHeader {
  std::uint32_t width = 0, height = 0, components = 0;
  bool several_scans = false;           ///< progressive, or one scan per component: decodes whole
  std::uint64_t coefficient_bytes = 0;  ///< of the whole image, as libjpeg keeps them
};
JpegHeader read_jpeg_header(ByteSource& bytes);

/// What the headers of files say that OpenImageIO takes into memory when it opens them: WebP, BMP
/// with run lengths.
struct WholeHeader {
  std::uint32_t width = 0, height = 0, channels = 0;
  Depth depth = Depth::u8;
  bool has_alpha = false;
  std::uint64_t working_bytes = 0;  ///< what decoding takes beside the texels and the file
};
bool opens_whole(ByteSource& bytes, const std::string& format);
/// Throws Error(input) if there is none, or none that the decoder can be trusted with. Sizes are as
/// they are claimed.
WholeHeader read_whole_header(ByteSource& bytes, const std::string& format);

}  // namespace pounce::io
