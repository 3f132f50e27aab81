// SPDX-License-Identifier: Apache-2.0
#include <OpenImageIO/imageio.h>
#include <webp/encode.h>

#include <array>
#include <catch2/catch.hpp>

#include "io/codec/sample.h"
#include "io/image/write.h"
#include "support/resident_memory.h"
#include "support/test_data.h"
#include "unit/io/image_files.h"

using namespace pounce;
using test::peak_rss;
using test::reset_peak_rss;

namespace {

constexpr std::uint32_t kSide = 4096;

io::ImageWriteSpec spec_of(Depth depth, std::uint32_t side, std::uint32_t tile_size) {
  io::ImageWriteSpec spec{side, side, 3, depth, false, false};
  spec.layout.tile_size = tile_size;
  return spec;
}

void write_stripes(const std::string& path, Depth depth, std::uint32_t side,
                   std::uint32_t tile_size = 0) {
  const io::ImageWriteSpec spec = spec_of(depth, side, tile_size);
  std::vector<std::byte> row(std::size_t{side} * 3 * io::sample_bytes(depth));
  io::ImageWriter writer(path, spec);
  for (std::uint32_t y = 0; y < side; ++y) {
    for (std::size_t i = 0; i < row.size(); ++i) row[i] = static_cast<std::byte>((i * 7 + y) % 61);
    writer.write_rows(1, row.data());
  }
  writer.commit();
}

/// Decoded in this process, which is what is measured.
const ImageTrust kHere{{ImageFormat::tga}, Sandbox::off};

void read_in_strips(const std::string& path) {
  io::ImageReader reader(path, kHere);
  std::vector<std::byte> strip(reader.row_bytes() * 16);
  for (std::uint32_t y = 0; y < reader.info().height; y += 16) {
    reader.read_rows(std::min(16U, reader.info().height - y), strip.data());
  }
}

}  // namespace

TEST_CASE("a large image is written and read in the memory that was announced", "[image][memory]") {
  const auto [ending, depth, tile_size] =
      GENERATE(table<std::string, Depth, std::uint32_t>({{".png", Depth::u8, 0},
                                                         {".jpg", Depth::u8, 0},
                                                         {".tif", Depth::u16, 0},
                                                         {".exr", Depth::half, 0},
                                                         {".tif", Depth::u8, 64},
                                                         {".tif", Depth::u16, 16},
                                                         {".exr", Depth::half, 64}}));
  CAPTURE(ending, tile_size);
  test::TempFolder folder;
  // A small one first, for what the libraries load and keep.
  write_stripes(folder.file("small" + ending), depth, 64, tile_size);
  read_in_strips(folder.file("small" + ending));

  const std::string path = folder.file("large" + ending);
  const std::uint64_t row = std::uint64_t{kSide} * 3 * io::sample_bytes(depth);
  const std::uint64_t slack = 512 << 10;
  const std::uint64_t before_write = reset_peak_rss();
  write_stripes(path, depth, kSide, tile_size);
  const std::uint64_t encoder =
      io::ImageWriter::encoder_bytes(path, spec_of(depth, kSide, tile_size));
  CHECK(peak_rss() <= before_write + encoder + row + slack);
  CHECK(encoder < ((tile_size == 0 ? 4U : 8U) << 20));

  const std::uint64_t before_read = reset_peak_rss();
  read_in_strips(path);
  const std::uint64_t decoder = io::ImageReader(path, kHere).info().decoder_bytes;
  CHECK(peak_rss() <= before_read + decoder + 16 * row + slack);
  CHECK(decoder < (8U << 20));
}

TEST_CASE("a file in one huge strip or decoded whole stays within what it announces",
          "[image][memory]") {
  test::TempFolder folder;
  const auto [name, attribute, value] =
      GENERATE(table<std::string, std::string, int>({{"strip.tif", "tiff:RowsPerStrip", int{kSide}},
                                                     {"progressive.jpg", "jpeg:progressive", 1},
                                                     {"a.tga", "none", 0}}));
  CAPTURE(name);
  const std::string path = folder.file(name);
  {
    OIIO::ImageSpec spec(kSide, kSide, 3, OIIO::TypeDesc::UINT8);
    spec.attribute(attribute, value);
    auto output = OIIO::ImageOutput::create(path);
    REQUIRE(output->open(path, spec));
    std::vector<std::uint8_t> row(std::size_t{kSide} * 3);
    for (int y = 0; y < static_cast<int>(kSide); ++y) {
      for (std::size_t i = 0; i < row.size(); ++i)
        row[i] = static_cast<std::uint8_t>((i * i + static_cast<unsigned>(y) * 31) >> 5);
      REQUIRE(output->write_scanline(y, 0, OIIO::TypeDesc::UINT8, row.data()));
    }
    REQUIRE(output->close());
  }
  const std::uint64_t before = reset_peak_rss();
  read_in_strips(path);
  CHECK(peak_rss() <=
        before + io::ImageReader(path, kHere).info().decoder_bytes + 16 * kSide * 3 + (512 << 10));
}

TEST_CASE("a WebP decodes in the memory that it announces", "[image][memory]") {
  constexpr int kWebpSide = 2048;
  const test::TempFolder folder;
  std::vector<std::uint8_t> texels(std::size_t{kWebpSide} * kWebpSide * 3);
  for (std::size_t i = 0; i < texels.size(); ++i)
    texels[i] = static_cast<std::uint8_t>((i * i + i / 777) >> 7 & 0xF0);
  const bool lossless = GENERATE(true, false);
  CAPTURE(lossless);
  const std::string path = folder.file("a.webp");
  {
    std::uint8_t* encoded = nullptr;
    const std::size_t size =
        lossless
            ? ::WebPEncodeLosslessRGB(texels.data(), kWebpSide, kWebpSide, 3 * kWebpSide, &encoded)
            : ::WebPEncodeRGB(texels.data(), kWebpSide, kWebpSide, 3 * kWebpSide, 50, &encoded);
    REQUIRE(size > 0);
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(encoded), static_cast<std::streamsize>(size));
    ::WebPFree(encoded);
  }
  texels = {};
  const std::uint64_t announced = io::ImageReader(path, kHere).info().decoder_bytes;
  const std::uint64_t before = reset_peak_rss();
  read_in_strips(path);
  CHECK(peak_rss() <= before + announced + 16 * kWebpSide * 3 + (512 << 10));
}
