// SPDX-License-Identifier: Apache-2.0
#include "store/pack/codec.h"

#include <zstd.h>

#include <catch2/catch.hpp>
#include <cstring>
#include <memory>

#include "support/bytes.h"
#include "support/random.h"

namespace pounce::store {
namespace {

using test::error_kind;
using test::kDamaged;
using test::random_bytes;

TEST_CASE("what was compressed comes back, at every size and with one reused context", "[format]") {
  Compressor compressor;
  std::vector<std::byte> stored;
  for (const std::size_t size : {0u, 1u, 2u, 100u, 4096u, 131'072u, 131'073u, 3'000'000u}) {
    const auto raw = random_bytes(size, static_cast<std::uint32_t>(size));
    compressor.compress(raw, stored);
    CHECK(!is_as_is(stored));
    std::vector<std::byte> back(size, std::byte{0xee});
    compressor.decompress(stored, back);
    CAPTURE(size);
    CHECK(back == raw);
    if (size >= 4096) CHECK(stored.size() < size * 6 / 10);
  }
}

TEST_CASE("the same bytes compress to the same bytes whatever came before", "[format]") {
  const auto raw = random_bytes(50'000, 1);
  Compressor used, fresh;
  std::vector<std::byte> first, other, again;
  fresh.compress(raw, first);
  used.compress(random_bytes(300'000, 2), other);
  used.compress(raw, again);
  CHECK(first == again);
}

TEST_CASE("a frame is not compressed where there is room, and is a frame like others", "[format]") {
  Compressor compressor;
  PlainRoom room = 5;
  const std::vector raw{std::byte{7}, std::byte{8}, std::byte{9}};
  std::vector<std::byte> stored, compressed;
  compressor.compress(raw, stored, kZstdLevel, &room);
  CHECK(room == 2);
  // RFC 8878: magic, one segment whose size is in four bytes, 3; the last block, as it is, 3 bytes.
  const unsigned char frame[] = {0x28, 0xB5, 0x2F, 0xFD, 0xA0, 3, 0, 0, 0, 0x19, 0, 0, 7, 8, 9};
  REQUIRE(stored.size() == sizeof frame);
  CHECK(std::memcmp(stored.data(), frame, sizeof frame) == 0);
  compressor.compress(raw, compressed);
  compressor.compress(raw, stored, kZstdLevel, &room);
  CHECK(stored == compressed);  // too little was left
  CHECK(room == 2);

  // The same of bytes that have passed no filter: the size is in eight bytes.
  CHECK(!is_as_is(stored));
  CHECK(!Compressor::keep_as_is(raw, stored, nullptr));
  CHECK(!Compressor::keep_as_is(raw, stored, &room));
  CHECK(stored == compressed);
  CHECK(room == 2);
  room = 3;
  CHECK(Compressor::keep_as_is(raw, stored, &room));
  CHECK(room == 0);
  CHECK(is_as_is(stored));
  const unsigned char as_is[] = {0x28, 0xB5, 0x2F, 0xFD, 0xE0, 3, 0, 0, 0, 0,
                                 0,    0,    0,    0x19, 0,    0, 7, 8, 9};
  REQUIRE(stored.size() == sizeof as_is);
  CHECK(std::memcmp(stored.data(), as_is, sizeof as_is) == 0);
  CHECK(!is_as_is(std::span(stored).first(4)));

  const bool filtered = GENERATE(true, false);
  for (const std::size_t size : {0u, 1u, 131'072u, 131'073u, 262'144u, 3'000'000u}) {
    const auto bytes = random_bytes(size, static_cast<std::uint32_t>(size));
    room = size;
    if (filtered)
      compressor.compress(bytes, stored, kFastLevel, &room);
    else
      CHECK(Compressor::keep_as_is(bytes, stored, &room));
    CHECK(room == 0);
    CHECK(is_as_is(stored) == !filtered);
    CHECK(stored.size() >= size + 12);
    CHECK(stored.size() <= ZSTD_compressBound(size));
    std::vector<std::byte> back(size, std::byte{0xee});
    compressor.decompress(stored, back);
    CAPTURE(size);
    CHECK(back == bytes);
  }
}

TEST_CASE("a frame of another size than announced is damage", "[format]") {
  Compressor compressor;
  const auto raw = random_bytes(1000, 3);
  std::vector<std::byte> stored;
  compressor.compress(raw, stored);
  for (const std::size_t size : {0u, 999u, 1001u, 5000u}) {
    std::vector<std::byte> out(size);
    CAPTURE(size);
    CHECK(error_kind([&] { compressor.decompress(stored, out); }) == kDamaged);
  }
}

TEST_CASE("truncated and lengthened frames are damage", "[format]") {
  Compressor compressor;
  const auto raw = random_bytes(600, 4);
  std::vector<std::byte> stored;
  compressor.compress(raw, stored);
  std::vector<std::byte> out(raw.size());
  for (std::size_t size = 0; size < stored.size(); ++size) {
    CAPTURE(size);
    CHECK(error_kind([&] { compressor.decompress(std::span(stored).first(size), out); }) ==
          kDamaged);
  }
  // A second frame, as zstd itself would accept: empty, so that the size still fits.
  std::vector<std::byte> empty, two = stored;
  compressor.compress({}, empty);
  two.insert(two.end(), empty.begin(), empty.end());
  CHECK(error_kind([&] { compressor.decompress(two, out); }) == kDamaged);
}

TEST_CASE("a frame that does not state its size is damage", "[format]") {
  const auto raw = random_bytes(500, 5);
  std::vector<std::byte> stored(ZSTD_compressBound(raw.size())), out(raw.size());
  ZSTD_CCtx* context = ZSTD_createCCtx();
  ZSTD_CCtx_setParameter(context, ZSTD_c_contentSizeFlag, 0);
  stored.resize(ZSTD_compress2(context, stored.data(), stored.size(), raw.data(), raw.size()));
  ZSTD_freeCCtx(context);
  Compressor compressor;
  CHECK(error_kind([&] { compressor.decompress(stored, out); }) == kDamaged);
}

TEST_CASE("a flipped bit gives an error or other bytes, never a write beyond the buffer",
          "[format]") {
  // Without a checksum zstd cannot notice all damage (packs do, before they decompress). What
  // counts here is that nothing crashes and that bytes behind the buffer stay as they are.
  Compressor compressor;
  const auto raw = random_bytes(400, 6);
  std::vector<std::byte> stored, out(raw.size() + 64);
  compressor.compress(raw, stored);
  std::size_t noticed = 0;
  for (std::size_t bit = 0; bit < stored.size() * 8; ++bit) {
    auto bad = stored;
    bad[bit / 8] ^= static_cast<std::byte>(1u << (bit % 8));
    std::fill(out.begin(), out.end(), std::byte{0x5a});
    const int kind =
        error_kind([&] { compressor.decompress(bad, std::span(out).first(raw.size())); });
    CHECK((kind == 0 || kind == kDamaged));
    noticed += kind == kDamaged;
    const bool untouched =
        std::all_of(out.end() - 64, out.end(), [](std::byte b) { return b == std::byte{0x5a}; });
    CHECK(untouched);
  }
  CHECK(noticed > 32);  // at least every bit of the frame's magic
  // The context still works after so many failures.
  std::vector<std::byte> back(raw.size());
  compressor.decompress(stored, back);
  CHECK(back == raw);
}

TEST_CASE("both contexts of a compressor stay below one mebibyte", "[format]") {
  // The budget counts this much per thread; more than that would break it.
  CHECK(Compressor::context_bytes() > 64u << 10);
  CHECK(Compressor::context_bytes() < 1u << 20);
}

TEST_CASE("contexts do not outgrow what the budget counts, whatever they compress", "[format]") {
  // As a Compressor's: windows of 128 KiB, both levels that stores use.
  const std::unique_ptr<ZSTD_CCtx, decltype(&ZSTD_freeCCtx)> compress(ZSTD_createCCtx(),
                                                                      ZSTD_freeCCtx);
  const std::unique_ptr<ZSTD_DCtx, decltype(&ZSTD_freeDCtx)> decompress(ZSTD_createDCtx(),
                                                                        ZSTD_freeDCtx);
  REQUIRE(!ZSTD_isError(ZSTD_CCtx_setParameter(compress.get(), ZSTD_c_windowLog, 17)));
  test::Random random(1);
  std::vector<std::byte> all(4u << 20), stored(ZSTD_compressBound(all.size())), back(all.size());
  for (const unsigned bits : {0u, 4u, 8u}) {
    for (std::byte& b : all) b = static_cast<std::byte>(random.below(1u << bits));
    for (const std::size_t bytes : {1u << 12, 1u << 14, 1u << 17, 1u << 18, 4u << 20}) {
      for (const int level : {kZstdLevel, kFastLevel}) {
        ZSTD_CCtx_setParameter(compress.get(), ZSTD_c_compressionLevel, level);
        const std::size_t size =
            ZSTD_compress2(compress.get(), stored.data(), stored.size(), all.data(), bytes);
        REQUIRE(!ZSTD_isError(size));
        REQUIRE(ZSTD_decompressDCtx(decompress.get(), back.data(), back.size(), stored.data(),
                                    size) == bytes);
        CHECK(ZSTD_sizeof_CCtx(compress.get()) + ZSTD_sizeof_DCtx(decompress.get()) <=
              Compressor::context_bytes());
      }
    }
  }
}

TEST_CASE("a byte shuffle puts byte k of every element into plane k", "[format]") {
  const unsigned char elements[] = {1, 2, 3, 11, 12, 13, 21, 22, 23, 31, 32, 33};
  const unsigned char planes[] = {1, 11, 21, 31, 2, 12, 22, 32, 3, 13, 23, 33};
  std::vector<std::byte> out(12);
  shuffle(std::as_bytes(std::span(elements)), 3, out);
  CHECK(std::memcmp(out.data(), planes, 12) == 0);
}

TEST_CASE("unshuffle undoes shuffle for all element sizes and counts", "[format]") {
  for (std::size_t element = 1; element <= 16; ++element) {
    for (const std::size_t count : {0u, 1u, 3u, 17u, 64u, 1000u}) {
      const auto raw = random_bytes(element * count, static_cast<std::uint32_t>(element));
      std::vector<std::byte> planes(raw.size()), back(raw.size());
      shuffle(raw, element, planes);
      for (std::size_t i = 0; i < raw.size(); ++i) {
        if (planes[(i % element) * count + i / element] != raw[i]) FAIL("byte " << i);
      }
      unshuffle(planes, element, back);
      CAPTURE(element, count);
      CHECK(back == raw);
    }
  }
}

TEST_CASE("delta keeps the first elements and wraps around below zero", "[format]") {
  std::uint16_t values[] = {10, 20, 13, 19, 0xffff, 25};
  delta(std::as_writable_bytes(std::span(values)), 2, 2);
  CHECK(std::vector<std::uint16_t>(values, values + 6) ==
        std::vector<std::uint16_t>{10, 20, 3, 0xffff, 0xffff - 13, 6});
}

/// The definition, one element at a time.
std::vector<std::byte> slow_delta(const std::vector<std::byte>& raw, std::size_t element,
                                  std::size_t stride) {
  auto out = raw;
  for (std::size_t i = stride; i < raw.size() / element; ++i) {
    std::uint32_t a = 0, b = 0;
    std::memcpy(&a, &raw[i * element], element);
    std::memcpy(&b, &raw[(i - stride) * element], element);
    a -= b;
    std::memcpy(&out[i * element], &a, element);
  }
  return out;
}

TEST_CASE("undelta undoes delta for all element sizes and strides", "[format]") {
  std::mt19937 random(7);
  for (const std::size_t element : {1u, 2u, 4u}) {
    for (const std::size_t count : {0u, 1u, 2u, 63u, 64u, 65u, 1000u, 4096u}) {
      std::vector<std::byte> raw(count * element);
      for (std::byte& b : raw) b = static_cast<std::byte>(random());
      for (const std::size_t stride : {1u, 2u, 3u, 4u, 15u, 16u, 17u, 63u, 64u, 65u, 128u, 5000u}) {
        auto work = raw;
        delta(work, element, stride);
        CAPTURE(element, count, stride);
        CHECK(work == slow_delta(raw, element, stride));
        undelta(work, element, stride);
        CHECK(work == raw);
      }
    }
  }
}

TEST_CASE("element sizes and strides that make no sense are refused", "[format]") {
  std::vector<std::byte> a(12), b(11);
  constexpr int kInternal = static_cast<int>(ErrorKind::internal);
  CHECK(error_kind([&] { shuffle(a, 5, a); }) == kInternal);
  CHECK(error_kind([&] { shuffle(a, 4, b); }) == kInternal);
  CHECK(error_kind([&] { unshuffle(a, 0, a); }) == kInternal);
  CHECK(error_kind([&] { delta(a, 3, 1); }) == kInternal);
  CHECK(error_kind([&] { delta(b, 2, 1); }) == kInternal);
  CHECK(error_kind([&] { undelta(a, 4, 0); }) == kInternal);
}

}  // namespace
}  // namespace pounce::store
