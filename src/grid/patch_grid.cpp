// SPDX-License-Identifier: Apache-2.0
//
// Grid binning of one batch of source blocks.
//
// A surface leaves most cells of a fine grid empty, and a coarse one has many patches per cell. The
// edge starts at 1.5 times the mean extent of a patch and doubles until cells and entries stay
// within a fixed multiple of the number of patches: that bounds the memory before anything is
// allocated, however uneven the patches are.
//
// A grid lives for one batch of one piece, so building it has to cost less than the search saves:
// two passes over the patches, counting and filling, and no sorting. A tree would adapt to uneven
// patches, but would have to be built for each batch again.
#include "grid/patch_grid.h"

#include <cmath>

namespace pounce::grid {
namespace {

constexpr std::uint64_t kEntriesPerItem = 8;
constexpr std::uint64_t kCellsPerItem = 4;
constexpr std::uint64_t kFreeCells = 64;
constexpr float kMostCellsPerAxis = 1024;
constexpr float kEdgeOverExtent = 1.5F;

}  // namespace

std::uint64_t PatchGrid::most_bytes(std::uint64_t patches) {
  return round_to_pages(patches * sizeof(GridItem)) +
         round_to_pages(patches * kEntriesPerItem * 4) +
         round_to_pages((patches * kCellsPerItem + kFreeCells + 1) * 4);
}

std::array<std::uint16_t, 3> PatchGrid::cell(Vec3f p) const {
  const auto along = [&](float v, float lo, std::uint32_t dim) {
    const float at = (v - lo) * per_cell_;
    return static_cast<std::uint16_t>(std::clamp(at, 0.0F, static_cast<float>(dim - 1)));
  };
  return {along(p.x, region_.lo.x, dims_[0]), along(p.y, region_.lo.y, dims_[1]),
          along(p.z, region_.lo.z, dims_[2])};
}

PatchGrid::Walk::Walk(const PatchGrid& grid, const RayBundle& bundle, float height)
    : origin{bundle.origin.x, bundle.origin.y, bundle.origin.z},
      direction{bundle.direction.x, bundle.direction.y, bundle.direction.z} {
  for (std::size_t k = 1; k < 3; ++k) {
    if (std::abs(direction[k]) > std::abs(direction[axis])) axis = k;
  }
  // Any ray of the bundle is within offset + height * spread of its axis (core/bounds.h); the
  // factor covers the rounding of what follows.
  reach = (bundle.offset + height * bundle.spread) * 1.0001F;
  const std::array<float, 3> start{grid.region_.lo.x, grid.region_.lo.y, grid.region_.lo.z};
  slab_start = start[axis];
  slab_edge = 1 / grid.per_cell_;
}

Box3f PatchGrid::Walk::slab_box(std::uint32_t slab, const Box3f& swept) const {
  if (direction[axis] == 0) return swept;  // normals that cancel out: no axis to follow
  // The axis runs through the slab between these heights, widened by what its rays may lead or lag.
  const float wide = reach + 0.01F * slab_edge;
  const float low = slab_start + static_cast<float>(slab) * slab_edge - wide;
  const float high = slab_start + static_cast<float>(slab + 1) * slab_edge + wide;
  const float t0 = (low - origin[axis]) / direction[axis],
              t1 = (high - origin[axis]) / direction[axis];
  std::array<float, 3> lo{swept.lo.x, swept.lo.y, swept.lo.z},
      hi{swept.hi.x, swept.hi.y, swept.hi.z};
  for (std::size_t k = 0; k < 3; ++k) {
    if (k == axis) continue;
    const float a = origin[k] + t0 * direction[k], b = origin[k] + t1 * direction[k];
    lo[k] = std::max(lo[k], std::min(a, b) - wide);
    hi[k] = std::min(hi[k], std::max(a, b) + wide);
  }
  return {{lo[0], lo[1], lo[2]}, {hi[0], hi[1], hi[2]}};
}

// Also leaves each item's first cell behind, for the cells that were chosen last.
std::uint64_t PatchGrid::count_entries() {
  std::uint64_t entries = 0;
  for (GridItem& item : items_) {
    item.first_cell = cell(item.box.lo);
    const auto last = cell(item.box.hi);
    entries += std::uint64_t{last[0] - item.first_cell[0] + 1U} *
               (last[1] - item.first_cell[1] + 1U) * (last[2] - item.first_cell[2] + 1U);
  }
  return entries;
}

void PatchGrid::choose_cells() {
  double extent = 0;
  for (const GridItem& item : items_) {
    extent += std::max({item.box.hi.x - item.box.lo.x, item.box.hi.y - item.box.lo.y,
                        item.box.hi.z - item.box.lo.z});
  }
  const Vec3f size = region_.hi - region_.lo;
  const float longest = std::max({size.x, size.y, size.z});
  float edge =
      std::max(static_cast<float>(extent / static_cast<double>(items_.size())) * kEdgeOverExtent,
               longest / kMostCellsPerAxis);
  if (!(edge > 0) || !std::isfinite(edge)) edge = 1;
  for (;; edge *= 2) {
    per_cell_ = 1 / edge;
    // An index along an axis has 16 bits.
    const auto dim = [&](float length) {
      return static_cast<std::uint32_t>(
                 std::clamp(length * per_cell_, 0.0F, kMostCellsPerAxis - 1)) +
             1;
    };
    dims_ = {dim(size.x), dim(size.y), dim(size.z)};
    const std::uint64_t cells = std::uint64_t{dims_[0]} * dims_[1] * dims_[2];
    // One cell always ends it: then there are as many entries as patches.
    if (cells == 1 || (cells <= kCellsPerItem * items_.size() + kFreeCells &&
                       count_entries() <= kEntriesPerItem * items_.size())) {
      return;
    }
  }
}

PatchGrid::PatchGrid(std::span<const surface::SourceBlock* const> blocks, const Box3f& region) {
  std::size_t count = 0;
  Box3f bound;
  for (const auto* block : blocks) {
    for (const surface::Patch& patch : block->patches) {
      if (!patch.box.overlaps(region)) continue;
      bound.extend(patch.box);
      ++count;
    }
  }
  if (count == 0) return;
  // Nothing outside both the region asked for and the patches that are there.
  region_ = {{std::max(region.lo.x, bound.lo.x), std::max(region.lo.y, bound.lo.y),
              std::max(region.lo.z, bound.lo.z)},
             {std::min(region.hi.x, bound.hi.x), std::min(region.hi.y, bound.hi.y),
              std::min(region.hi.z, bound.hi.z)}};
  items_.reserve(count);
  for (const auto* block : blocks) {
    for (const surface::Patch& patch : block->patches) {
      if (patch.box.overlaps(region))
        items_.push_back(
            {patch.box, patch.centre, patch.radius, &block->facets[patch.facet], 0, {}});
    }
  }
  choose_cells();
  const std::uint64_t entries = count_entries();
  const std::size_t cells = std::size_t{dims_[0]} * dims_[1] * dims_[2];
  starts_.assign(cells + 1, 0);
  const auto for_each_cell = [&](const GridItem& item, auto&& visit) {
    const auto last = cell(item.box.hi);
    for (std::uint32_t z = item.first_cell[2]; z <= last[2]; ++z) {
      for (std::uint32_t y = item.first_cell[1]; y <= last[1]; ++y) {
        for (std::uint32_t x = item.first_cell[0]; x <= last[0]; ++x) {
          visit((std::size_t{z} * dims_[1] + y) * dims_[0] + x);
        }
      }
    }
  };
  for (const GridItem& item : items_) for_each_cell(item, [&](std::size_t c) { ++starts_[c + 1]; });
  for (std::size_t c = 0; c < cells; ++c) starts_[c + 1] += starts_[c];
  entries_.resize(entries);
  for (std::uint32_t i = static_cast<std::uint32_t>(items_.size()); i-- > 0;) {
    // Filled from the back: each cell's end moves down to its start.
    for_each_cell(items_[i], [&](std::size_t c) { entries_[--starts_[c + 1]] = i; });
  }
  // starts_[c + 1] now holds the start of cell c: shift it into place.
  for (std::size_t c = 0; c < cells; ++c) starts_[c] = starts_[c + 1];
  starts_[cells] = static_cast<std::uint32_t>(entries);
}

}  // namespace pounce::grid
