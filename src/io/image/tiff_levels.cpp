// SPDX-License-Identifier: Apache-2.0
//
// The directories of a TIFF are a chain, one for each image; renderers' textures have their levels
// in it. Of each only the sizes are read.
#include "io/image/tiff_levels.h"

#include <cstddef>
#include <optional>
#include <vector>

namespace pounce::io {
namespace {

constexpr std::uint64_t kMostFields = 4096;  // as libtiff
constexpr std::uint64_t kWidth = 256, kHeight = 257, kShort = 3, kLong8 = 16;

struct Directory {
  std::uint64_t width = 0, height = 0;
  std::uint64_t next = 0;  ///< its place; 0: none
};

class Directories {
 public:
  explicit Directories(ByteSource& bytes) : bytes_(bytes) {
    char order = 0;
    big_endian_ = bytes.read_at(0, &order, 1) == 1 && order == 'M';
    big_ = number(read(2, 2), 0, 2) == 43;
  }

  std::optional<Directory> first() {
    return at(big_ ? number(read(8, 8), 0, 8) : number(read(4, 4), 0, 4));
  }
  /// Nothing where there is none.
  std::optional<Directory> at(std::uint64_t place) {
    const std::size_t count_bytes = big_ ? 8 : 2, field_bytes = big_ ? 20 : 12, word = big_ ? 8 : 4;
    if (place == 0 || place >= bytes_.size_bytes()) return std::nullopt;
    const std::uint64_t fields = number(read(place, count_bytes), 0, count_bytes);
    if (fields == 0 || fields > kMostFields) return std::nullopt;
    const std::size_t end = static_cast<std::size_t>(fields) * field_bytes;
    const std::vector<std::byte> all = read(place + count_bytes, end + word);
    Directory found;
    for (std::size_t field = 0; field < end; field += field_bytes) {
      const std::uint64_t tag = number(all, field, 2);
      if (tag != kWidth && tag != kHeight) continue;
      const std::uint64_t type = number(all, field + 2, 2);
      const std::size_t size = type == kShort ? 2 : type == kLong8 ? 8 : 4;
      (tag == kWidth ? found.width : found.height) = number(all, field + 4 + word, size);
    }
    found.next = number(all, end, word);
    return found;
  }

 private:
  /// Zeros beyond the end of the file.
  std::vector<std::byte> read(std::uint64_t place, std::size_t count) {
    std::vector<std::byte> out(count);
    bytes_.read_at(place, out.data(), count);
    return out;
  }
  std::uint64_t number(const std::vector<std::byte>& from, std::size_t place, std::size_t size) {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < size; ++i) {
      const std::size_t digit = big_endian_ ? size - 1 - i : i;
      value |= std::to_integer<std::uint64_t>(from[place + i]) << 8 * digit;
    }
    return value;
  }

  ByteSource& bytes_;
  bool big_endian_ = false, big_ = false;
};

/// Rounded down or up, but at least 1.
bool is_half(std::uint64_t half, std::uint64_t whole) {
  return half > 0 && (half == whole / 2 || half == (whole + 1) / 2);
}

}  // namespace

std::uint32_t tiff_levels(ByteSource& bytes) {
  Directories directories(bytes);
  std::uint32_t levels = 1;
  std::optional<Directory> last = directories.first();
  // Sizes fall, so this ends whatever the chain is.
  while (last && (last->width > 1 || last->height > 1)) {
    const std::optional<Directory> next = directories.at(last->next);
    if (!next || !is_half(next->width, last->width) || !is_half(next->height, last->height)) break;
    ++levels;
    last = next;
  }
  return levels;
}

}  // namespace pounce::io
