// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "core/hash.h"
#include "planning/plan.h"

namespace pounce::planning {

/// Are a mesh's colours blended in linear light? As the images hold them: if any of them is linear.
bool texels_are_linear(const SourcePlan& plan);

/// What a page of the mesh has in a channel; `columns` are the keys of the plan's.
void add_page(const PageTexture& page, const std::vector<Hash128>& columns, Hasher& hash);
void add_tile_set(const TileSetPlan& set, const std::vector<Hash128>& columns, Hasher& hash);

}  // namespace pounce::planning
