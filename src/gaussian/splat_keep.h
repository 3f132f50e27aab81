// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/bounds.h"
#include "core/hash.h"
#include "mesh/mesh.h"
#include "store/blocks/splat_store.h"

namespace pounce::gaussian {

/// Which places lie near a target's surface: a lattice of 64 cells along the longest side of its
/// box, grown by a distance. It says yes too often, never too seldom. 32 KiB. Const members are
/// thread-safe.
class NearSurface {
 public:
  /// `distance`: in the mesh's units. Every triangle counts.
  NearSurface(const mesh::Mesh& target, double distance);

  /// Does the box come within the distance of the surface?
  bool meets(const Box3f& box) const;
  void add_to(Hasher& hash) const;

 private:
  static constexpr int kCells = 64;
  using Cell = std::array<int, 3>;
  Cell cell_of(Vec3f at) const;

  Box3f box_;                        ///< of the surface, grown
  float cell_ = 1;                   ///< edge; infinite where the distance reaches everywhere
  std::vector<std::uint64_t> rows_;  ///< of cells along x: bit x of rows_[64 z + y]
};

/// Which Gaussians of a scene its user wants. Empty members let everything through.
struct SplatKeep {
  std::optional<float> min_alpha;
  std::optional<float> max_sigma;                        ///< in the scene's units
  std::optional<Box3f> box;                              ///< of means, after --source-axes
  std::vector<std::shared_ptr<const NearSurface>> near;  ///< any of them; none: everywhere
  /// Of a scene that is written as a file: what is far away from all the rest goes. A store leaves
  /// that out by itself, and its key does not depend on this.
  std::optional<store::SplatLattice> lattice = {};

  /// Why a Gaussian is left out, if it is.
  std::optional<store::SplatFilter> filter(const store::Splat& splat) const;
  /// For the keys of stores.
  void add_to(Hasher& hash) const;
};

}  // namespace pounce::gaussian
