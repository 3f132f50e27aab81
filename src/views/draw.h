// SPDX-License-Identifier: Apache-2.0
//
// One tile of one view: the scene's Gaussians, front to back, as a viewer draws them.
//
// Every Gaussian that meets the tile becomes an ellipse on it; ellipses are sorted by the depth of
// their means (slab.h), and each pixel is composited on its own.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <vector>

#include "gaussian/splat_columns.h"
#include "views/grid.h"
#include "views/kernels.h"
#include "views/sharpen.h"
#include "views/slab.h"

namespace pounce::views {

/// What of a scene decides how it is drawn, beside its Gaussians.
struct DrawOptions {
  bool antialiased = false;  ///< trained with opacity x sqrt(det / det')
  /// Pixels with longer edges show the mean of what they cover (gaussian::fine_edge()).
  float fine_edge = std::numeric_limits<float>::infinity();
  bool harmonics = true;  ///< colours are those of the view's direction
};

/// The pixels of a tile while it is drawn: structure of arrays, in blocks of four by four, which
/// narrow ellipses fill better than rows.
struct alignas(64) Canvas {
  static constexpr int kBlock = 4, kBlocks = kStoredEdge / kBlock;  ///< along an edge
  static_assert(kBlocks * kBlock == kStoredEdge);
  static constexpr int kPixels = kStoredEdge * kStoredEdge;
  static constexpr int at(int x, int y) {
    return (y / kBlock * kBlocks + x / kBlock) * kBlock * kBlock + y % kBlock * kBlock + x % kBlock;
  }
  float through[kPixels];  ///< what is left of the light
  float colour[3][kPixels];
  float depth[kPixels];       ///< where half of the light was taken; below 0: nowhere
  float begin[kPixels] = {};  ///< where clips: what lies before that is not drawn
  bool clips = false;

  void clear();
  /// All pixels begin at this depth.
  void begin_at(float first);
  /// Pixels begin `gap` before these depths, samples of a target's tile; those without are none.
  void begin_before(const std::uint16_t* depths, float gap);
};

/// What a tile of a view sees.
class TileSight {
 public:
  TileSight(const Grid& grid, std::uint32_t view, std::uint32_t tile_x, std::uint32_t tile_y,
            const DrawOptions& options, const ViewKernels& kernels);
  bool meets(const Box3f& box) const;  ///< of Gaussians, without their footprints
  /// Where the means in a box lie, in Order's depths.
  DepthRange depths(const Box3f& box) const;
  /// Adds to `slab` what the tile may see of a block; `first`: the number of its first Gaussian.
  void add(const gaussian::SplatColumns& set, std::uint64_t first, Slab& slab) const;

 private:
  void add_sixteen(const gaussian::SplatColumns& set, std::size_t begin, unsigned met,
                   std::uint64_t first, Slab& slab) const;

  const ViewKernels* kernels_;
  TileView view_;
  bool harmonics_;
  std::array<float, 16> basis_;
};

/// A block of Gaussians that a tile may see.
struct NearBlock {
  DepthRange depths;
  std::uint64_t first = 0;      ///< number of its first Gaussian
  const void* entry = nullptr;  ///< the caller's: which block it is
};

/// Draws what a tile sees. `blocks`: all that it may see, in any order; `block` reads one. False:
/// there is nothing, and the canvas is as it was.
bool draw_tile(
    const TileSight& sight, std::vector<NearBlock> blocks,
    const std::function<std::shared_ptr<const gaussian::SplatColumns>(const NearBlock&)>& block,
    const ViewKernels& kernels, Slab& slab, Canvas& canvas);

/// The tile's samples, sharpened and interleaved as in Grid::image(kSceneSamples).
std::vector<std::byte> samples_of(const Canvas& canvas, Sharpener& sharpener);

}  // namespace pounce::views
