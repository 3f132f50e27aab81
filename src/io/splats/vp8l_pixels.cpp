// SPDX-License-Identifier: Apache-2.0
//
// A pixel is one of: four symbols (green, red, blue, alpha); the length and distance of a copy of
// pixels before it; a place in a cache of colours met before. Copies reach back less than 2^20
// pixels, so a ring of that many is all that is ever needed of the rows above.
#include "io/splats/vp8l_pixels.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

namespace pounce::io {
namespace {

constexpr std::uint32_t kLengths = 256;  // symbols of green from here are lengths of copies
constexpr std::uint32_t kCached = kLengths + 24;  // and from here places in the cache
constexpr std::uint32_t kDistances = 40;

/// The nearest pixels to the left and above have distance symbols of their own, nearest first:
/// columns to the left, rows up.
struct Near {
  std::int8_t left, up;
};
constexpr std::array<Near, 120> kNear{{
    {0, 1},  {1, 0},  {1, 1},  {-1, 1}, {0, 2},  {2, 0},  {1, 2},  {-1, 2}, {2, 1},  {-2, 1},
    {2, 2},  {-2, 2}, {0, 3},  {3, 0},  {1, 3},  {-1, 3}, {3, 1},  {-3, 1}, {2, 3},  {-2, 3},
    {3, 2},  {-3, 2}, {0, 4},  {4, 0},  {1, 4},  {-1, 4}, {4, 1},  {-4, 1}, {3, 3},  {-3, 3},
    {2, 4},  {-2, 4}, {4, 2},  {-4, 2}, {0, 5},  {3, 4},  {-3, 4}, {4, 3},  {-4, 3}, {5, 0},
    {1, 5},  {-1, 5}, {5, 1},  {-5, 1}, {2, 5},  {-2, 5}, {5, 2},  {-5, 2}, {4, 4},  {-4, 4},
    {3, 5},  {-3, 5}, {5, 3},  {-5, 3}, {0, 6},  {6, 0},  {1, 6},  {-1, 6}, {6, 1},  {-6, 1},
    {2, 6},  {-2, 6}, {6, 2},  {-6, 2}, {4, 5},  {-4, 5}, {5, 4},  {-5, 4}, {3, 6},  {-3, 6},
    {6, 3},  {-6, 3}, {0, 7},  {7, 0},  {1, 7},  {-1, 7}, {5, 5},  {-5, 5}, {7, 1},  {-7, 1},
    {4, 6},  {-4, 6}, {6, 4},  {-6, 4}, {2, 7},  {-2, 7}, {7, 2},  {-7, 2}, {3, 7},  {-3, 7},
    {7, 3},  {-7, 3}, {5, 6},  {-5, 6}, {6, 5},  {-6, 5}, {8, 0},  {4, 7},  {-4, 7}, {7, 4},
    {-7, 4}, {8, 1},  {8, 2},  {6, 6},  {-6, 6}, {8, 3},  {5, 7},  {-5, 7}, {7, 5},  {-7, 5},
    {8, 4},  {6, 7},  {-6, 7}, {7, 6},  {-7, 6}, {8, 5},  {7, 7},  {-7, 7}, {8, 6},  {8, 7},
}};

/// The number that a symbol and the bits after it stand for, from 1: lengths and distances.
std::uint32_t read_number(BitState& state, std::uint32_t symbol) {
  if (symbol < 4) return symbol + 1;
  const std::uint32_t bits = (symbol - 2) >> 1;
  return ((2 + (symbol & 1)) << bits) + state.take(bits) + 1;
}

/// How many pixels back in an image of this width.
std::uint64_t distance_of(std::uint32_t number, std::uint32_t width) {
  if (number > kNear.size()) return number - kNear.size();
  const Near near = kNear[number - 1];
  const std::int64_t distance = std::int64_t{near.up} * width + near.left;
  return static_cast<std::uint64_t>(std::max<std::int64_t>(1, distance));
}

}  // namespace

PixelRing::PixelRing(std::uint64_t pixels)
    : pixels_(std::bit_ceil(std::min(pixels, kMostPixels))) {}

Vp8lPixels::Vp8lPixels(BitSource& source, std::uint32_t width, std::uint32_t height,
                       PixelRing& ring, WriteFile* scratch)
    : source_(source), width_(width), height_(height), ring_(ring) {
  if (source.read(1) == 1) {
    const std::uint32_t bits = source.read(4);
    if (bits < 1 || bits > 11) source.fail(fmt::format("a colour cache of 2^{} colours", bits));
    cache_.resize(std::size_t{1} << bits);
    cache_shift_ = 32 - bits;
  }
  if (scratch != nullptr && source.read(1) == 1) {
    read_group_image(*scratch);
  } else {
    group_is_used_ = {true};
  }
  read_groups();
}

void Vp8lPixels::read_group_image(WriteFile& scratch) {
  const std::uint32_t bits = source_.read(3) + 2;
  Vp8lBlocks<std::uint16_t>& blocks = group_of_block_.emplace(width_, bits, scratch);
  const std::uint32_t columns = blocks.size(width_), rows = blocks.size(height_);
  Vp8lPixels image(source_, columns, rows, ring_, nullptr);
  std::vector<std::uint32_t> pixels(columns);
  std::vector<std::uint16_t> groups(columns);
  for (std::uint32_t y = 0; y < rows; ++y) {
    image.read_row(pixels);
    for (std::uint32_t x = 0; x < columns; ++x) {
      groups[x] = static_cast<std::uint16_t>(pixels[x] >> 8);
      if (groups[x] >= group_is_used_.size()) group_is_used_.resize(groups[x] + std::size_t{1});
      group_is_used_[groups[x]] = true;
    }
    blocks.append(groups);
  }
}

void Vp8lPixels::read_groups() {
  const std::uint32_t greens = kCached + static_cast<std::uint32_t>(cache_.size());
  groups_.reserve(group_is_used_.size());
  for (const bool is_used : group_is_used_) {
    PrefixTables* const tables = is_used ? &tables_ : nullptr;
    PrefixGroup group;
    group.green = read_prefix_code(source_, greens, tables);
    group.red = read_prefix_code(source_, 256, tables);
    group.blue = read_prefix_code(source_, 256, tables);
    group.alpha = read_prefix_code(source_, 256, tables);
    group.distance = read_prefix_code(source_, kDistances, tables);
    groups_.push_back(group);
    if (memory_bytes() > kMostCodeBytes) {
      source_.fail(fmt::format("its {} groups of prefix codes take more than {} MiB",
                               group_is_used_.size(), kMostCodeBytes >> 20));
    }
  }
}

std::uint64_t Vp8lPixels::memory_bytes() const {
  return tables_.bytes() + groups_.capacity() * sizeof(PrefixGroup) + cache_.size() * 4;
}

template <bool kHasCache>
BitState Vp8lPixels::copy(BitState state, std::uint32_t length_symbol,
                          const PrefixCode& distances) {
  const std::uint64_t length = read_number(state, length_symbol);
  state.refill();
  const std::uint32_t number = read_number(state, distances.read(state));
  const std::uint64_t distance = distance_of(number, width_);
  const std::uint64_t pixels = std::uint64_t{width_} * height_;
  if (distance > position_ || length > pixels - position_) {
    source_.set(state);
    source_.fail(distance > position_ ? "a copy from before the first pixel"
                                      : "a copy beyond the last pixel");
  }
  std::uint32_t* const ring = ring_.data();
  const std::uint64_t mask = ring_.mask();
  const std::uint64_t to = position_ & mask, from = (position_ - distance) & mask;
  position_ += length;
  if (!kHasCache && distance >= length && to + length <= mask && from + length <= mask) {
    // The source may begin in what is about to be overwritten: the ring's oldest pixels.
    std::memmove(ring + to, ring + from, length * sizeof *ring);
    return state;
  }
  for (std::uint64_t i = 0; i < length; ++i) {
    const std::uint32_t pixel = ring[(from + i) & mask];
    ring[(to + i) & mask] = pixel;
    if constexpr (kHasCache) cache_[cache_slot(pixel)] = pixel;
  }
  return state;
}

template <bool kHasCache>
void Vp8lPixels::decode_row() {
  const std::uint64_t begin = std::uint64_t{row_} * width_, end = begin + width_;
  std::span<const std::uint16_t> group_of_block;
  if (group_of_block_) group_of_block = group_of_block_->row(row_);
  std::uint32_t* const ring = ring_.data();
  const std::uint64_t mask = ring_.mask();
  BitState state = source_.state();
  while (position_ < end) {
    const PrefixGroup* group = groups_.data();
    std::uint64_t stop = end;
    if (group_of_block_) {
      const std::uint32_t bits = group_of_block_->bits();
      const std::uint64_t block = (position_ - begin) >> bits;
      group += group_of_block[block];
      stop = std::min(end, begin + ((block + 1) << bits));
    }
    std::uint64_t position = position_;
    while (position < stop) {
      if (state.next >= state.safe) [[unlikely]]
        state = source_.more(state);
      state.refill();
      const std::uint32_t green = group->green.read(state);
      std::uint32_t pixel;
      if (green < kLengths) {
        const std::uint32_t red = group->red.read(state);
        const std::uint32_t blue = group->blue.read(state);
        if (state.count < 15) [[unlikely]]
          state.refill();
        pixel = group->alpha.read(state) << 24 | red << 16 | green << 8 | blue;
      } else if (green < kCached) {
        position_ = position;
        state = copy<kHasCache>(state, green - kLengths, group->distance);
        position = position_;
        continue;
      } else {
        pixel = cache_[green - kCached];
      }
      ring[position++ & mask] = pixel;
      if constexpr (kHasCache) cache_[cache_slot(pixel)] = pixel;
    }
    position_ = position;
  }
  source_.set(state);
  source_.check();
}

void Vp8lPixels::read_row(std::span<std::uint32_t> out) {
  if (cache_.empty()) {
    decode_row<false>();
  } else {
    decode_row<true>();
  }
  const std::uint64_t mask = ring_.mask(), at = std::uint64_t{row_} * width_ & mask;
  const std::size_t first =
      static_cast<std::size_t>(std::min<std::uint64_t>(width_, mask + 1 - at));
  std::copy_n(ring_.data() + at, first, out.begin());
  std::copy_n(ring_.data(), width_ - first, out.begin() + static_cast<std::ptrdiff_t>(first));
  ++row_;
}

}  // namespace pounce::io
