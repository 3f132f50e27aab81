// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "store/blocks/colour_store.h"

namespace pounce::shading {

/// The last level of an image: it fits into a few texels.
std::uint32_t last_level(const store::ColourDirectory& image);
/// What a level says of itself before it is made.
store::ColourDirectory level_of(const store::ColourDirectory& image, std::uint32_t level);

/// How the texels of a level's row (or column) come from those of the level before: texel i is the
/// mean of `count` texels from `first` on, weighted.
struct LevelSpan {
  std::uint32_t first = 0, count = 0;
  std::array<std::uint32_t, 3> weights{};
};
/// `size` texels become (size + 1) / 2 of equal width. The weights of each are `level_total(size)`.
LevelSpan level_span(std::uint32_t i, std::uint32_t size);
std::uint32_t level_total(std::uint32_t size);

/// The texels of a tile's row (or column) of a level, apron included, in the level before.
struct LevelAxis {
  struct Texel {
    std::uint32_t tile = 0;  ///< of the level before
    LevelSpan span;          ///< `first` within that tile, apron included
    bool used = false;       ///< false: beyond what any blend reads
  };
  std::array<Texel, store::kColourTileEdge> texels;
  std::vector<std::uint32_t> tiles;  ///< each once
  std::uint32_t total = 0;

  /// `size`: of the level before, along this axis.
  LevelAxis(std::uint32_t tile, std::uint32_t size, mesh::Wrap wrap);
};

/// Fills the texels of a level's tile that lie over one tile of the level before, `tile_x` and
/// `tile_y`. `image`: the level.
void fill_level_tile(const store::ColourDirectory& image, const store::ColourTile& before,
                     std::uint32_t tile_x, std::uint32_t tile_y, const LevelAxis& columns,
                     const LevelAxis& rows, std::span<std::byte> tile);

}  // namespace pounce::shading
