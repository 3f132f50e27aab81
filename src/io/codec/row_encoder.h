// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/begun_work.h"
#include "core/hash.h"
#include "io/codec/channels.h"
#include "io/codec/image_info.h"
#include "io/files/output_file.h"

namespace pounce::io {

/// Encodes the rows of one image, from the first to the last, each once: one format's own library
/// behind it. Not thread-safe. What it throws is Error(storage).
class RowEncoder {
 public:
  RowEncoder() = default;
  virtual ~RowEncoder() = default;
  RowEncoder(const RowEncoder&) = delete;
  RowEncoder& operator=(const RowEncoder&) = delete;

  /// Rows of the spec's samples, colours times alpha where the format stores them so. With tiles
  /// rows come as a whole row of tiles: `count` is the tiles' height (less at the lower edge).
  virtual void write_rows(std::uint32_t first, std::uint32_t count, const std::byte* rows) = 0;
  /// The next level follows, of this size; all rows of the one before were written.
  virtual void next_level(std::uint32_t width, std::uint32_t height) = 0;
  /// All rows were written: the rest of the file.
  virtual void finish() = 0;
};

/// What blocks of rows were encoded to, remembered for who encodes the same rows again. Not
/// thread-safe.
class EncodedBlocks {
 public:
  EncodedBlocks() = default;
  virtual ~EncodedBlocks() = default;
  EncodedBlocks(const EncodedBlocks&) = delete;
  EncodedBlocks& operator=(const EncodedBlocks&) = delete;
  /// `rows`: the hash of what was encoded. False: nothing is known of such a block.
  virtual bool find(std::uint32_t block, const Hash128& rows, std::vector<std::byte>& encoded) = 0;
  virtual void put(std::uint32_t block, const Hash128& rows,
                   std::span<const std::byte> encoded) = 0;
};

/// What a PNG and a JPEG, which are written from start to end, hand their bytes to.
using ByteSink = std::function<void(std::span<const std::byte>)>;

/// `known` may be null.
std::unique_ptr<RowEncoder> encode_png(ByteSink sink, const ImageWriteSpec& spec,
                                       BeginWork begin_work, EncodedBlocks* known);
/// Memory that encoding such a PNG takes, `known` left out.
std::uint64_t png_encoder_bytes(const ImageWriteSpec& spec);
/// The most that one of its blocks is encoded to.
std::uint64_t png_block_bytes(const ImageWriteSpec& spec);
std::unique_ptr<RowEncoder> encode_jpeg(ByteSink sink, const ImageWriteSpec& spec);
/// In strips or tiles, with levels if the spec has them.
std::unique_ptr<RowEncoder> encode_tiff(OutputFile& file, const ImageWriteSpec& spec);
std::unique_ptr<RowEncoder> encode_exr(OutputFile& file, const ImageWriteSpec& spec);

// What encoders have in common.

/// Deflating a 2048^2 photograph with the Up filter, ns and bytes per texel: level 1 26 and 0.65,
/// 2 29 and 0.63, 3 41 and 0.61, 6 115 and 0.58; with Paeth's filter 36 and 0.65 at level 2.
/// Projection costs tens of ns: level 2 does not hold it up.
inline constexpr int kDeflateLevel = 2;

std::uint64_t row_bytes_of(const ImageWriteSpec& spec);
/// Rows of a TIFF strip: 64 KiB or a row.
std::uint32_t strip_rows(const ImageWriteSpec& spec);
std::uint32_t across_tiles(const ImageWriteSpec& spec);
/// Texels of all tiles of an image, its levels included.
std::uint64_t tiled_texels(const ImageWriteSpec& spec);

}  // namespace pounce::io
