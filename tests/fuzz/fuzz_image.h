// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "fuzz/fuzz_support.h"
#include "io/codec/colour_tags.h"
#include "io/codec/guard.h"
#include "io/files/asset_file.h"
#include "io/image/header.h"
#include "io/image/read.h"
#include "mesh/mesh.h"

namespace pounce::fuzz {

/// All that is seen of a source, read in pieces of that many bytes.
inline std::vector<std::byte> seen(io::ByteSource& source, std::size_t step) {
  std::vector<std::byte> all(source.size_bytes());
  for (std::size_t at = 0; at < all.size(); at += step) {
    const std::size_t wanted = std::min(step, all.size() - at);
    require(source.read_at(at, all.data() + at, wanted) == wanted, "what is shown can be read");
  }
  return all;
}

inline mesh::ImageRef in_memory(std::vector<std::byte> bytes, const std::string& path) {
  mesh::ImageRef image;
  image.label = image.path = path;
  image.bytes = std::make_shared<const std::vector<std::byte>>(std::move(bytes));
  return image;
}

/// What ImageReader does with an image before a row is asked for: what the libraries see of a TIFF
/// and an EXR, and their headers.
inline void guard_image(const mesh::ImageRef& image) {
  io::ByteSource source(image);
  constexpr std::array kAllowed{ImageFormat::bmp, ImageFormat::tga};
  const std::string format = io::image_format(source, image.path, kAllowed);
  if (format != "tiff" && format != "openexr") {
    const io::ImageReader reader(image, {{kAllowed.begin(), kAllowed.end()}, Sandbox::off});
    return;
  }
  const std::uint64_t stored = source.size_bytes();
  std::vector<io::ColourPiece> colours;
  if (format == "tiff") io::guard_tiff(source, colours);
  if (format == "openexr") io::guard_exr(source);
  io::read_colour_tags(colours);
  // The last field of a TIFF's directory and what follows it may be cut off.
  constexpr std::uint64_t kBeyond = 16;
  require(source.size_bytes() <= stored + kBeyond, "nothing is shown that is not there");
  const std::vector<std::byte> shown = seen(source, 4096);
  if (shown.size() < 20000) require(shown == seen(source, 7), "it can be read in any pieces");
}

}  // namespace pounce::fuzz
