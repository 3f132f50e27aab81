// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

#include "core/box.h"
#include "core/page_pool.h"
#include "source/source_block.h"

namespace pounce::grid {

/// A patch in the grid: what a packet of texels meets.
struct GridItem {
  Box3f box;
  const source::Facet* facet = nullptr;
  std::array<std::uint16_t, 3> first_cell{};
};

/// A uniform grid over a region of space that says which patches touch which cell. Only speeds the
/// search up: every patch whose box overlaps a query is visited, exactly once, whatever the cells
/// are.
class PatchGrid {
 public:
  /// Bins the patches that overlap `region`. The blocks must outlive the grid.
  PatchGrid(std::span<const source::SourceBlock* const> blocks, const Box3f& region);

  /// Bytes a grid of so many patches takes at most.
  static std::uint64_t most_bytes(std::uint64_t patches);

  /// Calls visit(item) for every patch whose box overlaps `query`.
  template <class Visit>
  void query(const Box3f& query, Visit&& visit) const {
    if (items_.empty() || !query.overlaps(region_)) return;
    const auto lo = cell(query.lo), hi = cell(query.hi);
    for (std::uint32_t z = lo[2]; z <= hi[2]; ++z) {
      for (std::uint32_t y = lo[1]; y <= hi[1]; ++y) {
        for (std::uint32_t x = lo[0]; x <= hi[0]; ++x) {
          const std::size_t c = (std::size_t{z} * dims_[1] + y) * dims_[0] + x;
          for (std::uint32_t i = starts_[c]; i < starts_[c + 1]; ++i) {
            const GridItem& item = items_[entries_[i]];
            // Of all cells that item and query share, only the first one reports it.
            if (x != std::max<std::uint32_t>(item.first_cell[0], lo[0]) ||
                y != std::max<std::uint32_t>(item.first_cell[1], lo[1]) ||
                z != std::max<std::uint32_t>(item.first_cell[2], lo[2])) {
              continue;
            }
            if (item.box.overlaps(query)) visit(item);
          }
        }
      }
    }
  }

 private:
  std::array<std::uint16_t, 3> cell(Vec3f p) const;
  void choose_cells();
  std::uint64_t count_entries();

  Box3f region_;
  std::array<std::uint32_t, 3> dims_{1, 1, 1};
  float per_cell_ = 0;  ///< 1 / cell edge
  PageVector<GridItem> items_;
  PageVector<std::uint32_t> starts_;   ///< per cell, and one more
  PageVector<std::uint32_t> entries_;  ///< item indices, cell after cell
};

}  // namespace pounce::grid
