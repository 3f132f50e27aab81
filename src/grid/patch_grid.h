// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <utility>

#include "core/bounds.h"
#include "core/page_pool.h"
#include "surface/source_block.h"

namespace pounce::grid {

/// A patch in the grid: what a packet of texels meets.
struct GridItem {
  Box3f box;
  Vec3f centre;  ///< of a sphere that holds every hit that counts
  float radius = 0;
  const surface::Facet* facet = nullptr;
  std::uint32_t seen_by = 0;  ///< the last query that came across it
  std::array<std::uint16_t, 3> first_cell{};
};

/// A uniform grid over a region of space that says which patches touch which cell. Only speeds the
/// search up: every patch whose box overlaps a query is visited, exactly once, whatever the cells
/// are.
class PatchGrid {
 public:
  /// Bins the patches that overlap `region`. The blocks must outlive the grid.
  PatchGrid(std::span<const surface::SourceBlock* const> blocks, const Box3f& region);

  /// Bytes a grid of so many patches takes at most.
  static std::uint64_t most_bytes(std::uint64_t patches);

  /// Calls visit(item), once each, for every patch that a ray of the bundle may meet within
  /// `height`, and perhaps for a few more. Walks the cells along the bundle: its box would hold
  /// mostly cells that no ray touches.
  template <class Visit>
  void query(const RayBundle& bundle, float height, Visit&& visit) {
    Box3f swept = bundle.swept_box(height);
    if (items_.empty() || !swept.overlaps(region_)) return;
    ++query_;
    const auto lo = cell(swept.lo), hi = cell(swept.hi);
    const Walk walk(*this, bundle, height);
    for (std::uint32_t slab = lo[walk.axis]; slab <= hi[walk.axis]; ++slab) {
      const Box3f part = walk.slab_box(slab, swept);
      auto from = cell(part.lo), to = cell(part.hi);
      from[walk.axis] = to[walk.axis] = static_cast<std::uint16_t>(slab);
      visit_cells(from, to, bundle, height, visit);
    }
  }

 private:
  using Cell = std::array<std::uint16_t, 3>;

  /// A bundle cut into slabs of cells along the axis that it follows most.
  struct Walk {
    Walk(const PatchGrid& grid, const RayBundle& bundle, float height);
    /// Holds what the bundle sweeps inside one slab.
    Box3f slab_box(std::uint32_t slab, const Box3f& swept) const;

    std::size_t axis = 0;
    std::array<float, 3> origin, direction;
    float reach = 0;  ///< of any ray from the axis
    float slab_start = 0, slab_edge = 0;
  };

  template <class Visit>
  void visit_cells(const Cell& from, const Cell& to, const RayBundle& bundle, float height,
                   Visit&& visit) {
    for (std::uint32_t z = from[2]; z <= to[2]; ++z) {
      for (std::uint32_t y = from[1]; y <= to[1]; ++y) {
        const std::size_t row = (std::size_t{z} * dims_[1] + y) * dims_[0];
        for (std::uint32_t i = starts_[row + from[0]]; i < starts_[row + to[0] + 1]; ++i) {
          GridItem& item = items_[entries_[i]];
          if (item.seen_by == query_) continue;  // in an earlier cell
          item.seen_by = query_;
          if (bundle.may_meet(item.centre, item.radius, height)) visit(std::as_const(item));
        }
      }
    }
  }

  Cell cell(Vec3f p) const;
  void choose_cells();
  std::uint64_t count_entries();

  Box3f region_;
  std::uint32_t query_ = 0;
  std::array<std::uint32_t, 3> dims_{1, 1, 1};
  float per_cell_ = 0;  ///< 1 / cell edge
  PageVector<GridItem> items_;
  PageVector<std::uint32_t> starts_;   ///< per cell, and one more
  PageVector<std::uint32_t> entries_;  ///< item indices, cell after cell
};

}  // namespace pounce::grid
