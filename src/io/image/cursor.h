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
        refuse(fmt::format("the {} is cut off: it has {} bytes and goes on", what_,
                           bytes_.size_bytes()));
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

}  // namespace pounce::io
