// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "core/bounds.h"
#include "surface/target_block.h"

namespace pounce::projection {

/// The bundle of a packet's used lanes.
RayBundle bundle_of(const surface::TexelPacket& packet);
/// A bundle that holds all of these (at least one).
RayBundle unite(std::span<const RayBundle> bundles);

}  // namespace pounce::projection
