// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "shading/result_block.h"

namespace pounce::shading {

// Painting over: new texels laid on those of an image that is already there ("onto"), as far as a
// mask lets them. All functions work on runs of texels, tightly packed, in one format; they keep
// nothing between calls.

/// Samples of one format in another: bit for bit where the two are alike, else as store_texel()
/// rounds them. Returns how many the other one cannot hold.
std::uint64_t convert_texels(const TexelFormat& from, const std::byte* in, const TexelFormat& to,
                             std::size_t count, std::byte* out);

/// What a mask image says, per texel: 0 keeps what is there, 1 replaces it, in between mixes. It is
/// the brightness of the samples as they are stored (of colour: 0.2126 R + 0.7152 G + 0.0722 B)
/// times alpha, where there is alpha; below 0 and NaN count as 0, above 1 as 1.
void mask_weights(const TexelFormat& mask, const std::byte* in, std::size_t count, float* weights);

/// How alpha takes part in painting.
enum class PaintAlpha : std::uint8_t {
  keep,          ///< the old alpha stays; colours mix as they are (also for formats without alpha)
  mix,           ///< alpha mixes; straight colours count by how opaque each side is
  premultiplied  ///< both sides hold colours times alpha: every channel mixes as it is
};

/// `texels` (old) := old * (1 - weight) + fresh * weight, in the encoding that `format` stores.
/// Where the weight is 0 the old samples stay bit for bit, where it is 1 they become the fresh ones
/// bit for bit (but for alpha under `keep`). Integers round to nearest.
void paint_over(const TexelFormat& format, PaintAlpha alpha, const float* weights,
                const std::byte* fresh, std::size_t count, std::byte* texels);

/// Copies the last channel of `from` to `to`: the alpha that stays before colours are multiplied by
/// it.
void copy_alpha(const TexelFormat& format, const std::byte* from, std::size_t count, std::byte* to);

}  // namespace pounce::shading
