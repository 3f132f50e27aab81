// SPDX-License-Identifier: Apache-2.0
//
// What docs/tile-format.md promises, on packs that a whole transfer left in its cache: a stranger
// finds every texel of the image, with its apron, and every covered texel of the target.
#include "format/stranger.h"

#include <zstd.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "io/image/write.h"
#include "pounce/transfer.h"
#include "support/test_data.h"

namespace pounce {
namespace {

using test::floats;
using test::Stranger;
using Bytes = std::vector<std::byte>;

constexpr std::uint32_t kWidth = 100, kHeight = 60;  // two tiles in a row, one of them narrow

std::byte sample(std::int64_t x, std::int64_t y, std::int64_t channel) {
  return static_cast<std::byte>((x * 7 + y * 13 + channel * 101 + x * y) % 251);
}

/// A rectangle of 2 x 1 that shows the whole image, and its packs after a transfer onto itself.
struct Rectangle {
  test::TempFolder folder;

  Rectangle() {
    std::ofstream(folder.file("r.mtl")) << "newmtl picture\nmap_Kd r.png\n";
    std::ofstream(folder.file("r.obj"))
        << "mtllib r.mtl\nusemtl picture\nv 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\n"
           "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n";
    io::ImageWriter image(folder.file("r.png"), {kWidth, kHeight, 3, Depth::u8, false, false});
    Bytes rows;
    for (std::uint32_t y = 0; y < kHeight; ++y) {
      for (std::uint32_t x = 0; x < kWidth; ++x) {
        for (int c = 0; c < 3; ++c) rows.push_back(sample(x, y, c));
      }
    }
    image.write_rows(kHeight, rows.data());
    image.commit();
    TransferOptions options;
    options.source = folder.file("r.obj");
    options.targets = {options.source};
    options.output = folder.file("out.png");
    options.resources.cache_dir = folder.file("cache");
    options.resources.memory_bytes = 256ULL << 20;
    transfer(options);
  }

  std::vector<Bytes> packs(const std::string& kind) const {
    std::vector<Bytes> found;
    for (const auto& entry :
         std::filesystem::directory_iterator(folder.path() / "cache/v3" / kind)) {
      if (entry.path().extension() != ".pack") continue;  // a label
      std::ifstream file(entry.path(), std::ios::binary);
      const std::vector<char> bytes{std::istreambuf_iterator<char>(file), {}};
      const auto* first = reinterpret_cast<const std::byte*>(bytes.data());
      found.emplace_back(first, first + bytes.size());
    }
    return found;
  }
};

struct Place {
  std::uint64_t offset;
  std::uint32_t stored, raw;
};

Place place(Stranger& in) {
  const std::uint64_t offset = in.integer(8);
  const std::uint32_t stored = in.u32();
  return {offset, stored, in.u32()};
}

/// The payload of the chunk there.
Stranger payload(const Bytes& pack, const Place& at) {
  Bytes raw(at.raw);
  REQUIRE(at.offset + 32 + at.stored <= pack.size());
  REQUIRE(ZSTD_decompress(raw.data(), raw.size(), pack.data() + at.offset + 32, at.stored) ==
          raw.size());
  return Stranger(std::move(raw));
}

Stranger directory(const Bytes& pack) {
  Stranger footer(Bytes(pack.end() - 64, pack.end()));
  footer.integer(8);  // magic
  const std::uint64_t offset = footer.integer(8);
  const std::uint32_t stored = footer.u32();
  return payload(pack, {offset, stored, footer.u32()});
}

TEST_CASE("a stranger finds every texel of the image in the colour pack", "[format]") {
  const Rectangle rectangle;
  const auto packs = rectangle.packs("colour");
  REQUIRE(packs.size() == 1);
  Stranger in = directory(packs[0]);
  REQUIRE(in.u32() == kWidth);
  REQUIRE(in.u32() == kHeight);
  REQUIRE(in.u32() == 3);
  for (int i = 0; i < 5; ++i) CHECK(in.integer(1) == 0);  // u8, coded, no alpha, repeat, repeat
  CHECK(in.integer(8) == 0);
  Stranger row = payload(packs[0], place(in));
  CHECK(in.left() == 0);
  for (std::int64_t tile = 0; tile < 2; ++tile) {
    const auto samples = payload(packs[0], place(row)).texels(std::size_t{68} * 68, 3, 1);
    std::size_t wrong = 0;
    for (std::int64_t i = 0; i < std::int64_t{68} * 68 * 3; ++i) {
      const std::int64_t x = tile * 64 - 2 + i / 3 % 68, y = i / 3 / 68 - 2;
      const bool beyond = x >= kWidth + 2 || y >= kHeight + 2;
      const std::byte expected =
          beyond ? std::byte(0) : sample((x + kWidth) % kWidth, (y + kHeight) % kHeight, i % 3);
      if (samples[static_cast<std::size_t>(i)] != std::to_integer<std::uint32_t>(expected)) ++wrong;
    }
    CHECK(wrong == 0);
  }
  CHECK(row.left() == 0);
}

/// Two corners' weights of a texel centre, from the corners' texel coordinates.
std::array<double, 2> barycentrics(const std::array<std::array<double, 2>, 3>& c, double x,
                                   double y) {
  const double x1 = c[1][0] - c[0][0], y1 = c[1][1] - c[0][1];
  const double x2 = c[2][0] - c[0][0], y2 = c[2][1] - c[0][1];
  const double dx = x - c[0][0], dy = y - c[0][1], area = x1 * y2 - y1 * x2;
  return {(dx * y2 - dy * x2) / area, (x1 * dy - y1 * dx) / area};
}

/// Reads one block of the rectangle; returns its texels, checked against the surface.
std::size_t check_block(Stranger in, std::int64_t block_x, std::int64_t block_y) {
  CHECK(in.u32() == 0);
  CHECK(in.i32() == block_x);
  CHECK(in.i32() == block_y);
  REQUIRE(in.u32() == 1);
  const std::uint32_t vertices = in.u32(), triangles = in.u32();
  const auto positions = floats(in.column(vertices, 3, 4));
  in.column(vertices, 3, 4);
  const auto uvs = floats(in.column(vertices, 2, 4));
  in.column(vertices, 4, 2);
  const auto corners = in.column(triangles, 3, 2);
  in.column(triangles, 1, 4);
  const std::uint32_t runs = in.u32();
  const auto lengths = in.column(runs, 1, 2, false), owners = in.column(runs, 1, 2);
  CHECK(in.left() == 0);
  std::size_t texels = 0, wrong = 0, at = 0;
  for (std::uint32_t r = 0; r < runs; ++r) {
    for (std::uint32_t k = 0; k <= lengths[r]; ++k, ++at) {
      if (owners[r] == 0xFFFF) continue;
      ++texels;
      std::array<std::array<double, 2>, 3> c;
      std::array<std::array<double, 2>, 3> p;
      for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t v = corners[owners[r] * 3 + i];
        c[i] = {double{uvs[2 * v]} * kWidth - 0.5, double{uvs[2 * v + 1]} * kHeight - 0.5};
        p[i] = {positions[3 * v], positions[3 * v + 1]};
      }
      const double x = static_cast<double>(block_x * 64 + static_cast<std::int64_t>(at % 64));
      const double y = static_cast<double>(block_y * 64 + static_cast<std::int64_t>(at / 64));
      const auto [w1, w2] = barycentrics(c, x, y);
      const double px = p[0][0] + w1 * (p[1][0] - p[0][0]) + w2 * (p[2][0] - p[0][0]);
      const double py = p[0][1] + w1 * (p[1][1] - p[0][1]) + w2 * (p[2][1] - p[0][1]);
      const bool inside = w1 > -1e-9 && w2 > -1e-9 && w1 + w2 < 1 + 1e-9;
      const double right_x = (x + 0.5) / kWidth * 2, right_y = 1 - (y + 0.5) / kHeight;
      if (!inside || std::abs(px - right_x) > 1e-6 || std::abs(py - right_y) > 1e-6) ++wrong;
    }
  }
  CHECK(at == 4096);
  CHECK(wrong == 0);
  return texels;
}

TEST_CASE("a stranger finds every covered texel in the target's pack", "[format]") {
  const Rectangle rectangle;
  const auto packs = rectangle.packs("geometry");
  REQUIRE(packs.size() == 2);  // the source's and the target's
  std::size_t covered = 0;
  for (const Bytes& pack : packs) {
    Stranger in = directory(pack);
    REQUIRE(in.u32() == 1);  // pages
    const std::uint32_t tiles = in.u32();
    CHECK(in.integer(8) == std::uint64_t{kWidth} * kHeight);
    for (int i = 0; i < 3 + 2 + 1 + 3; ++i) in.integer(8);  // counts, largest sizes, the box
    CHECK(in.u32() == kWidth);
    CHECK(in.u32() == kHeight);
    in.u32();
    for (int i = 0; i < 7; ++i) in.integer(8);  // transform, texels of the page
    for (std::uint32_t t = 0; t < tiles; ++t) {
      for (int i = 0; i < 6; ++i) in.f32();
      Stranger index = payload(pack, place(in));
      for (std::uint32_t left = in.u32(); left > 0; --left) {
        index.u32();
        const std::int32_t x = index.i32(), y = index.i32();
        index.u32();
        const bool is_target = index.u32() == 0;  // no patches
        const std::uint32_t texels = index.u32();
        const Place block = place(index);
        for (std::uint32_t i = index.u32() * 6; i > 0; --i) index.f32();
        if (!is_target) continue;
        CHECK(check_block(payload(pack, block), x, y) == texels);
        covered += texels;
      }
      CHECK(index.left() == 0);
    }
    CHECK(in.left() == 0);
  }
  CHECK(covered == std::size_t{kWidth} * kHeight);
}

}  // namespace
}  // namespace pounce
