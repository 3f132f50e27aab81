// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
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

/// Binary PNM: grey (P5) or RGB (P6) of 8 or 16 bits, the first of the file's images.
class PnmPicture {
 public:
  /// Throws Error(input) where the header is damaged or the file is cut off.
  explicit PnmPicture(ByteSource& bytes);

  std::uint32_t width() const { return width_; }
  std::uint32_t height() const { return height_; }
  std::uint32_t channels() const { return channels_; }
  Depth depth() const { return largest_ > 255 ? Depth::u16 : Depth::u8; }
  /// Rows from `first` on, native endian, scaled to the whole range. What cannot be read is 0, and
  /// the bytes say so.
  void read_rows(std::uint32_t first, std::uint32_t count, std::byte* rows);

 private:
  std::uint64_t row_bytes() const;

  ByteSource& bytes_;
  std::uint32_t width_ = 0, height_ = 0, channels_ = 0, largest_ = 0;
  std::uint64_t begin_ = 0;  ///< of the first row
};

}  // namespace pounce::io
