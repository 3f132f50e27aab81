// SPDX-License-Identifier: Apache-2.0
//
// Smaller versions of images, for targets whose texels cover more than one texel of the source.
//
// A level is made from the tiles of the level before, tile by tile: no image is decoded again, and
// a handful of tiles is all that is in memory. Texel i of a level is the mean of the texels that
// lie under it, by area: two by two where the size is even, else up to three by three, so that a
// level covers the image from edge to edge and wraps as it does. A texel's span begins in one tile
// and ends in its apron at most.
#include "flow/stores/colour_levels.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <mutex>

#include "core/portable_math.h"

namespace pounce::flow {
namespace {

using mesh::kBlockEdge;
using store::kApron;
using store::kColourTileEdge;

constexpr std::uint32_t kSmallest = 8;  // texels: no level is made of an image that fits into it

/// The texels of a tile's row (or column), apron included, in the level before.
struct Axis {
  struct Texel {
    std::uint32_t tile = 0;  ///< of the level before
    LevelSpan span;          ///< `first` within that tile, apron included
    bool used = false;       ///< false: beyond what any blend reads
  };
  std::array<Texel, kColourTileEdge> texels;
  std::vector<std::uint32_t> tiles;  ///< each once
  std::uint32_t total = 0;

  Axis(std::uint32_t tile, std::uint32_t size, mesh::Wrap wrap) : total(level_total(size)) {
    const std::int64_t level_size = (size + 1) / 2;
    for (int i = 0; i < kColourTileEdge; ++i) {
      const std::int64_t at = std::int64_t{tile} * kBlockEdge + i - kApron;
      if (at >= level_size + kApron) continue;
      Texel& texel = texels[static_cast<std::size_t>(i)];
      texel.span =
          level_span(static_cast<std::uint32_t>(store::wrapped(at, level_size, wrap)), size);
      texel.tile = texel.span.first / kBlockEdge;
      texel.span.first = texel.span.first % kBlockEdge + kApron;
      texel.used = true;
      if (std::find(tiles.begin(), tiles.end(), texel.tile) == tiles.end())
        tiles.push_back(texel.tile);
    }
  }
};

/// A sum of whole samples over `total`, rounded to nearest, halves to even: means of means do not
/// drift.
std::uint64_t rounded_mean(std::uint64_t sum, std::uint64_t total) {
  const std::uint64_t mean = total == 4 ? sum / 4 : sum / total;  // no division in most images
  const std::uint64_t twice = 2 * (sum - mean * total);
  return mean + (twice > total || (twice == total && mean % 2 != 0) ? 1 : 0);
}

template <class Sample>
Sample read_sample(const std::byte* at) {
  Sample v;
  std::memcpy(&v, at, sizeof v);
  return v;
}

/// The mean of one channel under a texel; `from` is the first sample of its span.
void mean_sample(Depth depth, const std::byte* from, std::size_t texel, const Axis& columns,
                 const Axis& rows, const LevelSpan& across, const LevelSpan& down, std::byte* to) {
  const std::size_t row_bytes = kColourTileEdge * texel;
  const std::uint64_t total = std::uint64_t{columns.total} * rows.total;
  const auto sum = [&]<class Sum>(Sum zero, const auto& value) {
    Sum out = zero;
    for (std::uint32_t y = 0; y < down.count; ++y) {
      for (std::uint32_t x = 0; x < across.count; ++x) {
        const std::uint64_t weight = std::uint64_t{down.weights[y]} * across.weights[x];
        out += static_cast<Sum>(weight) * value(from + y * row_bytes + x * texel);
      }
    }
    return out;
  };
  if (depth == Depth::u8) {
    const std::uint64_t s = sum(
        std::uint64_t{0}, [](const std::byte* at) { return std::to_integer<std::uint64_t>(*at); });
    *to = static_cast<std::byte>(rounded_mean(s, total));
  } else if (depth == Depth::u16) {
    const std::uint64_t s = sum(std::uint64_t{0}, [](const std::byte* at) {
      return std::uint64_t{read_sample<std::uint16_t>(at)};
    });
    const auto v = static_cast<std::uint16_t>(rounded_mean(s, total));
    std::memcpy(to, &v, sizeof v);
  } else if (depth == Depth::half) {
    const double s = sum(0.0, [](const std::byte* at) {
      return static_cast<double>(half_to_float(read_sample<std::uint16_t>(at)));
    });
    const std::uint16_t v = float_to_half(static_cast<float>(s / static_cast<double>(total)));
    std::memcpy(to, &v, sizeof v);
  } else {
    const double s =
        sum(0.0, [](const std::byte* at) { return static_cast<double>(read_sample<float>(at)); });
    const auto v = static_cast<float>(s / static_cast<double>(total));
    std::memcpy(to, &v, sizeof v);
  }
}

/// Fills the texels of a level's tile that lie over one tile of the level before.
void fill_from(const store::ColourDirectory& image, const store::ColourTile& source,
               std::uint32_t tile_x, std::uint32_t tile_y, const Axis& columns, const Axis& rows,
               std::vector<std::byte>& tile) {
  const std::size_t texel = image.texel_bytes(), sample = store::depth_bytes(image.depth);
  for (std::size_t r = 0; r < rows.texels.size(); ++r) {
    const Axis::Texel& row = rows.texels[r];
    if (!row.used || row.tile != tile_y) continue;
    for (std::size_t c = 0; c < columns.texels.size(); ++c) {
      const Axis::Texel& column = columns.texels[c];
      if (!column.used || column.tile != tile_x) continue;
      const std::byte* const from =
          source.data() +
          (std::size_t{row.span.first} * kColourTileEdge + column.span.first) * texel;
      std::byte* const to = tile.data() + (r * kColourTileEdge + c) * texel;
      for (std::size_t channel = 0; channel < image.channels; ++channel) {
        mean_sample(image.depth, from + channel * sample, texel, columns, rows, column.span,
                    row.span, to + channel * sample);
      }
    }
  }
}

}  // namespace

std::uint32_t level_total(std::uint32_t size) { return size % 2 == 0 ? 2 : size; }

LevelSpan level_span(std::uint32_t i, std::uint32_t size) {
  if (size % 2 == 0) return {2 * i, 2, {1, 1, 0}};
  // In parts of a texel of which each has `level_size`, those of the level are `size` long.
  const std::uint64_t level_size = (std::uint64_t{size} + 1) / 2;
  const std::uint64_t begin = std::uint64_t{i} * size, end = begin + size;
  LevelSpan span;
  span.first = static_cast<std::uint32_t>(begin / level_size);
  for (std::uint64_t j = span.first; j * level_size < end; ++j) {
    const std::uint64_t from = std::max(begin, j * level_size),
                        to = std::min(end, (j + 1) * level_size);
    span.weights[span.count++] = static_cast<std::uint32_t>(to - from);
  }
  return span;
}

store::ColourDirectory level_of(const store::ColourDirectory& image, std::uint32_t level) {
  store::ColourDirectory out = image;
  for (; level > 0; --level) {
    out.width = (out.width + 1) / 2;
    out.height = (out.height + 1) / 2;
  }
  out.nonfinite = 0;
  out.row_pages.clear();
  return out;
}

std::uint32_t ColourLevels::last_level(const store::ColourDirectory& image) {
  std::uint32_t level = 0;
  for (std::uint32_t size = std::max(image.width, image.height); size > kSmallest;
       size = (size + 1) / 2)
    ++level;
  return level;
}

void ColourLevels::add(const ColourCache& column, const Hash128& key) {
  Levels& levels = images_[&column];
  levels.key = key;
  levels.made.resize(last_level(column.store().directory()));
}

const ColourCache& ColourLevels::get(const ColourCache& column, std::uint32_t level) {
  Levels& levels = images_.at(&column);
  if (levels.count.load(std::memory_order_acquire) < level) {
    const std::lock_guard lock(job_.making);
    for (std::uint32_t made = levels.count.load(); made < level; ++made) {
      levels.made[made] = make(made == 0 ? column : *levels.made[made - 1], levels.key, made + 1);
      levels.count.store(made + 1, std::memory_order_release);
    }
  }
  return *levels.made[level - 1];
}

std::unique_ptr<ColourCache> ColourLevels::make(const ColourCache& before, const Hash128& image_key,
                                                std::uint32_t level) {
  const store::ColourDirectory& source = before.store().directory();
  const store::ColourDirectory image = level_of(source, 1);
  Hasher hash;
  hash.add(std::string_view("colour level"));
  hash.add(store::kFormatVersion);
  hash.add(image_key.hi);
  hash.add(image_key.lo);
  hash.add(level);
  const Hash128 key = hash.digest();
  auto found =
      find_store(job_, store::PackKind::colour, key, [&](std::unique_ptr<store::PackReader> pack) {
        return std::make_unique<store::ColourStore>(std::move(pack), image, job_.compressor());
      });
  const bool cached = found != nullptr;
  if (!cached) {
    store::ColourStoreWriter writer(
        job_.stores->create(store::PackKind::colour, key,
                            fmt::format("level {}, {} x {}, {} x {}", level, image.width,
                                        image.height, image.channels, depth_name(image.depth))),
        image.tiles_y());
    std::vector<std::byte> tile(std::size_t{kColourTileEdge} * kColourTileEdge *
                                image.texel_bytes());
    std::vector<std::byte> raw, stored;
    for (std::uint32_t y = 0; y < image.tiles_y(); ++y) {
      const Axis rows(y, source.height, image.wrap_v);
      for (std::uint32_t x = 0; x < image.tiles_x(); ++x) {
        const Axis columns(x, source.width, image.wrap_u);
        std::fill(tile.begin(), tile.end(), std::byte{0});
        for (const std::uint32_t tile_y : rows.tiles) {
          const auto index = before.index(tile_y);
          for (const std::uint32_t tile_x : columns.tiles)
            fill_from(image, *before.block((*index)[tile_x]), tile_x, tile_y, columns, rows, tile);
        }
        store::filter_colours(image, tile, raw);
        job_.compressor().compress(raw, stored);
        writer.add_tile(stored, static_cast<std::uint32_t>(tile.size()));
      }
      writer.end_row(y, job_.compressor());
      job_.meter.advance(0);  // stops here if the caller asked to
    }
    found = std::make_unique<store::ColourStore>(
        job_.stores->publish(writer.finish(image, job_.compressor())), image, job_.compressor());
  }
  job_.count_store(found->pack(), cached);
  job_.report.source_store_bytes += found->pack().size_bytes();
  return std::make_unique<ColourCache>(job_.budget, ColourReader{&job_, std::move(found), nullptr});
}

}  // namespace pounce::flow
