// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/page_pool.h"
#include "io/splats/vp8l_bits.h"
#include "io/splats/vp8l_blocks.h"
#include "io/splats/vp8l_codes.h"

namespace pounce::io {

/// The last pixels that were decoded, as alpha << 24 | red << 16 | green << 8 | blue: as many as a
/// copy reaches back, or all of a smaller image.
class PixelRing {
 public:
  static constexpr std::uint64_t kMostPixels = 1 << 20;  ///< 4 MiB

  /// For images of up to `pixels` pixels.
  explicit PixelRing(std::uint64_t pixels);
  std::uint32_t* data() { return pixels_.data(); }
  std::uint64_t mask() const { return pixels_.size() - 1; }

 private:
  PageVector<std::uint32_t> pixels_;
};

/// Decodes the pixels of an image, the main one or one of those that steer it, in order.
class Vp8lPixels {
 public:
  /// Memory that the codes of an image may take: the encoders in use stay below it.
  static constexpr std::uint64_t kMostCodeBytes = 32 << 20;

  /// Reads what comes before the pixels: the size of the colour cache, with `scratch` (the main
  /// image) which blocks have which codes, and the codes. All references must outlive this, and the
  /// ring is its own until its last row. Throws Error(input), Error(storage).
  Vp8lPixels(BitSource& source, std::uint32_t width, std::uint32_t height, PixelRing& ring,
             WriteFile* scratch);

  /// The next row, `width` pixels. Throws Error(input), Error(storage).
  void read_row(std::span<std::uint32_t> out);
  /// What codes and colour cache take.
  std::uint64_t memory_bytes() const;

 private:
  void read_group_image(WriteFile& scratch);
  void read_groups();
  template <bool kHasCache>
  void decode_row();
  template <bool kHasCache>
  BitState copy(BitState state, std::uint32_t length_symbol, const PrefixCode& distances);
  std::uint32_t cache_slot(std::uint32_t pixel) const {
    return (pixel * 0x1E35A7BDU) >> cache_shift_;
  }

  BitSource& source_;
  std::uint32_t width_, height_;
  PixelRing& ring_;
  std::uint64_t position_ = 0;  ///< pixels decoded; a copy may have gone beyond the present row
  std::uint32_t row_ = 0;
  std::uint32_t cache_shift_ = 0;
  std::vector<std::uint32_t> cache_;  ///< by the highest bits of a hash
  PrefixTables tables_;
  std::vector<PrefixGroup> groups_;
  std::optional<Vp8lBlocks<std::uint16_t>> group_of_block_;
  std::vector<bool> group_is_used_;
};

}  // namespace pounce::io
