// SPDX-License-Identifier: Apache-2.0
#include "io/codec/row_encoder.h"

#include <algorithm>

#include "io/codec/sample.h"
#include "mesh/lattice.h"

namespace pounce::io {

std::uint64_t row_bytes_of(const ImageWriteSpec& spec) {
  return std::uint64_t{spec.width} * spec.channels * sample_bytes(spec.depth);
}

std::uint32_t strip_rows(const ImageWriteSpec& spec) {
  const std::uint64_t rows = (64U << 10) / std::max<std::uint64_t>(1, row_bytes_of(spec));
  return static_cast<std::uint32_t>(std::clamp<std::uint64_t>(rows, 1, spec.height));
}

std::uint32_t across_tiles(const ImageWriteSpec& spec) {
  return (spec.width + spec.layout.tile_size - 1) / spec.layout.tile_size;
}

std::uint64_t tiled_texels(const ImageWriteSpec& spec) {
  const std::uint64_t edge = spec.layout.tile_size;
  std::uint64_t tiles = 0;
  for (ImageSize size{spec.width, spec.height};; size = mesh::next_level_size(size)) {
    tiles += ((size.width + edge - 1) / edge) * ((size.height + edge - 1) / edge);
    if (!spec.layout.mipmap || size == ImageSize{1, 1}) return tiles * edge * edge;
  }
}

}  // namespace pounce::io
