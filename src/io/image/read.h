// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "io/codec/image_info.h"
#include "mesh/mesh.h"
#include "pounce/options.h"

namespace pounce::io {

/// Reads an image top to bottom in strips of rows, samples exactly as stored (no colour
/// conversion). Alpha is what the file says is alpha, and no other fourth channel. It is handed out
/// straight: where the file says that its colours are premultiplied (EXR always does) they are
/// divided by alpha, and kept where alpha is 0. Of a file with several images the first is read, of
/// one with more than four channels those that choose_channels() says. Formats, told by content
/// (image_format()): PNG, JPEG, EXR, TIFF, WebP, Radiance HDR, binary PNM; those of
/// `allowed`, too.
///
/// Damage: a file that was cut off, a wrong PNG checksum and whatever the decoders notice throw
/// Error(input) naming image.label and the rows, at the latest after the last row. No other format
/// protects every byte: a changed one that still decodes (in a JPEG four of five, in a deflated
/// TIFF one of six, in an EXR one of a thousand) cannot be told from a picture. A decoder that gets
/// no memory is Error(budget), a file that cannot be read Error(storage).
///
/// Not thread-safe; one reader per thread, several at once are fine.
class ImageReader {
 public:
  explicit ImageReader(const mesh::ImageRef& image, const ImageTrust& trust = {});
  explicit ImageReader(const std::string& path, const ImageTrust& trust = {});
  /// The channels of these names as data, in this order, of the first image of an EXR that may have
  /// any number of others. All are float. Throws Error(input) that names what is missing, or not as
  /// exact as a float.
  ImageReader(const std::string& path, const std::vector<std::string>& channels,
              const ImageTrust& trust = {});
  ~ImageReader();
  ImageReader(ImageReader&&) noexcept;
  ImageReader& operator=(ImageReader&&) noexcept;

  /// Of an EXR the full names of the channels of all its parts, of which ImageRef::channels can
  /// name some; nothing of other formats.
  static std::vector<std::string> exr_channels(const std::string& path,
                                               const ImageTrust& trust = {});

  const ImageInfo& info() const;
  std::size_t row_bytes() const;  ///< width * channels * bytes per sample
  /// Reads the next `row_count` rows (row_count <= rows left) into `rows`, tightly packed, native
  /// endian.
  void read_rows(std::uint32_t row_count, std::byte* rows);
  /// From here on colours come as the file has them, premultiplied or not.
  void keep_premultiplied();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pounce::io
