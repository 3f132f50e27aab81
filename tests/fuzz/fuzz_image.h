// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "fuzz/fuzz_support.h"
#include "io/files/asset_file.h"
#include "io/image/colour_tags.h"
#include "io/image/guard.h"
#include "io/image/header.h"
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

/// What ImageReader does with an image before a foreign decoder sees any of it.
inline void guard_image(const mesh::ImageRef& image) {
  io::ByteSource source(image);
  constexpr std::array kAllowed{ImageFormat::bmp, ImageFormat::tga};
  const std::string format = io::image_format(source, image.path, kAllowed);
  const std::uint64_t stored = source.size_bytes();
  if (format == "tiff") {
    std::vector<io::ColourPiece> colours;
    io::guard_tiff(source, colours);
    io::read_colour_tags(colours);
  } else if (format == "openexr") {
    io::guard_exr(source);
  } else {
    io::read_colour_tags(io::hide_metadata(source, format));
  }
  // The last field of a TIFF's directory and what follows it may be cut off. Behind a Targa's
  // texels zeros stand where some have a footer.
  const std::uint64_t beyond = format == "targa" ? 26 : 16;
  require(source.size_bytes() <= stored + beyond, "nothing is shown that is not there");
  const std::vector<std::byte> shown = seen(source, 4096);
  if (shown.size() < 20000) require(shown == seen(source, 7), "it can be read in any pieces");
  if (format == "png") {
    io::is_interlaced_png(source);
    io::PngCheck whole, pieces;
    whole.see(0, shown.data(), shown.size());
    for (std::size_t at = 0; at < shown.size(); at += 5)
      pieces.see(at, shown.data() + at, std::min<std::size_t>(5, shown.size() - at));
    require(whole.finished() == pieces.finished() && whole.problem() == pieces.problem(),
            "a PNG is judged alike in any pieces");
  }
  // What was hidden once stays hidden, and nothing else goes.
  if (!shown.empty()) {
    attempt([&] {
      io::ByteSource again(in_memory(shown, image.path));
      if (io::image_format(again, image.path, kAllowed) != format) return;
      std::vector<io::ColourPiece> colours;
      if (format == "tiff") io::guard_tiff(again, colours);
      if (format == "openexr") io::guard_exr(again);
      io::hide_metadata(again, format);
      if (format == "png" || format == "jpeg" || format == "webp")
        require(seen(again, 4096) == shown, "hiding twice is hiding once");
    });
  }
  if (format == "pnm") {
    io::PnmPicture picture(source);
    const std::uint64_t row = std::uint64_t{picture.width()} * picture.channels() *
                              (picture.depth() == Depth::u8 ? 1 : 2);
    if (row < 20000) {
      std::vector<std::byte> last(row);
      picture.read_rows(picture.height() - 1, 1, last.data());
    }
  }
  if (format == "jpeg") io::read_jpeg_header(source);
  if (io::opens_whole(source, format)) io::read_whole_header(source, format);
}

}  // namespace pounce::fuzz
