// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/vec.h"

namespace pounce::io {

/// Cuts a polygon of n corners into n - 2 triangles with the same winding; entries are positions in
/// `corners`. Convex ones become a fan around corner 0; others lose one ear after the other, seen
/// along the polygon's mean normal. A polygon that crosses itself, or has more than 1000 corners
/// and is not convex, becomes a fan too.
std::vector<std::array<std::uint32_t, 3>> triangulate(std::span<const Vec3f> corners);

}  // namespace pounce::io
