// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "meshing/uv_cover.h"
#include "meshing/wedges.h"

namespace pounce::meshing {

/// The textures of a surface, by material, each with so many texels (above 0) along its sides;
/// fewer where triangles lie on it many times over, so that no more than four times these texels
/// are looked at for all of them.
std::vector<UvCover> covers_of(const WedgeSurface& surface, std::uint32_t edge);

/// What collapse() holds at most, with the surface and without the covers.
std::uint64_t collapsing_bytes_of(const WedgeSurface& surface);

/// Simplifies by moving places onto neighbours, all wedges at once, those of the least quadric
/// error first (Garland and Heckbert 1997), that of sliding textures included, until so many
/// triangles are left or the surface would move by more than about `distance`. A seam moves along
/// itself only, and so do borders of materials and of the surface; where several meet, they stay.
/// No triangle turns over, in space or in its texture, and none comes to lie where there are
/// others: `covers` are covers_of() the surface and stay so. What would break this is left out, so
/// more triangles may remain. A place with more than 64 triangles waits until some of them have
/// gone. `poll` is called often and may throw.
void collapse(WedgeSurface& surface, std::vector<UvCover>& covers, std::size_t triangles,
              double distance, const std::function<void()>& poll);

}  // namespace pounce::meshing
