// SPDX-License-Identifier: Apache-2.0
//
// What of a source's images a job will look at: which tiles its triangles show, and from how far
// its targets look. Guesses that save work and change no result.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "mesh/lattice.h"
#include "planning/plan.h"
#include "store/blocks/colour_store.h"

namespace pounce::planning {

/// So few tiles are not worth leaving out of an image, nor, of a level that is made when it is
/// asked for, a file in the cache: it is scratch.
inline constexpr std::uint64_t kFewTiles = 16;
inline bool has_few_tiles(const store::ColourDirectory& image) {
  return std::uint64_t{image.tiles_x()} * image.tiles_y() <= kFewTiles;
}

/// By SourcePlan::columns the tiles that are kept; null: all.
using WantedTiles = std::vector<std::shared_ptr<const mesh::TileMask>>;
/// The tiles that the source's triangles show, of the images of which that is less than half.
WantedTiles little_shown(const SourcePlan& plan);

/// How closely the targets of a job look at its source.
struct TargetDetail {
  std::uint64_t least_texels = UINT64_MAX;  ///< in one channel's images, of the target with fewest
  std::vector<double> finest;  ///< by pass: texels per unit of area, of the page with the most
  /// The target's mesh must be there.
  void add(const SourcePlan& source, const TargetPlan& target);
};
/// Do such targets see the source from so far that most lookups are in levels, which are made of
/// whole images?
bool is_seen_from_afar(const SourcePlan& plan, const TargetDetail& targets);
/// By SourcePlan::columns the level below which hardly a lookup falls, kMostSeenLevel at most; 0:
/// the image itself is looked at. Only levels that shading::is_halved_evenly() has. The source's
/// mesh must be there.
std::vector<std::uint32_t> seen_levels(const SourcePlan& plan, const TargetDetail& targets);
inline constexpr std::uint32_t kMostSeenLevel = 6;

}  // namespace pounce::planning
