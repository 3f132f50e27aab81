// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "store/blocks/splat_block.h"

namespace pounce::gaussian {

/// A disc's standard deviation over the spacing of the points around it
/// (docs/decisions/066-points.md).
inline constexpr float kDiscOverSpacing = 0.7F;

/// Gives the points of a block, which lie together, the size and the orientation that a point cloud
/// does not state: each becomes a flat disc in the plane of its 12 nearest neighbours in the block,
/// or across its own normal if it has one. The spacing is what that many points on so much of a
/// plane have; a point at a border, whose neighbours lie on one side, has a smaller part of it. No
/// disc is larger than four times the block's median: a stray one would cover what is near it. A
/// block whose points all coincide, or with fewer than three, keeps sizes as they are. Values stay
/// rounded for the store. Equal distances are decided by the number in the block.
void make_discs(std::span<store::Splat> block);

}  // namespace pounce::gaussian
