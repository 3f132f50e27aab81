// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/box.h"
#include "core/vec.h"

namespace pounce {

/// Where a job counts positions from, for a source in this box: what is subtracted from all
/// positions, in double precision, while they are read. Zero unless the box is so far away, for its
/// size, that single precision is too coarse there (docs/decisions/042-origin.md): scans at map
/// coordinates. A multiple of a power of two that is about the size of the box, so that
/// subtraction from single precision is exact.
Vec3d origin_for(const Box3f& box);

}  // namespace pounce
