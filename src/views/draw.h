// SPDX-License-Identifier: Apache-2.0
//
// One tile of one view: the scene's Gaussians, front to back, as a viewer draws them.
//
// Every Gaussian that meets the tile becomes an ellipse on it; ellipses are sorted by the depth of
// their means, and each pixel is composited on its own. Where more meet the tile than memory holds,
// the nearest come first and the pixels go on with the next ones: as many slabs of depth as it
// takes, and the same picture.
#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "core/page_pool.h"
#include "gaussian/splat_set.h"
#include "views/grid.h"
#include "views/kernels.h"

namespace pounce::views {

/// What of a scene decides how it is drawn, beside its Gaussians.
struct DrawOptions {
  bool antialiased = false;  ///< trained with opacity x sqrt(det / det')
  /// Pixels with longer edges show the mean of what they cover (gaussian::fine_edge()).
  float fine_edge = std::numeric_limits<float>::infinity();
  bool harmonics = true;  ///< colours are those of the view's direction
};

/// Which Gaussian is before which: by depth, then as the store has them.
struct Order {
  std::uint32_t depth = 0;  ///< rises with the depth of the mean
  std::uint64_t number = 0;
  auto operator<=>(const Order&) const = default;
};

/// A Gaussian as a view shows it: lengths in pixels, places in the tile, whose first stored pixel
/// is at 0, 0.
struct Ellipse {
  Order order;
  float x, y;
  float xx, xy, yy;  ///< inverse of its covariance, footprint and all
  float opacity;
  float cut_off;  ///< beyond this squared distance, in its deviations, it is not seen
  float colour[3];
  float depth, lean_x, lean_y;  ///< of the best hit: at the mean, and per pixel from there
  float reach_x, reach_y;       ///< as far as it is seen
  float widest_y;               ///< how far below the mean it reaches that far to the right
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
  float depth[kPixels];  ///< where half of the light was taken; below 0: nowhere

  void clear();
};

/// The next ellipses of a tile, front to back, no more than `most` at once.
class Slab {
 public:
  /// Holds up to twice as many while they come: most_bytes().
  explicit Slab(std::size_t most);
  static std::uint64_t most_bytes(std::size_t most) {
    return round_to_pages(2 * most * sizeof(Ellipse)) +
           round_to_pages(most * sizeof(const Ellipse*)) + round_to_pages(most * sizeof(Place));
  }
  /// Is it behind what was drawn and, as far as is known, among the next?
  bool wants(const Order& order) const { return after_ < order && order < below_; }
  void add(const Ellipse& ellipse);
  /// All have come: those to draw now, in their order.
  std::span<const Ellipse* const> sorted();
  bool is_last() const { return !is_cut_; }  ///< none was left behind
  void next();                               ///< what was drawn goes; those behind may come
  void clear();                              ///< all may come, of another tile

 private:
  struct Place {
    Order order;
    std::uint32_t at;
  };
  void cut();

  const std::size_t most_;
  PageVector<Ellipse> ellipses_;
  PageVector<Place> places_;
  PageVector<const Ellipse*> sorted_;
  Order after_{}, below_{};
  bool is_cut_ = false;
};

/// What a tile of a view sees.
class TileSight {
 public:
  TileSight(const Grid& grid, std::uint32_t view, std::uint32_t tile_x, std::uint32_t tile_y,
            const DrawOptions& options, const ViewKernels& kernels);
  bool meets(const Box3f& box) const;  ///< of Gaussians, without their footprints
  /// Adds to `slab` what the tile may see of a block; `first`: the number of its first Gaussian.
  void add(const gaussian::SplatSet& set, std::uint64_t first, Slab& slab) const;

 private:
  void add(const gaussian::SplatSet& set, std::size_t i, std::uint64_t number, Slab& slab) const;

  const ViewKernels* kernels_;
  Frame frame_;
  float per_pixel_, depth_per_pixel_;
  TileBounds bounds_;
  float fine_, footprint_;  ///< in squared pixels
  DrawOptions options_;
  std::array<float, 16> basis_;
};

/// The tile's samples, interleaved as in Grid::image(kSceneSamples).
std::vector<std::byte> samples_of(const Canvas& canvas);

}  // namespace pounce::views
