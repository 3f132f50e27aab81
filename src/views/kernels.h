// SPDX-License-Identifier: Apache-2.0
//
// What is done to sixteen of a kind at once: spheres, pixels, texels. One build per instruction
// set; all give the same bits.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "core/vec.h"
#include "gaussian/splat_columns.h"
#include "surface/target_block.h"

namespace pounce::views {

struct Ellipse;
struct Canvas;
struct DepthTriangle;
struct PixelRows;
struct PlacePacket;
struct Sharpening;
struct SightLimits;
struct SightPacket;
struct TargetDepths;
struct ViewTiles;

/// A tile from a sphere's point of view: where the tile's first pixel is along its axes.
struct TileBounds {
  Vec3f right, down;       ///< per pixel
  Vec3f middle;            ///< of the view, in space
  float first_x, first_y;  ///< of that, in the tile
  float per_pixel;
  float margin;  ///< in pixels, around every sphere
  float last;    ///< the tile's last pixel
};

/// A tile from a Gaussian's point of view.
struct TileView {
  TileBounds bounds;
  Vec3f right, down, forward;  ///< unit
  float per_pixel, depth_per_pixel;
  float fine, footprint;  ///< in squared pixels
  bool antialiased;       ///< trained with opacity x sqrt(det / det')
};

/// A view from a texel's point of view.
struct PlaceFrame {
  Vec3f right, down;  ///< per pixel
  Vec3f forward;      ///< unit
  Vec3f middle;       ///< of the view, in space
  float middle_pixel, middle_depth, per_step;
  std::int32_t last_tile;  ///< of a row or column
};

/// Thread-safe.
struct ViewKernels {
  const char* isa;  ///< "sse2", "avx2", "avx512"
  /// Which of sixteen spheres may meet the tile: a bit each.
  unsigned (*meet)(const float* x, const float* y, const float* z, const float* radius,
                   const TileBounds& bounds);
  /// What the tile shows of those of `met` (a bit each) among the sixteen Gaussians from `first`
  /// on: writes one ellipse after the other, all of it but order and colour, the depth in pixels
  /// from the view's middle. Returns which are shown.
  unsigned (*show)(const gaussian::SplatColumns& set, std::size_t first, unsigned met,
                   const TileView& view, Ellipse* out);
  /// The colours of these sixteen Gaussians (out[channel][lane]) with as many lobes of harmonics as
  /// `basis` has, of the view's direction.
  void (*colour)(const gaussian::SplatColumns& set, std::size_t first, std::span<const float> basis,
                 float (*out)[surface::kLanes]);
  /// Composites ellipses in their order behind what is there. False: nothing behind them will show.
  bool (*draw)(std::span<const Ellipse* const> ellipses, Canvas& canvas);
  /// Writes the colours of pixels, moved away from what is around them; not below 0.
  void (*sharpen)(const PixelRows& pixels, const Sharpening& how, PixelRows& out);
  /// Lowers depths to those of triangles that are nearer. Of a triangle count the pixels whose
  /// middles it has, edges included. Rewrites up to TargetDepths::kBehind samples behind a row's
  /// last as they are.
  void (*draw_depths)(std::span<const DepthTriangle> triangles, TargetDepths& depths);
  /// Where packets of texels lie in a view; adds to `sights` how much they face it. Of packets that
  /// do not, only the cosines, the weights, the empty range of tiles and `alike` are set.
  void (*place)(const PlaceFrame& frame, std::span<const surface::TexelPacket> packets,
                std::span<PlacePacket> places, std::span<SightPacket> sights);
  /// Does the target's surface, in one tile of a view, lie about where some texel does? Else
  /// gather() adds nothing. Needs no scene. `places`: all that one place() has made.
  bool (*sees)(const SightLimits& limits, const ViewTiles& tiles,
               std::span<const PlacePacket> places);
  /// Adds to texels what one tile of a view shows where they lie in it. `places` as in sees().
  void (*gather)(const SightLimits& limits, const ViewTiles& tiles,
                 std::span<const PlacePacket> places, std::span<SightPacket> sights);
};

/// The kernels for `isa`, as instruction_set() chooses.
const ViewKernels& view_kernels(const std::string& isa);

}  // namespace pounce::views
