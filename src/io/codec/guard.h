// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "io/codec/colour_tags.h"
#include "io/files/asset_file.h"
#include "pounce/error.h"

namespace pounce::io {

/// Reads numbers from anywhere in a source through a small window.
class Cursor {
 public:
  /// `what` the file is, for messages: "PNG".
  Cursor(ByteSource& bytes, std::string_view what, bool big_endian)
      : bytes_(bytes), what_(what), big_endian_(big_endian) {}

  /// Throws Error(input) naming the file.
  [[noreturn]] void refuse(const std::string& why) const {
    throw Error(ErrorKind::input, fmt::format("{}: {}", bytes_.label(), why));
  }

  /// Refuses the file where it ends before that.
  std::uint8_t u8(std::uint64_t at) {
    if (at < first_ || at - first_ >= count_) {
      first_ = at;
      count_ = bytes_.read_at(at, window_.data(), window_.size());
      bytes_.check();
      if (count_ == 0) {
        refuse(
            fmt::format("the {} is truncated: it ends after {} bytes", what_, bytes_.size_bytes()));
      }
    }
    return static_cast<std::uint8_t>(window_[at - first_]);
  }
  std::uint64_t number(std::uint64_t at, std::size_t size) {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < size; ++i)
      value |= std::uint64_t{u8(at + i)} << 8 * (big_endian_ ? size - 1 - i : i);
    return value;
  }
  std::uint16_t u16(std::uint64_t at) { return static_cast<std::uint16_t>(number(at, 2)); }
  std::uint32_t u32(std::uint64_t at) { return static_cast<std::uint32_t>(number(at, 4)); }
  std::uint64_t size() const { return bytes_.size_bytes(); }
  ByteSource& bytes() { return bytes_; }
  /// So many bytes from `at` on, appended; fewer at the end of the file.
  void copy(std::uint64_t at, std::uint64_t count, std::vector<std::byte>& out) {
    count = std::min(count, size() - std::min(at, size()));
    const std::size_t had = out.size();
    out.resize(had + static_cast<std::size_t>(count));
    bytes_.read_at(at, out.data() + had, static_cast<std::size_t>(count));
    bytes_.check();
  }

 private:
  ByteSource& bytes_;
  std::string_view what_;
  bool big_endian_;
  std::array<std::byte, 4096> window_;
  std::uint64_t first_ = 0;
  std::size_t count_ = 0;
};

/// Checks what OpenEXR takes from a file without a look of its own: how much room it makes, and
/// that the first block of each part decodes to all of the texels that are handed out. Throws
/// Error(input). Returns what it makes room for when it opens the file, beside the decoder of the
/// part that is read: of a file in several parts a block of each, read or not.
std::uint64_t guard_exr(ByteSource& bytes);

// Which TIFFs are read, decided by their directory before any decoder sees it.

/// What the first directory of a TIFF says, checked.
struct TiffPicture {
  enum class Colours : std::uint8_t { grey, grey_inverted, rgb, palette, cmyk };
  std::uint32_t width = 0, height = 0;
  std::uint32_t samples = 1;  ///< per texel in the file; a palette has one
  std::uint32_t bits = 1;     ///< of each: 1, 2, 4, 8, 16; of floats 16, 32
  bool floats = false;
  Colours colours = Colours::grey;
  bool planes = false;  ///< each sample has strips or tiles of its own
  bool compressed = false;
  bool is_jpeg = false;
  bool is_ycbcr = false;                          ///< of a JPEG, which gives RGB
  bool says_extra_samples = false;                ///< what the samples beyond the colours are
  std::uint32_t part_width = 0, part_height = 0;  ///< of a tile, or of a strip
  bool tiled = false;
  std::uint64_t window_bytes = 0;  ///< how far back the decoder of a strip or tile looks

  /// What a decoder hands out per texel.
  std::uint32_t channels() const {
    return colours == Colours::palette || colours == Colours::cmyk ? 3 : samples;
  }
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
