// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/colour_space.h"
#include "core/page_pool.h"
#include "pounce/options.h"
#include "store/blocks/colour_store.h"
#include "store/pack/codec.h"

namespace pounce::shading {

/// How one output image holds its texels.
struct TexelFormat {
  std::uint32_t channels = 0;
  Depth depth = Depth::u8;
  bool linear = false;         ///< samples are scene-linear
  bool is_colour = true;       ///< false: data, never converted between sRGB coding and linear
  bool has_alpha = false;      ///< the last channel is alpha: never converted
  bool premultiplied = false;  ///< colours are held times alpha
  /// What linear light of Rec. 709 becomes; then `linear` says how numbers that went through it
  /// are tagged, no more. Null: nothing. Not owned.
  const ColourTransform* transform = nullptr;
  std::uint32_t colours() const { return channels - (has_alpha ? 1U : 0U); }
  std::size_t texel_bytes() const;
  /// Are 8-bit samples of this image what the output holds, with nothing to convert?
  bool keeps(const store::ColourDirectory& image) const {
    return transform == nullptr && depth == Depth::u8 && image.depth == Depth::u8 &&
           channels == image.channels && has_alpha == image.has_alpha &&
           (linear == image.linear || !is_colour);
  }
};

/// Values of one texel as a source image holds them: 0..1 for integers, as stored for floats.
struct TexelValue {
  std::array<double, 4> v{};
  std::uint32_t channels = 0;
  bool linear = false;
  bool has_alpha = false;      ///< the last channel is alpha
  bool premultiplied = false;  ///< colours come times alpha; only into a format that wants that
  bool is_final = false;       ///< went through the format's transform, or needs none
};

/// Gives grey the red, green and blue of it, and what follows after them.
void spread_grey(TexelValue& value) noexcept;
/// Puts the colour through a transform, as it is without its alpha; grey becomes red, green and
/// blue. Two channels are no colour and stay.
void transform_colour(const ColourTransform& transform, TexelValue& value) noexcept;

/// Writes a value in the output's format at `out`: gray becomes RGB, a missing alpha 1, any other
/// missing channel 0; the first three of a colour are converted between sRGB coding and linear
/// where source and output differ, or go through the format's transform. Rounds to nearest; clamps
/// integers and half. Returns how many samples the depth cannot hold, not even rounded.
std::uint32_t store_texel(const TexelFormat& format, const TexelValue& value,
                          std::byte* out) noexcept;

inline constexpr int kValues = 16;
/// Values of sixteen texels, channel by channel; else as in TexelValue. Not owned.
struct TexelValues {
  std::array<const double*, 4> v{};  ///< kValues numbers each
  std::uint32_t channels = 0;
  bool linear = false;
  bool has_alpha = false;
  bool is_final = false;
};
/// store_texel() of those of `lanes` (a bit each): lane i as texel[i] of those at `out`. Faster
/// where 8 bits are rounded and nothing is converted.
std::uint32_t store_texels(const TexelFormat& format, const TexelValues& values,
                           std::uint32_t lanes, const std::uint16_t* texel,
                           std::byte* out) noexcept;

/// The sRGB transfer function and its inverse as near as samples of `depth` need, and faster for 8
/// bits and half.
double to_linear(double coded, Depth depth) noexcept;
double to_coded(double linear, Depth depth) noexcept;

inline constexpr std::size_t kMaskBytes = 64 * 64 / 8;

/// A 64x64 window of an output image: which texels were covered and their samples (0 elsewhere).
struct ResultBlock {
  std::array<std::uint8_t, kMaskBytes> mask{};
  PageVector<std::byte> texels;  ///< 64 * 64 * texel_bytes

  bool covered(std::uint32_t texel) const { return (mask[texel / 8] >> (texel % 8) & 1) != 0; }
  void cover(std::uint32_t texel) {
    mask[texel / 8] = static_cast<std::uint8_t>(mask[texel / 8] | 1U << texel % 8);
  }
};

/// Replaces `stored` by what a pack holds of a result: filtered and compressed, or as it is where
/// there is `room` for that. Returns how many bytes it is before compression.
std::uint32_t encode(const ResultBlock& block, const TexelFormat& format,
                     store::Compressor& compressor, store::PlainRoom* room,
                     std::vector<std::byte>& stored);
/// The inverse, of `size_bytes` before compression. Throws Error(damaged_store).
void decode(store::StoredChunk stored, std::uint32_t size_bytes, const TexelFormat& format,
            store::Compressor& compressor, const std::string& name, ResultBlock& block);

}  // namespace pounce::shading
