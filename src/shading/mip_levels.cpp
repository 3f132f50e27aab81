// SPDX-License-Identifier: Apache-2.0
//
// Smaller levels of an image from its rows, as they come.
//
// A level's row lies between two rows of the level before: both are narrowed to its width when they
// come by, the first waits for the second, and the mean goes on to the next level at once. So a row
// of the image may finish a row of every level, and a level never holds more than two rows,
// whatever the height.
//
// Where texel x of n lies among m = 2n or 2n + 1 is a fraction of integers, ((2x + 1) m - n) / 2n:
// exact, and the same in both directions. Of even sides it is always in the middle of two texels:
// the box filter of 2 x 2. Odd sides of one level make a linear filter: its middle is where it
// belongs, and no texel shifts by half of one.
//
// Rows are read once, as the encoder gets them, since the image is nowhere as a whole: it may be
// larger than the budget. Levels are means of what is stored, as maketx makes them by default
// (docs/decisions/034).
#include "shading/mip_levels.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/portable_math.h"
#include "mesh/lattice.h"
#include "store/blocks/colour_store.h"

namespace pounce::shading {
namespace {

/// Between which two texels of the level before a texel lies, and how far from the first.
struct Between {
  std::uint32_t first = 0;
  float share = 0;  ///< of the second
};

Between between(std::uint32_t x, std::uint32_t count, std::uint32_t count_before) {
  if (count_before == count) return {x, 0};
  const std::uint64_t place = (2ULL * x + 1) * count_before - count;
  const std::uint64_t unit = 2ULL * count;
  return {static_cast<std::uint32_t>(place / unit),
          static_cast<float>(place % unit) / static_cast<float>(unit)};
}

/// 0 keeps the first whatever the second is, be it infinite.
float mix(float first, float second, float share) {
  return share == 0 ? first : first * (1 - share) + second * share;
}

void decode(Depth depth, std::size_t count, const std::byte* from, float* to) {
  for (std::size_t i = 0; i < count; ++i) {
    std::uint16_t word = 0;
    if (depth == Depth::u16 || depth == Depth::half) std::memcpy(&word, from + 2 * i, 2);
    if (depth == Depth::u8) to[i] = static_cast<float>(std::to_integer<std::uint8_t>(from[i]));
    if (depth == Depth::u16) to[i] = static_cast<float>(word);
    if (depth == Depth::half) to[i] = half_to_float(word);
    if (depth == Depth::float32) std::memcpy(to + i, from + 4 * i, 4);
  }
}

/// Means of integers are never out of their range.
void encode(Depth depth, std::size_t count, const float* from, std::byte* to) {
  for (std::size_t i = 0; i < count; ++i) {
    if (depth == Depth::u8) {
      to[i] = static_cast<std::byte>(static_cast<std::uint8_t>(from[i] + 0.5F));
    } else if (depth == Depth::float32) {
      std::memcpy(to + 4 * i, from + i, 4);
    } else {
      const std::uint16_t word = depth == Depth::half ? float_to_half(from[i])
                                                      : static_cast<std::uint16_t>(from[i] + 0.5F);
      std::memcpy(to + 2 * i, &word, 2);
    }
  }
}

}  // namespace

std::uint32_t level_count(ImageSize size) {
  std::uint32_t count = 1;
  for (; size.width > 1 || size.height > 1; size = mesh::next_level_size(size)) ++count;
  return count;
}

MipLevels::MipLevels(ImageSize size, std::uint32_t channels, Depth depth)
    : size_(size),
      channels_(channels),
      depth_(depth),
      row_(std::size_t{size.width} * channels),
      encoded_(std::size_t{mesh::next_level_size(size).width} * channels *
               store::depth_bytes(depth)) {
  for (std::uint32_t level = 1; level < level_count(size_); ++level) {
    Level& made = levels_.emplace_back();
    made.from = size;
    made.size = size = mesh::next_level_size(size);
    made.above.resize(std::size_t{size.width} * channels);
    made.below.resize(std::size_t{size.width} * channels);
  }
}

void MipLevels::push(std::uint32_t rows, const std::byte* samples, const Take& take) {
  if (levels_.empty()) return;
  const std::size_t row_bytes = row_.size() * store::depth_bytes(depth_);
  for (std::uint32_t i = 0; i < rows; ++i, samples += row_bytes) {
    decode(depth_, row_.size(), samples, row_.data());
    accept(0, next_row_++, row_.data(), take);
  }
}

void MipLevels::accept(std::size_t index, std::uint32_t row, const float* samples,
                       const Take& take) {
  Level& level = levels_[index];
  if (level.next_row == level.size.height) return;  // an odd side's last row may lie beyond
  const Between rows = between(level.next_row, level.size.height, level.from.height);
  if (row == rows.first) narrow(level, samples, level.above.data());
  if (row == rows.first && rows.share == 0) return finish(index, take);
  if (row != rows.first + 1) return;
  narrow(level, samples, level.below.data());
  for (std::size_t i = 0; i < level.above.size(); ++i)
    level.above[i] = mix(level.above[i], level.below[i], rows.share);
  finish(index, take);
}

void MipLevels::narrow(const Level& level, const float* samples, float* out) const {
  if (level.from.width == 2 * level.size.width) {  // the same, without a division for each texel
    for (std::uint32_t x = 0; x < level.size.width; ++x, samples += 2 * channels_) {
      for (std::uint32_t c = 0; c < channels_; ++c)
        *out++ = mix(samples[c], samples[c + channels_], 0.5F);
    }
    return;
  }
  for (std::uint32_t x = 0; x < level.size.width; ++x) {
    const Between columns = between(x, level.size.width, level.from.width);
    const float* const first = samples + std::size_t{columns.first} * channels_;
    const float* const second = columns.share == 0 ? first : first + channels_;
    for (std::uint32_t c = 0; c < channels_; ++c) *out++ = mix(first[c], second[c], columns.share);
  }
}

/// The row in `above` is that of this level.
void MipLevels::finish(std::size_t index, const Take& take) {
  Level& level = levels_[index];
  encode(depth_, level.above.size(), level.above.data(), encoded_.data());
  take(static_cast<std::uint32_t>(index + 1), encoded_.data());
  const std::uint32_t row = level.next_row++;
  if (index + 1 < levels_.size()) accept(index + 1, row, level.above.data(), take);
}

std::uint64_t MipLevels::memory_bytes(ImageSize size, std::uint32_t channels) {
  std::uint64_t floats = std::uint64_t{size.width} * channels;
  std::uint64_t pages = 0;
  for (ImageSize level = size; level.width > 1 || level.height > 1; ++pages) {
    level = mesh::next_level_size(level);
    floats += (pages == 0 ? 3ULL : 2ULL) * level.width * channels;
  }
  return 4 * floats + (2 * pages + 2) * kPageBytes;
}

// --- levels of stored images ---------------------------------------------------------------------
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

/// Four whole samples' sum over four, rounded to nearest, halves to even.
template <class Sum>
constexpr Sum mean_of_four(Sum sum) noexcept {
  return static_cast<Sum>((sum + 1 + (sum >> 2 & 1)) >> 2);
}

/// `Sum` holds four samples. The upper and lower rows are added first, side by side.
template <class Sample, class Sum, std::size_t kChannels>
void mean_rows(const Sample* above, const Sample* below, std::size_t count, Sample* out) noexcept {
  constexpr std::size_t kAtOnce = 64;
  std::array<Sum, 2 * kAtOnce * kChannels> sums;
  while (count > 0) {
    const std::size_t texels = std::min(count, kAtOnce), samples = 2 * texels * kChannels;
    for (std::size_t i = 0; i < samples; ++i)
      sums[i] = static_cast<Sum>(static_cast<Sum>(above[i]) + below[i]);
    for (std::size_t i = 0; i < texels; ++i) {
      for (std::size_t c = 0; c < kChannels; ++c) {
        const std::size_t left = 2 * i * kChannels + c;
        out[i * kChannels + c] = static_cast<Sample>(
            mean_of_four(static_cast<Sum>(sums[left] + sums[left + kChannels])));
      }
    }
    above += samples;
    below += samples;
    out += texels * kChannels;
    count -= texels;
  }
}

template <class Sample, class Sum>
void mean_rows(std::size_t channels, const std::byte* above, const std::byte* below,
               std::size_t count, std::byte* out) noexcept {
  const auto samples = [](auto* bytes) { return reinterpret_cast<const Sample*>(bytes); };
  auto* const to = reinterpret_cast<Sample*>(out);
  static_assert(store::kMostSamples == 5);
  switch (channels) {
    case 1:
      return mean_rows<Sample, Sum, 1>(samples(above), samples(below), count, to);
    case 2:
      return mean_rows<Sample, Sum, 2>(samples(above), samples(below), count, to);
    case 3:
      return mean_rows<Sample, Sum, 3>(samples(above), samples(below), count, to);
    case 4:
      return mean_rows<Sample, Sum, 4>(samples(above), samples(below), count, to);
    default:
      return mean_rows<Sample, Sum, 5>(samples(above), samples(below), count, to);
  }
}

}  // namespace

void mean_of_fours(const store::ColourDirectory& image, const std::byte* above,
                   const std::byte* below, std::size_t count, std::byte* out) noexcept {
  return image.depth == Depth::u8
             ? mean_rows<std::uint8_t, std::uint16_t>(image.channels, above, below, count, out)
             : mean_rows<std::uint16_t, std::uint32_t>(image.channels, above, below, count, out);
}

bool is_halved_evenly(const store::ColourDirectory& image, std::uint32_t level) {
  const std::uint32_t multiple = 1U << level;
  return !store::is_float(image.depth) && image.width % multiple == 0 &&
         image.height % multiple == 0;
}

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
  const bool in_fours = !store::is_float(image.depth) && columns.total == 2 && rows.total == 2;
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
      if (in_fours) {
        // All that lie side by side; where the image wraps another run begins.
        std::size_t count = 1;
        for (; c + count < columns.texels.size(); ++count) {
          const LevelAxis::Texel& next = columns.texels[c + count];
          if (!next.used || next.tile != tile_x || next.span.first != column.span.first + 2 * count)
            break;
        }
        mean_of_fours(image, from, from + kColourTileEdge * texel, count, to);
        c += count - 1;
        continue;
      }
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
