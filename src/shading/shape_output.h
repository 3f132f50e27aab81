// SPDX-License-Identifier: Apache-2.0
//
// Channels that need the surface itself: normal maps, and what is baked from the source's shape.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "core/directions.h"
#include "pounce/options.h"
#include "shading/result_block.h"
#include "shading/texel_input.h"

namespace pounce::shading {

/// How a channel follows from the surface.
struct ShapeOutput {
  Channel channel = Channel::normal;  ///< that, height, position or vertex_color
  /// Normal: true keeps the source's shape, baked into the target's frame; false transfers the
  /// detail alone, turned with the surface where source and target differ.
  bool keeps_shape = false;
  NormalY source_y = NormalY::up, output_y = NormalY::up;
  std::vector<float> scales;         ///< of normal maps, by source page
  std::optional<ColourInput> input;  ///< of colours, which are linear light of sRGB's
  Vec3d origin = {};                 ///< the job's, which positions have again
};

/// Is it a normal map, which reads images and frames? The others need neither.
inline bool is_normal(const ShapeOutput& shape) { return shape.channel == Channel::normal; }

/// A normal map's texel at a hit: `map` as blended from the source's image on `page`, into the
/// target's frame (usable), of unit length, coded 0..1. Alpha stays as it is.
TexelValue transferred_normal(const ShapeOutput& shape, int page, TexelValue map,
                              const TangentFrame& source, const TangentFrame& target);

/// The surface at a hit.
struct HitPoint {
  double height = 0;  ///< over the texel, along its normal
  Vec3d position;
  std::array<double, 4> colour{};  ///< of the vertices: linear light and alpha
};
/// One of these, as the channel wants it.
TexelValue baked_value(const ShapeOutput& shape, const HitPoint& at);

}  // namespace pounce::shading
