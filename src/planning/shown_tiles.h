// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "mesh/touched_tiles.h"
#include "planning/plan.h"

namespace pounce::planning {

/// By SourcePlan::columns the tiles that are kept; null: all.
using WantedTiles = std::vector<std::shared_ptr<const mesh::TileMask>>;
/// The tiles that the source's triangles show, of the images of which that is less than half.
WantedTiles little_shown(const SourcePlan& plan);
/// Do targets of so many texels see the source from so far that most lookups are in levels, which
/// are made of whole images?
bool is_seen_from_afar(const SourcePlan& plan, std::uint64_t target_texels);

}  // namespace pounce::planning
