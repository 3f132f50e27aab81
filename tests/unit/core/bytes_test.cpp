// SPDX-License-Identifier: Apache-2.0
#include "core/bytes.h"

#include <array>
#include <catch2/catch.hpp>
#include <limits>

#include "support/bytes.h"

using namespace pounce;

TEST_CASE("values are written little endian, one after the other") {
  std::vector<std::byte> bytes;
  bytes.reserve(64);
  ByteWriter out(bytes);
  out.put(std::uint32_t{0x04030201});
  out.put(std::uint8_t{5});
  out.put(std::int16_t{-2});
  out.put(1.0F);
  const std::array<std::uint16_t, 2> pair{0x0A09, 0x0C0B};
  out.put_span(std::span<const std::uint16_t>(pair));
  const std::vector<std::uint8_t> expected{1, 2,    3,    4, 5,  0xFE, 0xFF, 0,
                                           0, 0x80, 0x3F, 9, 10, 11,   12};
  REQUIRE(bytes.size() == expected.size());
  for (std::size_t i = 0; i < bytes.size(); ++i)
    CHECK(std::to_integer<std::uint8_t>(bytes[i]) == expected[i]);
}

TEST_CASE("a reader gives back what was written and says what is left") {
  std::vector<std::byte> bytes;
  ByteWriter out(bytes);
  out.put(std::uint64_t{1} << 63);
  out.put(-1.5);
  const std::array<float, 3> floats{1, 2, 3};
  out.put_span(std::span<const float>(floats));
  ByteReader in(bytes, "head.pack");
  CHECK(in.left() == 28);
  CHECK(in.get<std::uint64_t>() == std::uint64_t{1} << 63);
  CHECK(in.get<double>() == -1.5);
  std::array<float, 3> read{};
  in.get_span(std::span<float>(read));
  CHECK(read == floats);
  CHECK(in.left() == 0);
  in.get_span(std::span<float>());  // nothing asked for, nothing needed
}

TEST_CASE("a reader never goes past the end and names what it reads") {
  const std::vector<std::byte> bytes(7);
  std::string message;
  CHECK(test::error_kind([&] { ByteReader(bytes, "a.pack").get<std::uint64_t>(); }, &message) ==
        test::kDamaged);
  CHECK(message == "a.pack ends too early");
  ByteReader in(bytes, "a.pack");
  CHECK(in.get<std::uint32_t>() == 0);
  CHECK(test::error_kind([&] { in.get<std::uint32_t>(); }) == test::kDamaged);
  CHECK(in.left() == 3);  // a failed read takes nothing
  CHECK(test::error_kind([&] { in.take(std::numeric_limits<std::size_t>::max()); }) ==
        test::kDamaged);
  CHECK(in.take(3).size() == 3);
}
