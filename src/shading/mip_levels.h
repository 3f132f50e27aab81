// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/page_pool.h"
#include "pounce/options.h"
#include "store/blocks/colour_store.h"

namespace pounce::shading {

/// Levels of an image, itself included, down to 1 x 1.
std::uint32_t level_count(ImageSize size);

/// The smaller levels of an image, made while its rows go by from top to bottom: of each level two
/// rows are held. A texel is the mean of the four below it, or, where a side is odd, what a linear
/// filter finds there. Samples are averaged as they are coded, in single precision; each level is
/// made of the one before as it was before rounding. Not thread-safe.
class MipLevels {
 public:
  /// Takes a finished row of a level (1 is the first that is made), in the image's depth.
  using Take = std::function<void(std::uint32_t level, const std::byte* row)>;

  MipLevels(ImageSize size, std::uint32_t channels, Depth depth);
  /// The next rows of the image. Rows of a level come in order; those of all levels mix.
  void push(std::uint32_t rows, const std::byte* samples, const Take& take);
  static std::uint64_t memory_bytes(ImageSize size, std::uint32_t channels);

 private:
  struct Level {
    ImageSize from, size;            ///< of the level before, and its own
    std::uint32_t next_row = 0;      ///< to be made
    PageVector<float> above, below;  ///< rows of the level before, at this one's width
  };

  void accept(std::size_t level, std::uint32_t row, const float* samples, const Take& take);
  void narrow(const Level& level, const float* samples, float* out) const;
  void finish(std::size_t level, const Take& take);

  const ImageSize size_;
  const std::uint32_t channels_;
  const Depth depth_;
  std::uint32_t next_row_ = 0;
  std::vector<Level> levels_;  ///< from 1
  PageVector<float> row_;
  PageVector<std::byte> encoded_;
};

// --- levels of stored images ---------------------------------------------------------------------

/// The last level of an image: it fits into a few texels.
std::uint32_t last_level(const store::ColourDirectory& image);
/// What a level says of itself before it is made.
store::ColourDirectory level_of(const store::ColourDirectory& image, std::uint32_t level);

/// Of integer samples of the level before: the mean of two rows, two by two texels, `count` of
/// them; what levels of images with even sides are made of.
void mean_of_fours(const store::ColourDirectory& image, const std::byte* above,
                   const std::byte* below, std::size_t count, std::byte* out) noexcept;
/// Are those the texels of every level up to this one?
bool is_halved_evenly(const store::ColourDirectory& image, std::uint32_t level);

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
