// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "store/blocks/splat_block.h"

namespace pounce::gaussian {

/// How round the Gaussians of a scene are: the median of their second largest standard deviation
/// over their largest. 1 for none.
float median_roundness(std::span<const store::Splat> splats);

/// How thick the thinner Gaussians of a scene are: the lower quartile of their smallest standard
/// deviation over their second largest, so that a surface shows through haze and needles. 0: discs
/// without thickness, 1: balls. 0 for none.
float quartile_thickness(std::span<const store::Splat> splats);

/// How large the Gaussians of a scene are: the median of their largest standard deviations. 0 for
/// none.
float median_size(std::span<const store::Splat> splats);

/// A texel is fine beside Gaussians as long as its edge is at most this many times their median
/// size (docs/decisions/035-coarse-splats.md).
inline constexpr float kFineSizes = 1.75F;

/// The longest edge of a texel that is fine beside Gaussians of that median size
/// (docs/decisions/035-coarse-splats.md).
float fine_edge(float size);

/// Are a scene's Gaussians the discs of a surface (1), or needles and tilted ellipsoids that make a
/// picture together (0)? Discs are round and thin. Captures of needles are not round (0.10 to 0.54;
/// made scenes 0.78 to 0.83), captures of balls are round, but thick (docs/decisions/023 and 038).
float discness(float roundness, float thickness);

/// Discs on a clean surface, with artefacts before it, are a made scene: what lies along a texel's
/// normal is the surface, and from all around one sees the artefacts. Others are captures.
inline bool is_made(float roundness, float thickness) {
  constexpr float kLeastDiscness = 0.5F;
  return discness(roundness, thickness) >= kLeastDiscness;
}

/// Whose isolated Gaussians fade (fade_isolated()): what viewers show of a capture is all of it.
enum class FadeIsolated : std::uint8_t { of_no_scene, of_made_scenes, of_all_scenes };

/// How far Gaussians lie from the surface that their neighbours make, for up to 32 Gaussians of a
/// block spread evenly over it: 1.4826 times the median absolute deviation of the offsets of its 16
/// nearest neighbours in the block along its normal (the file's, else its shortest axis). For
/// normal noise that is its standard deviation. Appends one figure per Gaussian; none for blocks of
/// fewer than 17.
void append_surface_noise(const store::SplatBlock& block, std::vector<float>& figures);

/// The median, the upper of two; 0 if there are none. Reorders `figures`.
float median(std::vector<float>& figures);

/// Fades the Gaussians of a block that have hardly any others around them: floaters. One with fewer
/// than four neighbours within the block's usual spacing and its own largest standard deviation
/// keeps a quarter of its opacity for each, a 64th without any. Neighbours are looked for among the
/// 32 before and after it in the store's order, which lie near. Blocks of fewer than 17 stay as
/// they are. Values stay rounded for the store.
void fade_isolated(std::span<store::Splat> block);

}  // namespace pounce::gaussian
