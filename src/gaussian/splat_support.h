// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "store/blocks/splat_block.h"

namespace pounce::gaussian {

/// Fades the Gaussians of a block that have hardly any others around them: floaters. One with fewer
/// than four neighbours within the block's usual spacing and its own largest standard deviation
/// keeps a quarter of its opacity for each, a 64th without any. Neighbours are looked for among the
/// 32 before and after it in the store's order, which lie near. Blocks of fewer than 17 stay as
/// they are. Values stay rounded for the store.
void fade_isolated(std::span<store::Splat> block);

}  // namespace pounce::gaussian
