// SPDX-License-Identifier: Apache-2.0
//
// Details that the mean of all views will lose, given to each view beforehand.
//
// Where a target lies a little beside its scene, views show a detail beside itself, and their mean
// is soft. Each pixel moves away from what is around it by a part of the difference. Around it are
// four pairs of pixels on a ring, opposite each other: pairs leave a slope of colours as it is.
// A pair of which one lies outside of the tile, or much nearer or farther, says nothing
// (docs/decisions/077-sharpened-views.md).
#pragma once

#include <cstddef>
#include <limits>

#include "surface/target_block.h"
#include "views/grid.h"
#include "views/kernels.h"

namespace pounce::views {

/// How a grid's views are sharpened.
struct Sharpening {
  static constexpr int kMostReach = 8;
  int reach = 0;         ///< radius of the ring in pixels, up to kMostReach; 0: nothing is done
  float most_apart = 0;  ///< in steps of depth: what is more is another surface
  float amount = 0;      ///< of the difference
};
Sharpening sharpening_of(const Grid& grid);

/// A tile's pixels row by row, with room for what a lane reads beside a row.
struct alignas(64) PixelRows {
  static constexpr int kLanes = surface::kLanes,
                       kFirst = kLanes,  ///< of a row
      kEnd = kFirst + (kStoredEdge + kLanes - 1) / kLanes * kLanes, kRow = kEnd + kLanes;
  static_assert(Sharpening::kMostReach <= kLanes);
  /// Where nothing is seen, there or beside the tile.
  static constexpr float kNoDepth = std::numeric_limits<float>::infinity();
  static constexpr std::size_t at(int x, int y) {
    return static_cast<std::size_t>(y * kRow + kFirst + x);
  }
  float colour[3][kStoredEdge * kRow] = {};
  float depth[kStoredEdge * kRow];

  PixelRows();
};

/// Sharpens tiles one after the other; not thread-safe.
class Sharpener {
 public:
  Sharpener(const Sharpening& how, const ViewKernels& kernels) : how_(how), kernels_(&kernels) {}
  /// What a tile shows, all pixels of it written before sharpened().
  PixelRows& pixels() { return pixels_; }
  /// Valid until the next call.
  const PixelRows& sharpened();

 private:
  Sharpening how_;
  const ViewKernels* kernels_;
  PixelRows pixels_, sharpened_;
};

}  // namespace pounce::views
