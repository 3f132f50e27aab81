// SPDX-License-Identifier: Apache-2.0
//
// How the tiles of a smaller version of an image come from those of the level before.
//
// Texel i of a level is the mean of the texels that lie under it, by area: two by two where the
// size is even, else up to three by three, so that a level covers the image from edge to edge and
// wraps as it does. A texel's span begins in one tile and ends in its apron at most, so a tile of a
// level can be made from a handful of tiles, one after the other.
//
// Levels are made when a texel first asks for one: a target as fine as its source needs none.
// Samples are averaged as they are stored, as filters do it (docs/decisions/008). A texel is
// computed from one tile of the level before, so the order in which tiles are read does not matter.
#include "shading/level_tile.h"

#include <algorithm>
#include <cstring>

#include "core/portable_math.h"

namespace pounce::shading {
namespace {

using mesh::kBlockEdge;
using store::kApron;
using store::kColourTileEdge;

constexpr std::uint32_t kSmallest = 8;  // texels: no level is made of an image that fits into it

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
void mean_sample(Depth depth, const std::byte* from, std::size_t texel, const LevelAxis& columns,
                 const LevelAxis& rows, const LevelSpan& across, const LevelSpan& down,
                 std::byte* to) {
  const std::size_t row_bytes = kColourTileEdge * texel;
  // The weights of one texel sum to `total`, at most width times height: sums of 16-bit samples fit
  // 64 bits.
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

}  // namespace

LevelAxis::LevelAxis(std::uint32_t tile, std::uint32_t size, mesh::Wrap wrap)
    : total(level_total(size)) {
  const std::int64_t level_size = (size + 1) / 2;
  for (int i = 0; i < kColourTileEdge; ++i) {
    // Wrapped by the level's own size: of odd sizes, the apron of the level before is something
    // else.
    const std::int64_t at = std::int64_t{tile} * kBlockEdge + i - kApron;
    if (at >= level_size + kApron) continue;
    Texel& texel = texels[static_cast<std::size_t>(i)];
    texel.span = level_span(static_cast<std::uint32_t>(store::wrapped(at, level_size, wrap)), size);
    texel.tile = texel.span.first / kBlockEdge;
    texel.span.first = texel.span.first % kBlockEdge + kApron;
    texel.used = true;
    if (std::find(tiles.begin(), tiles.end(), texel.tile) == tiles.end())
      tiles.push_back(texel.tile);
  }
}

void fill_level_tile(const store::ColourDirectory& image, const store::ColourTile& before,
                     std::uint32_t tile_x, std::uint32_t tile_y, const LevelAxis& columns,
                     const LevelAxis& rows, std::span<std::byte> tile) {
  const std::size_t texel = image.texel_bytes(), sample = store::depth_bytes(image.depth);
  for (std::size_t r = 0; r < rows.texels.size(); ++r) {
    const LevelAxis::Texel& row = rows.texels[r];
    if (!row.used || row.tile != tile_y) continue;
    for (std::size_t c = 0; c < columns.texels.size(); ++c) {
      const LevelAxis::Texel& column = columns.texels[c];
      if (!column.used || column.tile != tile_x) continue;
      const std::byte* const from =
          before.data() +
          (std::size_t{row.span.first} * kColourTileEdge + column.span.first) * texel;
      std::byte* const to = tile.data() + (r * kColourTileEdge + c) * texel;
      for (std::size_t channel = 0; channel < image.channels; ++channel) {
        mean_sample(image.depth, from + channel * sample, texel, columns, rows, column.span,
                    row.span, to + channel * sample);
      }
    }
  }
}

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

std::uint32_t last_level(const store::ColourDirectory& image) {
  std::uint32_t level = 0;
  for (std::uint32_t size = std::max(image.width, image.height); size > kSmallest;
       size = (size + 1) / 2)
    ++level;
  return level;
}

}  // namespace pounce::shading
