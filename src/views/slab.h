// SPDX-License-Identifier: Apache-2.0
//
// The ellipses of a tile, handed out front to back.
//
// Blocks of Gaussians come from the nearest to the farthest. What lies before all blocks that are
// still to come may be drawn at once; when it hides the rest, the rest is never read. Where more is
// waiting than memory holds, the farthest are forgotten, and the blocks that have them come again:
// as many slabs of depth as it takes, and the same picture.
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/page_pool.h"

namespace pounce::views {

/// Which Gaussian is before which: by depth, then as the store has them.
struct Order {
  std::uint32_t depth = 0;  ///< rises with the depth of the mean
  std::uint64_t number = 0;
  auto operator<=>(const Order&) const = default;
};

/// Ends included.
struct DepthRange {
  std::uint32_t nearest = 0, farthest = 0;
};

/// Behind everything.
inline constexpr std::uint32_t kNoEnd = 0xFFFFFFFF;

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
};

/// The next ellipses of a tile.
class Slab {
 public:
  /// Holds up to twice as many while they come: most_bytes().
  explicit Slab(std::size_t most);
  static std::uint64_t most_bytes(std::size_t most);

  void clear();  ///< another tile: all may come, from its nearest block on

  /// Is it behind what was drawn and, as far as is known, among the next?
  bool wants(const Order& order) const { return after_ < order && order < below_; }
  /// Of all in a block, does it want some?
  bool wants(const DepthRange& depths) const {
    return depths.farthest >= after_.depth && depths.nearest <= below_.depth;
  }
  void add(const Ellipse& ellipse);

  /// Is it worth drawing before more come?
  bool is_full() const { return ellipses_.size() >= full_; }
  /// Those nearer than whatever comes; kNoEnd: nothing comes. In their order, drawn by the caller
  /// before it calls drop().
  std::span<const Ellipse* const> nearer_than(std::uint32_t depth);
  void drop();  ///< what nearer_than() gave

  /// All blocks have come, and what they had is drawn. True: some was forgotten; they come again.
  bool again();

 private:
  struct Place {
    std::uint32_t depth;
    std::uint32_t at;
  };
  void cut();
  void sort_places();

  const std::size_t most_;
  std::size_t full_ = 0;
  PageVector<Ellipse> ellipses_;
  PageVector<Place> places_, others_;
  PageVector<const Ellipse*> sorted_;
  Order after_{}, below_{};  ///< drawn; forgotten
};

}  // namespace pounce::views
