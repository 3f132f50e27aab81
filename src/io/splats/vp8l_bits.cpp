// SPDX-License-Identifier: Apache-2.0
#include "io/splats/vp8l_bits.h"

#include <fmt/format.h>

#include <algorithm>

#include "pounce/error.h"

namespace pounce::io {
namespace {

constexpr std::size_t kPieceBytes = 64 << 10;
constexpr std::size_t kSafeBytes = 32;  // three refills take 21 bytes and look at 8
constexpr std::size_t kPadBytes = 64;   // zeros behind the last byte

}  // namespace

BitSource::BitSource(const ReadFile& file, std::uint64_t at, std::uint64_t bytes, std::string name,
                     std::uint64_t origin)
    : file_(file), at_(at), bytes_(bytes), origin_(origin), name_(std::move(name)) {
  buffer_.resize(kPieceBytes + kSafeBytes + kPadBytes);
  state_.next = state_.safe = buffer_.data();
}

BitState BitSource::more(const BitState& state) {
  const std::size_t held = static_cast<std::size_t>(loaded_ - buffer_at_);
  const std::size_t used = static_cast<std::size_t>(state.next - buffer_.data());
  if (used > held) {  // among the zeros behind the end
    state_ = state;
    check();
  }
  const std::size_t left = held - used;  // no more than kSafeBytes
  std::memmove(buffer_.data(), buffer_.data() + used, left);
  buffer_at_ += used;
  const std::size_t piece =
      static_cast<std::size_t>(std::min<std::uint64_t>(kPieceBytes, bytes_ - loaded_));
  file_.read(at_ + loaded_, std::span(buffer_).subspan(left, piece));
  loaded_ += piece;
  std::size_t end = left + piece;
  if (loaded_ == bytes_) {
    std::fill_n(buffer_.begin() + static_cast<std::ptrdiff_t>(end), kPadBytes, std::byte{0});
    end += kPadBytes;
  }
  BitState result = state;
  result.next = buffer_.data();
  result.safe = buffer_.data() + end - kSafeBytes;
  return result;
}

std::uint64_t BitSource::bits_taken() const {
  return 8 * (buffer_at_ + static_cast<std::uint64_t>(state_.next - buffer_.data())) - state_.count;
}

void BitSource::check() const {
  if (bits_taken() > 8 * bytes_) fail("it ends too early");
}

void BitSource::fail(const std::string& what) const {
  const std::uint64_t byte = at_ - origin_ + std::min(bits_taken() / 8, bytes_);
  throw Error(ErrorKind::input,
              fmt::format("{}: its image is damaged at byte {}: {}; download it or export it again",
                          name_, byte, what));
}

}  // namespace pounce::io
