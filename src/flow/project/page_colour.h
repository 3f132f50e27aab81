// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <optional>

#include "flow/stores/block_readers.h"
#include "mesh/uv_tiles.h"
#include "projection/blend.h"
#include "projection/footprint.h"
#include "shading/mip_levels.h"
#include "shading/result_block.h"
#include "shading/texel_input.h"
#include "store/blocks/colour_store.h"

namespace pounce::flow {

/// The UDIM tiles of a source texture; which image a hit means is found when it is blended. Blends
/// do not reach across a tile's border: every image is clamped, as renderers do.
struct TileColumns {
  struct Tile {
    const ColourCache* column = nullptr;
    std::optional<shading::ColourInput> input;  ///< for its texels
  };
  std::map<mesh::UvTile, Tile> tiles;
};

/// What one source page gives to one channel.
struct PageColour {
  /// Where hits on the page lie: texel coordinates of an image of this size, or of a row of UDIM
  /// tiles that each have it. Channels whose images differ in size share a search, so a hit means a
  /// place of the image in proportion.
  ImageSize lattice;
  const ColourCache* column = nullptr;
  const TileColumns* tile_set = nullptr;  ///< null as well as column: a constant
  shading::TexelValue constant;
  std::optional<shading::ColourInput> input;  ///< for the texels of the column, or the constant
  std::optional<shading::Factor> factor;      ///< for what is blended of the images
  bool tinted = false;                        ///< by the colours of the source's vertices
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
  const store::ColourDirectory* image = nullptr;
  const std::byte* tile = nullptr;  ///< decoded
  int column = 0, row = 0;          ///< in the tile, apron excluded
  double rest_x = 0, rest_y = 0;
  const shading::ColourInput* input = nullptr;  ///< for the image's texels; null: none is needed
};

/// What the colour of a vertex makes of a base colour.
inline shading::Factor vertex_factor(const std::array<double, 4>& colour) noexcept {
  const bool is_grey = colour[0] == colour[1] && colour[1] == colour[2];
  return {colour, {}, true, !is_grey};
}

/// What a page without image gives.
inline shading::TexelValue constant_value(const PageColour& page, const shading::Factor* tint,
                                          const shading::TexelFormat& format) noexcept {
  shading::TexelValue value = page.constant;
  if (tint != nullptr) shading::apply(*tint, format, value);
  if (tint != nullptr && page.input && page.input->primaries)
    shading::convert(*page.input->primaries, value);
  return value;
}

/// What an image of a page holds, `samples`, on its way into `format`: times the material's factor
/// and the vertices' colour, in the output's primaries. Colours that the image holds times alpha
/// stay so where `as_stored`.
inline shading::TexelValue value_of(const PageColour& page, const store::ColourDirectory& image,
                                    const shading::ColourInput* input,
                                    const projection::Blended& samples, bool as_stored,
                                    const shading::TexelFormat& format,
                                    const shading::Factor* tint = nullptr) noexcept {
  shading::TexelValue value{samples, image.channels, image.linear, image.has_alpha, as_stored};
  if (input != nullptr) shading::enter(*input, value);
  if (page.factor) shading::apply(*page.factor, format, value);
  if (tint != nullptr) shading::apply(*tint, format, value);
  if (input != nullptr && input->primaries) shading::convert(*input->primaries, value);
  return value;
}

/// Do colours that an image holds times alpha stay so on their way into `format`?
inline bool stays_premultiplied(const store::ColourDirectory& image,
                                const shading::ColourInput* input,
                                const shading::TexelFormat& format) noexcept {
  return format.premultiplied && image.premultiplied &&
         (input != nullptr ? input->linear : image.linear);
}

/// The channels of an image at a place, as it holds them.
inline projection::Blended samples_at(const ColourPlace& at, const projection::Taps& taps,
                                      bool as_stored) noexcept {
  return projection::blend(
      *at.image, at.tile, at.column, at.row, taps,
      as_stored ? projection::BlendAlpha::stored : projection::BlendAlpha::straight);
}

/// The blended value at a place of a page.
inline shading::TexelValue blended(const PageColour& page, const ColourPlace& at,
                                   const projection::Taps& taps, const shading::TexelFormat& format,
                                   const shading::Factor* tint = nullptr) noexcept {
  const bool as_stored = stays_premultiplied(*at.image, at.input, format);
  return value_of(page, *at.image, at.input, samples_at(at, taps, as_stored), as_stored, format,
                  tint);
}

/// The image of a page, or of a tile of its set.
struct ColourImage {
  const ColourCache* column = nullptr;          ///< null: a UDIM tile without image
  const shading::ColourInput* input = nullptr;  ///< for the image's texels; null: none is needed

  const store::ColourDirectory& directory() const { return column->store().directory(); }
};

/// Texels of an image per texel of a page, each way.
inline Vec2d scale_of(ImageSize lattice, const store::ColourDirectory& image) noexcept {
  return {static_cast<double>(image.width) / lattice.width,
          static_cast<double>(image.height) / lattice.height};
}

/// Whether places on a page of this lattice are the image's texels.
inline bool is_of_size(const store::ColourDirectory& image, ImageSize lattice) noexcept {
  return lattice.width == image.width && lattice.height == image.height;
}

/// A place of a page in its image, not wrapped.
inline Vec2d middle_of(const PagePlace& at, ImageSize lattice, const store::ColourDirectory& image,
                       Vec2d scale) noexcept {
  const Vec2d on_page{static_cast<double>(at.base_x) + at.frac_x,
                      static_cast<double>(at.base_y) + at.frac_y};
  if (is_of_size(image, lattice)) return on_page;
  return {(on_page.x + 0.5) * scale.x - 0.5, (on_page.y + 0.5) * scale.y - 0.5};
}

/// The same as the image wraps; `middle` is not.
struct WrappedPlace {
  projection::Coordinate x, y;
};
inline WrappedPlace wrapped_in(const store::ColourDirectory& image, ImageSize lattice,
                               const PagePlace& at, Vec2d middle) noexcept {
  if (is_of_size(image, lattice)) {
    return {projection::placed(at.base_x, at.frac_x, image.width, image.wrap_u),
            projection::placed(at.base_y, at.frac_y, image.height, image.wrap_v)};
  }
  return {projection::placed(middle.x, image.width, image.wrap_u),
          projection::placed(middle.y, image.height, image.wrap_v)};
}

/// A place in it.
struct PageImage : ColourImage {
  mesh::UvTile tile{};              ///< where the page has a set of them
  projection::Coordinate x{}, y{};  ///< in the image, as it wraps
  Vec2d middle{};                   ///< the same, not wrapped
  Vec2d scale{1, 1};                ///< texels of the image per texel of the page

  /// What a footprint on the page is in the image.
  projection::Footprint on_image(projection::Footprint footprint) const {
    for (Vec2d* side : {&footprint.a, &footprint.b}) *side = {side->x * scale.x, side->y * scale.y};
    return footprint;
  }
  /// How a footprint on the page is averaged.
  projection::FootprintLookups lookups(const projection::Footprint& footprint) const {
    return projection::lookups_of(on_image(footprint), shading::last_level(directory()));
  }
};

inline PageImage image_at(const ColourCache& column,
                          const std::optional<shading::ColourInput>& input, ImageSize lattice,
                          const PagePlace& at) {
  const store::ColourDirectory& image = column.store().directory();
  PageImage out;
  out.column = &column;
  out.input = input ? &*input : nullptr;
  out.scale = scale_of(lattice, image);
  out.middle = middle_of(at, lattice, image, out.scale);
  const WrappedPlace wrapped = wrapped_in(image, lattice, at, out.middle);
  out.x = wrapped.x;
  out.y = wrapped.y;
  return out;
}

inline ColourImage image_in(const TileColumns& set, mesh::UvTile tile) {
  const auto found = set.tiles.find(tile);
  if (found == set.tiles.end()) return {};
  const auto& [column, input] = found->second;
  return {column, input ? &*input : nullptr};
}

inline PageImage image_at(const TileColumns& set, ImageSize lattice, const PagePlace& at) {
  const projection::TileCoordinate x = projection::in_tile(at.base_x, at.frac_x, lattice.width);
  const projection::TileCoordinate y = projection::in_tile(at.base_y, at.frac_y, lattice.height);
  PageImage out;
  out.tile = mesh::tile_of_period(x.period, y.period);
  static_cast<ColourImage&>(out) = image_in(set, out.tile);
  if (out.column == nullptr) return out;
  const store::ColourDirectory& image = out.directory();
  out.x = projection::scaled(x.texel, lattice.width, image.width);
  out.y = projection::scaled(y.texel, lattice.height, image.height);
  out.scale = scale_of(lattice, image);
  out.middle = {(x.texel + 0.5) * out.scale.x - 0.5, (y.texel + 0.5) * out.scale.y - 0.5};
  return out;
}

inline bool is_constant(const PageColour& page) {
  return page.column == nullptr && page.tile_set == nullptr;
}

/// Of a page that is no constant.
inline PageImage image_at(const PageColour& page, const PagePlace& at) {
  return page.column != nullptr ? image_at(*page.column, page.input, page.lattice, at)
                                : image_at(*page.tile_set, page.lattice, at);
}

/// Finds colours of pages that are no constants, and keeps the tiles that it used just now:
/// neighbouring places mostly want the same one. One per thread.
class ColourWindow {
 public:
  static constexpr std::size_t kTiles = 8;

  /// One lookup in an image. Valid until kTiles other tiles were asked for.
  ColourPlace find(const PageImage& at) { return place(*at.column, at.x, at.y, at.input); }

  /// The mean of such lookups, taken of what the image holds: what one lookup is on its way into
  /// `format`, their mean is. They stay in the UDIM tile that holds the middle. `levels` are of the
  /// page's columns.
  shading::TexelValue average(const PageColour& page, const PageImage& image,
                              const projection::FootprintLookups& lookups,
                              projection::BlendKernel kernel, const shading::TexelFormat& format,
                              ColourLevels& levels, const shading::Factor* tint = nullptr) {
    const bool as_stored = stays_premultiplied(image.directory(), image.input, format);
    projection::Blended mean{};
    for (int s = 0; s < lookups.count; ++s) {
      const projection::Lookups& set = lookups.sets[static_cast<std::size_t>(s)];
      const ColourCache& level =
          set.level == 0 ? *image.column : levels.get(*image.column, set.level);
      const double share = set.share / (set.count_a * set.count_b);
      for (int a = 0; a < set.count_a; ++a) {
        for (int b = 0; b < set.count_b; ++b) {
          const double i = a - 0.5 * (set.count_a - 1), j = b - 0.5 * (set.count_b - 1);
          const ColourPlace at =
              at_level(image, level, image.middle.x + (i * set.step_a.x + j * set.step_b.x),
                       image.middle.y + (i * set.step_a.y + j * set.step_b.y));
          projection::Taps taps;
          kernel(at.rest_x, at.rest_y, taps);
          if (set.level == 0) projection::sharpen(lookups.sharpening, at.rest_x, at.rest_y, taps);
          const projection::Blended samples = samples_at(at, taps, as_stored);
          for (std::size_t c = 0; c < mean.size(); ++c) mean[c] += share * samples[c];
        }
      }
    }
    return value_of(page, image.directory(), image.input, mean, as_stored, format, tint);
  }

  /// A decoded tile of a column. Valid as long as what find() gives.
  const std::byte* tile(const ColourCache& column, std::uint32_t x, std::uint32_t y) {
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

 private:
  /// Where a place of an image lies in one of its levels.
  ColourPlace at_level(const PageImage& of, const ColourCache& level, double x, double y) {
    const store::ColourDirectory& image = of.directory();
    const store::ColourDirectory& smaller = level.store().directory();
    const auto in = [&](double texel, std::uint32_t size, std::uint32_t level_size,
                        mesh::Wrap wrap) {
      if (size != level_size) texel = (texel + 0.5) * level_size / size - 0.5;
      return projection::placed(texel, level_size, wrap);
    };
    return place(level, in(x, image.width, smaller.width, image.wrap_u),
                 in(y, image.height, smaller.height, image.wrap_v), of.input);
  }

  ColourPlace place(const ColourCache& column, const projection::Coordinate& x,
                    const projection::Coordinate& y, const shading::ColourInput* input) {
    // Texel -1 belongs to the first tile's apron.
    const std::int32_t tile_x = std::max(x.texel, 0) / mesh::kBlockEdge,
                       tile_y = std::max(y.texel, 0) / mesh::kBlockEdge;
    const store::ColourDirectory& image = column.store().directory();
    const bool floats = store::is_float(image.depth);
    return {&image,
            tile(column, static_cast<std::uint32_t>(tile_x), static_cast<std::uint32_t>(tile_y)),
            x.texel - tile_x * mesh::kBlockEdge,
            y.texel - tile_y * mesh::kBlockEdge,
            floats ? projection::settled(x.rest) : x.rest,
            floats ? projection::settled(y.rest) : y.rest,
            input};
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
