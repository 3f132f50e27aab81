// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "core/file.h"

namespace pounce::io {

/// Bits that were read ahead: what a decoding loop keeps in registers.
struct BitState {
  const std::byte* next = nullptr;  ///< the first byte of which `bits` may not hold all bits
  const std::byte* safe = nullptr;  ///< while next < safe, three refills need not ask for bytes
  std::uint64_t bits = 0;           ///< the next one is the lowest
  std::uint32_t count = 0;          ///< how many of them are sure

  /// Makes at least 56 bits sure. Those above are of the same stream: taking them in again later
  /// changes nothing.
  void refill() {
    std::uint64_t word;
    std::memcpy(&word, next, sizeof word);
    bits |= word << count;
    next += (63 - count) >> 3;
    count |= 56;
  }
  void skip(std::uint32_t n) {
    bits >>= n;
    count -= n;
  }
  /// Up to 31 bits; refill() has made them sure.
  std::uint32_t take(std::uint32_t n) {
    const std::uint32_t value = static_cast<std::uint32_t>(bits) & ((1U << n) - 1);
    skip(n);
    return value;
  }
};

/// The bits of a stretch of a file, the lowest of each byte first, read in pieces of 64 KiB.
class BitSource {
 public:
  /// `bytes` bytes of `file` from `at`, which must outlive this. `name` is what messages call the
  /// image, `origin` where it begins in the file: they count bytes from there.
  BitSource(const ReadFile& file, std::uint64_t at, std::uint64_t bytes, std::string name,
            std::uint64_t origin);

  /// The next `n` <= 31 bits, zeros behind the end: see check().
  std::uint32_t read(std::uint32_t n) { return sure().take(n); }
  /// The state with 56 bits sure.
  BitState& sure() {
    if (state_.next >= state_.safe) state_ = more(state_);
    state_.refill();
    return state_;
  }

  /// For loops that keep a copy: to be put back with set() before anything else is called here.
  const BitState& state() const { return state_; }
  void set(const BitState& state) { state_ = state; }
  /// `state` with more bytes behind it. Throws Error(input) where the end was long passed.
  BitState more(const BitState& state);

  /// Throws Error(input) if more bits were taken than there are.
  void check() const;
  /// Throws Error(input): what is wrong at the present place.
  [[noreturn]] void fail(const std::string& what) const;

 private:
  std::uint64_t bits_taken() const;

  const ReadFile& file_;
  std::uint64_t at_, bytes_, origin_;
  std::string name_;
  std::vector<std::byte> buffer_;
  std::uint64_t loaded_ = 0;     ///< bytes that were read so far
  std::uint64_t buffer_at_ = 0;  ///< of the stretch: its first byte in the buffer
  BitState state_;
};

}  // namespace pounce::io
