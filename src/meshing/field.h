// SPDX-License-Identifier: Apache-2.0
//
// Where the surface of a scene is, from what its views show: a truncated signed distance, averaged
// over the views, on the corners of equal cubes (Curless and Levoy 1996).
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>

#include "core/bounds.h"
#include "core/page_pool.h"
#include "core/vec.h"
#include "meshing/surface.h"
#include "views/grid.h"

namespace pounce::meshing {

/// Distances beyond so many cells say nothing more than on which side a place is: views of one
/// place differ by a few.
inline constexpr float kTruncation = 5;

/// The corners of a box of cubes.
struct Lattice {
  Vec3f low;
  float cell = 1;
  std::array<std::uint32_t, 3> corners{};  ///< along each axis, at least 2

  /// Of cubes, so many of which are the longest side of `box`.
  Lattice(const Box3f& box, std::uint32_t cells);
  std::uint64_t count() const { return std::uint64_t{corners[0]} * corners[1] * corners[2]; }
  std::uint64_t index(std::uint32_t x, std::uint32_t y, std::uint32_t z) const {
    return (std::uint64_t{z} * corners[1] + y) * corners[0] + x;
  }
  Vec3f place(std::uint32_t x, std::uint32_t y, std::uint32_t z) const {
    return low + Vec3f{static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)} * cell;
  }
};

/// What a view shows: edge() rows of depths, in the grid's steps; views::kNoDepth: nothing.
struct DepthView {
  std::uint32_t view = 0;
  std::span<const std::uint16_t> depths;
};

/// Corners of a lattice that are air: outside of what is solid, and reached from one place.
class Air {
 public:
  /// From this place on.
  Air(const Lattice& lattice, Vec3f start)
      : lattice_(lattice), start_(start), has_(lattice.count()) {}
  static std::uint64_t bytes(const Lattice& lattice) { return round_to_pages(lattice.count()); }

  Vec3f start() const { return start_; }
  /// Is the corner nearest to a place air? Nowhere beyond the lattice.
  bool has(Vec3f place) const;
  bool has(std::uint64_t corner) const { return has_[corner] != 0; }
  void add(std::uint64_t corner) { has_[corner] = 1; }

 private:
  Lattice lattice_;
  Vec3f start_;
  PageVector<std::uint8_t> has_;
};

/// Forgets what a view from within shows where it begins outside of the air.
void forget_solid(const views::Grid& grid, const Air& air, std::uint32_t view,
                  std::span<std::uint16_t> depths);

class Field {
 public:
  explicit Field(const Lattice& lattice);
  static std::uint64_t bytes(const Lattice& lattice);

  const Lattice& lattice() const { return lattice_; }
  /// What a view says of layers [first, last) along z. Layers of one view may be added side by
  /// side; sums are whole numbers, so views come in any order.
  void add(const views::Grid& grid, const DepthView& view, std::uint32_t first, std::uint32_t last);
  void clear();  ///< as if no view had been added
  /// What is farther outside than `cells` (below kTruncation) and hangs together with the corner
  /// nearest to a place that is. Nothing where no corner is. `poll` is called often and may throw.
  std::optional<Air> air_around(
      Vec3f place, float cells, const std::function<void()>& poll = [] {}) const;
  /// All that is not air counts as inside from here on, where some view has seen it.
  void keep_air(const Air& air);
  /// What no view has seen counts as inside from here on: nothing stays open there.
  void close();
  /// No more triangles than that has surface().
  std::uint64_t most_triangles() const;
  /// The surface between what lies outside and what lies inside, by surface nets (Gibson 1998): a
  /// vertex for each sheet of it that passes a cell (Nielson, "Dual Marching Cubes", 2004), two
  /// triangles per edge, counter-clockwise from outside. Only where some view has seen all corners
  /// of a cell.
  Surface surface() const;

 private:
  static constexpr float kSteps = 100;  ///< of the truncated distance

  bool is_outside(std::uint64_t at) const { return sums_[at] > 0; }
  float value(std::uint64_t at) const {
    return static_cast<float>(sums_[at]) / static_cast<float>(seen_[at]);
  }

  const Lattice lattice_;
  PageVector<std::int32_t> sums_;   ///< of distances, in steps; positive outside
  PageVector<std::uint16_t> seen_;  ///< by so many views
};

}  // namespace pounce::meshing
