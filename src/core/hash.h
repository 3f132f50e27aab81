// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

namespace pounce {

/// 128-bit XXH3 content hash.
struct Hash128 {
  std::uint64_t hi = 0, lo = 0;
  bool operator==(const Hash128&) const = default;
};
std::string to_hex(const Hash128& hash);  ///< 32 lower-case digits

/// 64-bit XXH3 of bytes: the checksum of every stored block.
std::uint64_t checksum(std::span<const std::byte> bytes) noexcept;

/// Streaming 128-bit hash. Values are hashed by their bytes (little endian, as in memory).
class Hasher {
 public:
  Hasher();
  ~Hasher();
  Hasher(const Hasher&) = delete;
  Hasher& operator=(const Hasher&) = delete;
  void add(std::span<const std::byte> bytes);
  void add(
      std::string_view text);  ///< length and characters, so that "ab","c" differs from "a","bc"
  template <class T>
  requires std::is_arithmetic_v<T> || std::is_enum_v<T>
  void add(T value) { add(std::as_bytes(std::span(&value, 1))); }
  void add(const Hash128& hash) {
    add(hash.hi);
    add(hash.lo);
  }
  Hash128 digest() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace pounce
