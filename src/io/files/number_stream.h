// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/file.h"

namespace pounce::io {

/// A file from front to back, as words of text or as raw bytes. Holds 256 KiB of it.
class NumberStream {
 public:
  /// `lines`: before `offset`.
  explicit NumberStream(const std::string& path, std::uint64_t offset = 0, std::uint64_t lines = 0);

  /// The next word, whatever blanks and ends of lines are before it; empty at the end of the file.
  /// Valid until the next call. Throws Error(input) for one of more than 4 KiB.
  std::string_view word();
  /// What is left of the line, at most 4 KiB of it.
  std::string rest_of_line();
  /// The next `count` bytes, at most 4 KiB. Throws Error(input) where the file ends before.
  std::span<const std::byte> bytes(std::size_t count);
  void skip(std::uint64_t count);

  /// Of the last word, from 1.
  std::uint64_t line() const { return line_; }
  std::uint64_t left_bytes() const { return size_ - offset_ + (end_ - at_); }
  const std::string& path() const { return path_; }

 private:
  bool fill(std::size_t wanted);

  std::string path_;
  std::unique_ptr<ReadFile> file_;
  std::uint64_t size_ = 0, offset_ = 0;  ///< of the file; of what was not read yet
  std::vector<char> piece_;
  std::size_t at_ = 0, end_ = 0;  ///< in the piece
  std::uint64_t line_ = 1;
};

}  // namespace pounce::io
