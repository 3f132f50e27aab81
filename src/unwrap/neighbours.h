// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/vec.h"
#include "unwrap/unwrap.h"

namespace pounce::unwrap {

inline constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

/// For each of three edges of each triangle, from its corner k to the next one: the triangle beyond
/// it, or kNone. Neighbours go along their edge each in its own direction; of more than two at an
/// edge, as where two sheets touch, those that face most alike are neighbours. Two that lie back to
/// back and share two edges are not: no plane has room for both around their vertex.
std::vector<std::uint32_t> find_neighbours(std::span<const Triangle> triangles,
                                           std::span<const Vec3d> normals);

}  // namespace pounce::unwrap
