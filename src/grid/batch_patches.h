// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/bounds.h"
#include "grid/patch_grid.h"
#include "surface/source_block.h"

namespace pounce::grid {

/// Patches as spheres in arrays, so that sixteen are culled at once (projection/hit_packet.h).
class PatchSpheres {
 public:
  void clear() { count_ = 0; }
  void reserve(std::size_t count);
  void add(Vec3f centre, float radius, const surface::Facet* facet);
  /// Those of another list at these places, instead of what there is.
  void take(const PatchSpheres& from, std::span<const std::uint16_t> places);
  std::size_t size() const { return count_; }
  const float* x(std::size_t i) const { return centre_[0].data() + i; }
  const float* y(std::size_t i) const { return centre_[1].data() + i; }
  const float* z(std::size_t i) const { return centre_[2].data() + i; }
  const float* radius(std::size_t i) const { return radius_.data() + i; }
  const surface::Facet& facet(std::size_t i) const { return *facets_[i]; }

 private:
  std::size_t count_ = 0;
  std::array<std::vector<float>, 3>
      centre_;  // always whole registers; what lies beyond count_ is never read
  std::vector<float> radius_;
  std::vector<const surface::Facet*> facets_;
};

/// The patches of one batch of source blocks that overlap a region, for a search to find: few as a
/// list, which is gone through faster than cells are; many in a grid. What is found is the same.
/// The blocks must outlive it.
class BatchPatches {
 public:
  static constexpr std::size_t kMostListed = 512;

  /// More patches than `most_listed`, at most kMostListed, are in a grid.
  BatchPatches(std::span<const surface::SourceBlock* const> blocks, const Box3f& region,
               std::size_t most_listed = kMostListed);

  /// Bytes that so many patches take at most.
  static std::uint64_t most_bytes(std::uint64_t patches) { return PatchGrid::most_bytes(patches); }

  const PatchSpheres& list() const { return list_; }  ///< empty where there is a grid
  PatchGrid* grid() { return grid_ ? &*grid_ : nullptr; }

 private:
  PatchSpheres list_;
  std::optional<PatchGrid> grid_;
};

}  // namespace pounce::grid
