// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <webp/decode.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/file.h"
#include "io/splats/vp8l.h"
#include "support/memory_file_system.h"

namespace pounce::test {

/// Pixels as red, green, blue, alpha.
struct Rgba {
  std::uint32_t width = 0, height = 0;
  std::vector<std::uint8_t> bytes;
  bool operator==(const Rgba&) const = default;
  /// red << 24 | green << 16 | blue << 8 | alpha
  std::uint32_t at(std::uint32_t x, std::uint32_t y) const {
    std::uint32_t pixel = 0;
    for (std::size_t c = 0; c < 4; ++c) pixel = pixel << 8 | bytes[4 * (y * width + x) + c];
    return pixel;
  }
};

/// What the project's decoder makes of `count` bytes of a file.
inline Rgba decode(const ReadFile& file, std::uint64_t at, std::uint64_t count,
                   const std::string& name, WriteFile& scratch) {
  const io::Vp8lHeader header = io::read_vp8l_header(file, at, count, name);
  io::Vp8lDecoder decoder(file, header, name, scratch);
  Rgba image{header.width, header.height, {}};
  image.bytes.resize(std::size_t{4} * header.width * header.height);
  for (std::size_t y = 0, row = std::size_t{4} * header.width; y < header.height; ++y)
    decoder.read_row(std::span(image.bytes).subspan(y * row, row));
  return image;
}

inline Rgba decode(const std::string& bytes) {
  const auto files = test::make_memory_file_system();
  files->create("a.webp")->append(std::as_bytes(std::span(bytes)));
  const auto scratch = files->create_scratch("/");
  return decode(*files->open("a.webp"), 0, bytes.size(), "a.webp", *scratch);
}

/// What libwebp makes of it, if it is content with it.
inline std::optional<Rgba> decode_by_libwebp(const std::string& bytes) {
  int width = 0, height = 0;
  std::uint8_t* const pixels = WebPDecodeRGBA(reinterpret_cast<const std::uint8_t*>(bytes.data()),
                                              bytes.size(), &width, &height);
  if (pixels == nullptr) return std::nullopt;
  Rgba image{static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height), {}};
  image.bytes.assign(pixels, pixels + std::size_t{4} * image.width * image.height);
  WebPFree(pixels);
  return image;
}

}  // namespace pounce::test
