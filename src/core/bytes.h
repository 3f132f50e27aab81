// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "pounce/error.h"

namespace pounce {

static_assert(std::endian::native == std::endian::little,
              "stores are little endian, written as in memory");

/// Bytes that have no value yet: for what is filled at once and in full. A vector would clear it
/// first.
class UnsetBytes {
 public:
  UnsetBytes() = default;
  explicit UnsetBytes(std::size_t size)
      : bytes_(std::make_unique_for_overwrite<std::byte[]>(size)), size_(size) {}
  std::byte* data() { return bytes_.get(); }
  const std::byte* data() const { return bytes_.get(); }
  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  operator std::span<std::byte>() { return {bytes_.get(), size_}; }
  operator std::span<const std::byte>() const { return {bytes_.get(), size_}; }

 private:
  std::unique_ptr<std::byte[]> bytes_;
  std::size_t size_ = 0;
};

/// Appends plain values to a byte vector.
class ByteWriter {
 public:
  explicit ByteWriter(std::vector<std::byte>& out) : out_(out) {}
  template <class T>
  requires std::is_arithmetic_v<T>
  void put(T value) { put_span(std::span<const T>(&value, 1)); }
  /// One after the other.
  template <class... T>
  void put_all(const T&... values) {
    (put(values), ...);
  }
  /// The elements alone, without their count.
  template <class T>
  void put_span(std::span<const T> values) {
    static_assert(std::is_trivially_copyable_v<T>);
    if (values.empty()) return;
    // Not insert(): gcc 12 warns of an overflow that cannot be.
    const std::size_t at = out_.size();
    out_.resize(at + values.size_bytes());
    std::memcpy(&out_[at], values.data(), values.size_bytes());
  }

 private:
  std::vector<std::byte>& out_;
};

/// Reads what ByteWriter wrote; never past the end: throws Error(damaged_store) naming `what`.
class ByteReader {
 public:
  ByteReader(std::span<const std::byte> in, std::string what) : in_(in), what_(std::move(what)) {}
  template <class T>
  requires std::is_arithmetic_v<T> T get() {
    T value;
    std::memcpy(&value, take(sizeof(T)).data(), sizeof(T));
    return value;
  }
  template <class... T>
  void get_all(T&... values) {
    ((values = get<T>()), ...);
  }
  template <class T>
  void get_span(std::span<T> values) {
    static_assert(std::is_trivially_copyable_v<T>);
    if (!values.empty())
      std::memcpy(values.data(), take(values.size_bytes()).data(), values.size_bytes());
  }
  std::span<const std::byte> take(std::size_t count) {
    if (count > in_.size()) fail("ends too early");
    const auto taken = in_.first(count);
    in_ = in_.subspan(count);
    return taken;
  }
  std::size_t left() const { return in_.size(); }
  [[noreturn]] void fail(const char* why) const {
    throw Error(ErrorKind::damaged_store, what_ + " " + why);
  }

 private:
  std::span<const std::byte> in_;
  std::string what_;
};

}  // namespace pounce
