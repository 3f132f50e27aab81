// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "io/image/read.h"
#include "mesh/mesh.h"

namespace pounce::test {

inline std::string read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

inline void write_file(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

inline mesh::ImageRef in_memory(const std::string& bytes, const std::string& label = "the image") {
  mesh::ImageRef image;
  auto copy = std::make_shared<std::vector<std::byte>>(bytes.size());
  if (!bytes.empty()) std::memcpy(copy->data(), bytes.data(), bytes.size());
  image.bytes = copy;
  image.label = label;
  return image;
}

/// All samples, read in strips of `strip` rows.
inline std::vector<std::uint8_t> read_all(const mesh::ImageRef& image,
                                          std::uint32_t strip = 1000000,
                                          const std::vector<ImageFormat>& allowed = {},
                                          Sandbox sandbox = Sandbox::automatic) {
  io::ImageReader reader(image, {allowed, sandbox});
  std::vector<std::uint8_t> samples(reader.row_bytes() * reader.info().height);
  for (std::uint32_t y = 0; y < reader.info().height;) {
    const std::uint32_t rows = std::min(strip, reader.info().height - y);
    reader.read_rows(rows, reinterpret_cast<std::byte*>(samples.data()) + y * reader.row_bytes());
    y += rows;
  }
  return samples;
}

inline mesh::ImageRef at_path(const std::string& path) {
  mesh::ImageRef image;
  image.path = path;
  image.label = path;
  return image;
}

/// A PNG made by hand: stored (uncompressed) deflate blocks. `packed_rows` are the filter byte and
/// samples of each row of each pass, as the PNG specification orders them.
inline std::string make_png(std::uint32_t width, std::uint32_t height, int bits, int colour_type,
                            bool interlaced, const std::string& packed_rows,
                            const std::string& palette = "", const std::string& transparency = "") {
  const auto big = [](std::uint32_t n) {
    return std::string{static_cast<char>(n >> 24), static_cast<char>(n >> 16),
                       static_cast<char>(n >> 8), static_cast<char>(n)};
  };
  const auto chunk = [&](const std::string& type, const std::string& data) {
    std::uint32_t crc = 0xFFFFFFFFU;
    for (const char c : type + data) {
      crc ^= static_cast<std::uint8_t>(c);
      for (int bit = 0; bit < 8; ++bit) crc = (crc & 1U) != 0 ? 0xEDB88320U ^ (crc >> 1) : crc >> 1;
    }
    return big(static_cast<std::uint32_t>(data.size())) + type + data + big(~crc);
  };
  std::uint32_t a = 1, b = 0;
  for (const char c : packed_rows) {
    a = (a + static_cast<std::uint8_t>(c)) % 65521;
    b = (b + a) % 65521;
  }
  const auto size = static_cast<std::uint16_t>(packed_rows.size());
  std::string deflated = "\x78\x01\x01";
  deflated += {static_cast<char>(size & 255), static_cast<char>(size >> 8),
               static_cast<char>(~size & 255), static_cast<char>((~size >> 8) & 255)};
  deflated += packed_rows + big((b << 16) | a);
  std::string header = big(width) + big(height);
  header += {static_cast<char>(bits), static_cast<char>(colour_type), 0, 0,
             static_cast<char>(interlaced ? 1 : 0)};
  return std::string("\x89PNG\r\n\x1a\n", 8) + chunk("IHDR", header) +
         (palette.empty() ? "" : chunk("PLTE", palette)) +
         (transparency.empty() ? "" : chunk("tRNS", transparency)) + chunk("IDAT", deflated) +
         chunk("IEND", "");
}

}  // namespace pounce::test
