// SPDX-License-Identifier: Apache-2.0
#include "core/hash.h"

#include <catch2/catch.hpp>
#include <vector>

namespace pounce {
namespace {

std::span<const std::byte> bytes_of(std::string_view text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}

/// Byte i is i mod 251: long enough for the loops that short inputs never reach.
std::vector<std::byte> counting_bytes(std::size_t count) {
  std::vector<std::byte> bytes(count);
  for (std::size_t i = 0; i < count; ++i) bytes[i] = static_cast<std::byte>(i % 251);
  return bytes;
}

TEST_CASE("checksums are XXH3-64 with seed 0", "[core]") {
  CHECK(checksum({}) == 0x2D06800538D394C2u);
  CHECK(checksum(bytes_of("a")) == 0xE6C632B61E964E1Fu);
  CHECK(checksum(bytes_of("abc")) == 0x78AF5F94892F3950u);
}

TEST_CASE("content hashes are XXH3-128 with seed 0, high half first", "[core]") {
  CHECK(to_hex(Hasher().digest()) == "99aa06d3014798d86001c324468d497f");
  Hasher abc;
  abc.add(bytes_of("abc"));
  CHECK(to_hex(abc.digest()) == "06b05ab6733a618578af5f94892f3950");
}

TEST_CASE("a hash does not depend on how its input is cut", "[core]") {
  const std::vector<std::byte> bytes = counting_bytes(5000);
  Hasher whole;
  whole.add(bytes);
  for (const std::size_t piece : {1u, 7u, 64u, 241u, 1024u, 4999u}) {
    Hasher pieces;
    for (std::size_t at = 0; at < bytes.size(); at += piece) {
      pieces.add(std::span(bytes).subspan(at, std::min(piece, bytes.size() - at)));
    }
    CAPTURE(piece);
    CHECK(pieces.digest() == whole.digest());
  }
}

TEST_CASE("a digest may be taken before the end without disturbing it", "[core]") {
  Hasher once, twice;
  once.add(std::string_view("left"));
  twice.add(std::string_view("left"));
  CHECK(once.digest() == twice.digest());
  once.add(std::string_view("right"));
  twice.add(std::string_view("right"));
  CHECK(once.digest() == twice.digest());
}

TEST_CASE("neighbouring texts cannot run into each other", "[core]") {
  Hasher a, b;
  a.add(std::string_view("ab"));
  a.add(std::string_view("c"));
  b.add(std::string_view("a"));
  b.add(std::string_view("bc"));
  CHECK_FALSE(a.digest() == b.digest());
}

TEST_CASE("numbers are hashed by their little-endian bytes", "[core]") {
  Hasher number, bytes;
  number.add(std::uint32_t{0x04030201});
  const std::byte raw[] = {std::byte{1}, std::byte{2}, std::byte{3}, std::byte{4}};
  bytes.add(std::span<const std::byte>(raw));
  CHECK(number.digest() == bytes.digest());
}

TEST_CASE("hex digits of a hash keep leading zeros", "[core]") {
  CHECK(to_hex({0x1, 0xabc}) == "00000000000000010000000000000abc");
}

}  // namespace
}  // namespace pounce
