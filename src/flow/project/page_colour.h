// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <optional>

#include "flow/project/source_readers.h"
#include "mesh/uv_tiles.h"
#include "projection/blend.h"
#include "store/blocks/colour_store.h"
#include "texture/colour_input.h"
#include "texture/factor.h"
#include "texture/result_block.h"

namespace pounce::flow {

/// The UDIM tiles of a source texture: the source is seen through one lattice of such tiles, each
/// `width` x `height`; which image a hit means is found when it is blended. Blends do not reach
/// across a tile's border: every image is clamped, as renderers do.
struct TileColumns {
  struct Tile {
    const ColourCache* column = nullptr;
    std::optional<texture::ColourInput> input;  ///< for its texels
  };
  std::uint32_t width = 0, height = 0;
  std::map<mesh::UvTile, Tile> tiles;
};

/// What one source page gives to one channel.
struct PageColour {
  const ColourCache* column = nullptr;
  const TileColumns* tile_set = nullptr;  ///< null as well as column: a constant
  texture::TexelValue constant;
  std::optional<texture::ColourInput> input;  ///< for the texels of the column
  std::optional<texture::Factor> factor;      ///< for what is blended of the images
};

/// The largest decoded colour tile that a page may ask for; 0 for a constant.
inline std::uint64_t tile_bytes(const PageColour& page) {
  std::uint64_t largest = page.column != nullptr ? page.column->store().tile_bytes() : 0;
  if (page.tile_set != nullptr) {
    for (const auto& [number, tile] : page.tile_set->tiles)
      largest = std::max(largest, tile.column->store().tile_bytes());
  }
  return largest;
}

/// A place on a source page: whole texel coordinates, not wrapped, and the rest.
struct PagePlace {
  std::int32_t base_x = 0, base_y = 0;
  float frac_x = 0, frac_y = 0;
};

/// Where a place's colour is, ready to be blended.
struct ColourPlace {
  const store::ColourDirectory* image = nullptr;  ///< null: a UDIM tile without image
  const std::byte* tile = nullptr;                ///< decoded
  int column = 0, row = 0;                        ///< in the tile, apron excluded
  double rest_x = 0, rest_y = 0;
  const texture::ColourInput* input = nullptr;  ///< for the image's texels; null: none is needed
};

/// The blended value at a place of a page, on its way into `format`: what the image holds, times
/// the material's factor, in the output's primaries. Colours that the image holds times alpha stay
/// so where the format wants them so.
inline texture::TexelValue blended(const PageColour& page, const ColourPlace& at,
                                   const projection::Taps& taps,
                                   const texture::TexelFormat& format) noexcept {
  const bool is_linear = at.input != nullptr ? at.input->linear : at.image->linear;
  const bool as_stored = format.premultiplied && at.image->premultiplied && is_linear;
  texture::TexelValue value{projection::blend(*at.image, at.tile, at.column, at.row, taps,
                                              as_stored ? projection::BlendAlpha::stored
                                                        : projection::BlendAlpha::straight),
                            at.image->channels, is_linear, at.image->has_alpha, as_stored};
  if (page.factor) texture::apply(*page.factor, format, value);
  if (at.input != nullptr && at.input->primaries) texture::convert(*at.input->primaries, value);
  return value;
}

/// Finds colours of pages that are no constants, and keeps the tiles that it used just now:
/// neighbouring places mostly want the same one. One per thread.
class ColourWindow {
 public:
  static constexpr std::size_t kTiles = 8;

  /// Valid until kTiles other tiles were asked for.
  ColourPlace find(const PageColour& page, const PagePlace& at) {
    const InImage in = page.column != nullptr ? in_image(*page.column, page.input, at)
                                              : in_image(*page.tile_set, at);
    if (in.column == nullptr) return {};
    // Texel -1 belongs to the first tile's apron.
    const std::int32_t tile_x = std::max(in.x.texel, 0) / mesh::kBlockEdge,
                       tile_y = std::max(in.y.texel, 0) / mesh::kBlockEdge;
    const store::ColourDirectory& image = in.column->store().directory();
    const bool floats = image.depth == Depth::half || image.depth == Depth::float32;
    return {&image,
            get(*in.column, static_cast<std::uint32_t>(tile_x), static_cast<std::uint32_t>(tile_y)),
            in.x.texel - tile_x * mesh::kBlockEdge,
            in.y.texel - tile_y * mesh::kBlockEdge,
            floats ? projection::settled(in.x.rest) : in.x.rest,
            floats ? projection::settled(in.y.rest) : in.y.rest,
            in.input};
  }

 private:
  struct InImage {
    const ColourCache* column = nullptr;
    projection::Coordinate x, y;
    const texture::ColourInput* input = nullptr;
  };

  static InImage in_image(const ColourCache& column,
                          const std::optional<texture::ColourInput>& input, const PagePlace& at) {
    const store::ColourDirectory& image = column.store().directory();
    return {&column, projection::placed(at.base_x, at.frac_x, image.width, image.wrap_u),
            projection::placed(at.base_y, at.frac_y, image.height, image.wrap_v),
            input ? &*input : nullptr};
  }

  static InImage in_image(const TileColumns& set, const PagePlace& at) {
    const projection::TileCoordinate x = projection::in_tile(at.base_x, at.frac_x, set.width);
    const projection::TileCoordinate y = projection::in_tile(at.base_y, at.frac_y, set.height);
    const auto found = set.tiles.find(mesh::tile_of_period(x.period, y.period));
    if (found == set.tiles.end()) return {};
    const auto& [column, input] = found->second;
    const store::ColourDirectory& image = column->store().directory();
    return {column, projection::scaled(x.texel, set.width, image.width),
            projection::scaled(y.texel, set.height, image.height), input ? &*input : nullptr};
  }

  const std::byte* get(const ColourCache& column, std::uint32_t x, std::uint32_t y) {
    const auto holds = [&](const Slot& slot) {
      return slot.column == &column && slot.x == x && slot.y == y;
    };
    if (holds(slots_[last_])) return slots_[last_].tile->data();
    for (last_ = 0; last_ < slots_.size(); ++last_) {
      if (holds(slots_[last_])) return slots_[last_].tile->data();
    }
    last_ = next_++ % kTiles;
    Slot& slot = slots_[last_];
    slot.tile = column.block((*column.index(y))[x]);
    slot.column = &column;
    slot.x = x;
    slot.y = y;
    return slot.tile->data();
  }

  struct Slot {
    const ColourCache* column = nullptr;
    std::uint32_t x = 0, y = 0;
    std::shared_ptr<const store::ColourTile> tile;
  };
  std::array<Slot, kTiles> slots_;
  std::size_t last_ = 0;    ///< the slot used last
  std::uint64_t next_ = 0;  ///< counts replacements
};

}  // namespace pounce::flow
