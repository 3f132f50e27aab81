// SPDX-License-Identifier: Apache-2.0
#include "io/files/number_stream.h"

#include <algorithm>
#include <cstring>

#include "core/input_file.h"
#include "io/problems.h"

namespace pounce::io {
namespace {

constexpr std::size_t kPieceBytes = 256 << 10;
constexpr std::size_t kMostAtOnce = 4096;

bool is_blank(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

}  // namespace

NumberStream::NumberStream(const std::string& path, std::uint64_t offset, std::uint64_t lines)
    : path_(path),
      file_(open_input(path)),
      size_(file_->size_bytes()),
      offset_(offset),
      line_(lines + 1) {
  offset_ = std::min(offset_, size_);
  piece_.resize(std::min<std::uint64_t>(kPieceBytes, std::max<std::uint64_t>(1, size_ - offset_)));
}

/// Makes `wanted` bytes be there behind at_, if the file has them.
bool NumberStream::fill(std::size_t wanted) {
  if (end_ - at_ >= wanted) return true;
  std::memmove(piece_.data(), piece_.data() + at_, end_ - at_);
  end_ -= at_;
  at_ = 0;
  const std::size_t more = std::min<std::uint64_t>(piece_.size() - end_, size_ - offset_);
  file_->read(offset_, std::as_writable_bytes(std::span(piece_).subspan(end_, more)));
  offset_ += more;
  end_ += more;
  return end_ >= wanted;
}

std::string_view NumberStream::word() {
  while (fill(1) && is_blank(piece_[at_])) line_ += piece_[at_++] == '\n' ? 1 : 0;
  std::size_t size = 0;
  while (fill(size + 1) && !is_blank(piece_[at_ + size])) {
    if (++size > kMostAtOnce)
      refuse(path_, "line {}: a word of more than {} bytes; the file is damaged", line_,
             kMostAtOnce);
  }
  at_ += size;
  return {piece_.data() + at_ - size, size};
}

std::string NumberStream::rest_of_line() {
  std::string rest;
  for (; fill(1) && piece_[at_] != '\n'; ++at_) {
    if (rest.size() < kMostAtOnce) rest += piece_[at_];
  }
  const std::size_t first = std::min(rest.find_first_not_of(" \t\r"), rest.size());
  rest.erase(0, first);
  while (!rest.empty() && is_blank(rest.back())) rest.pop_back();
  return rest;
}

std::span<const std::byte> NumberStream::bytes(std::size_t count) {
  if (!fill(count)) refuse(path_, "truncated: it ends at byte {}; copy or export it again", size_);
  at_ += count;
  return std::as_bytes(std::span(piece_)).subspan(at_ - count, count);
}

void NumberStream::skip(std::uint64_t count) {
  if (count > left_bytes())
    refuse(path_, "truncated: it ends at byte {}; copy or export it again", size_);
  const std::uint64_t here = std::min<std::uint64_t>(count, end_ - at_);
  at_ += here;
  offset_ += count - here;
}

}  // namespace pounce::io
