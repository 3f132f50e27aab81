// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/bounds.h"
#include "store/blocks/splat_block.h"

namespace pounce::gaussian {

/// The numbers of the Gaussians whose ellipsoids, out to the cut-off, some of the boxes may meet.
/// Of a block whose own box meets none of them, none.
void find_near(const store::SplatBlock& block, std::span<const Box3f> boxes,
               std::vector<std::uint16_t>& near);

}  // namespace pounce::gaussian
