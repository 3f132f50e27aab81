// SPDX-License-Identifier: Apache-2.0
//
// What Zstandard and xz make room for in a TIFF is known, and limited, before they do.
#include <zstd.h>

#include <catch2/catch.hpp>

#include "io/codec/tiff_window.h"
#include "pounce/error.h"
#include "unit/io/image_files.h"

using namespace pounce;
using Catch::Contains;

namespace {

using Window = std::uint64_t (*)(io::ByteSource&, std::uint64_t, std::uint64_t);

/// Of a part with other bytes before and behind it.
std::uint64_t window_of(Window of, const std::string& part) {
  const mesh::ImageRef image = test::in_memory("before" + part + "behind", "a.tif");
  io::ByteSource bytes(image);
  return of(bytes, 6, part.size());
}

std::string refusal(Window of, const std::string& part) {
  try {
    window_of(of, part);
  } catch (const Error& e) {
    CHECK(e.kind() == ErrorKind::input);
    return e.what();
  }
  return "nothing";
}

/// As libtiff does, which does not say how much follows.
std::string zstd(const std::string& plain, int window_log, bool checksum = false) {
  ZSTD_CCtx* const context = ZSTD_createCCtx();
  ZSTD_CCtx_setParameter(context, ZSTD_c_windowLog, window_log);
  ZSTD_CCtx_setParameter(context, ZSTD_c_checksumFlag, checksum ? 1 : 0);
  std::string out(ZSTD_compressBound(plain.size()), '\0');
  ZSTD_inBuffer from{plain.data(), plain.size(), 0};
  ZSTD_outBuffer to{out.data(), out.size(), 0};
  ZSTD_compressStream2(context, &to, &from, ZSTD_e_continue);
  REQUIRE(ZSTD_compressStream2(context, &to, &from, ZSTD_e_end) == 0);
  ZSTD_freeCCtx(context);
  out.resize(to.pos);
  return out;
}

/// Stored as it is in one block behind `filters`, as many as `flags` say, with a checksum of four
/// bytes.
std::string xz(const std::string& plain, const std::string& filters, char flags = 0) {
  std::string head = std::string(1, '\2') + flags + filters;
  head.resize(12, '\0');
  std::string out = std::string("\xFD\x37zXZ\0\0\1", 8) + "crc-" + head;
  out += std::string("\1\0", 2) + static_cast<char>(plain.size() - 1) + plain + '\0';
  while (out.size() % 4 != 0) out += '\0';
  return out + "sum-" + std::string(12, '\0');
}

}  // namespace

TEST_CASE("the window of a Zstandard frame is what it says", "[image][tiff]") {
  std::string plain(300000, 'a');
  for (std::size_t i = 0; i < plain.size(); ++i) plain[i] = static_cast<char>(i * i >> 7);
  for (const bool checksum : {false, true}) {
    CHECK(window_of(io::zstd_window, zstd(plain, 22, checksum)) == 4 << 20);
    CHECK(window_of(io::zstd_window, zstd(plain, 27, checksum)) == 128 << 20);
  }
  std::string whole(ZSTD_compressBound(plain.size()), '\0');
  whole.resize(ZSTD_compress(whole.data(), whole.size(), plain.data(), plain.size(), 1));
  CHECK(window_of(io::zstd_window, whole) == plain.size());
  // Windows of 2 GiB, in the first frame and in the second.
  std::string large = zstd(plain, 22);
  large[5] = '\xA8';
  CHECK_THAT(refusal(io::zstd_window, large), Contains("a.tif") && Contains("needs 2048 MiB"));
  CHECK_THAT(refusal(io::zstd_window, zstd(plain, 22) + large), Contains("goes on behind"));
  CHECK_THAT(refusal(io::zstd_window, "(\xB5/\xFE" + plain), Contains("does not begin"));
  // One that is cut off is for the decoder to refuse.
  for (std::size_t size = 6; size < whole.size(); size += 1 + size / 8)
    CHECK(window_of(io::zstd_window, zstd(plain, 22).substr(0, size)) == 4 << 20);
}

TEST_CASE("the window of an xz block is what it says", "[image][tiff]") {
  const std::string eight_mib("\x21\1\x16", 3), two_gib("\x21\1\x26", 3);
  CHECK(window_of(io::xz_window, xz("some samples", eight_mib)) == 8 << 20);
  CHECK(window_of(io::xz_window, xz("some samples", std::string("\3\1\0", 3) + eight_mib, 1)) ==
        8 << 20);
  CHECK(window_of(io::xz_window, xz("some samples", "\4" + std::string(1, '\0') + eight_mib, 1)) ==
        8 << 20);
  CHECK_THAT(refusal(io::xz_window, xz("some samples", two_gib)), Contains("needs 2048 MiB"));
  const std::string small = xz("some samples", eight_mib), large = xz("some samples", two_gib);
  const std::string second = small.substr(0, small.size() - 12) + large.substr(12);
  CHECK_THAT(refusal(io::xz_window, second), Contains("more than one xz block"));
  CHECK_THAT(refusal(io::xz_window, xz("some samples", "\5\1\6")), Contains("not compressed by"));
  CHECK_THAT(refusal(io::xz_window, "so"), Contains("does not begin with an xz stream"));
  for (std::size_t size = 17; size < small.size(); ++size)
    CHECK(window_of(io::xz_window, small.substr(0, size)) == 8 << 20);
}
