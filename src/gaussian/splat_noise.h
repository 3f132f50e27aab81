// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "store/blocks/splat_block.h"

namespace pounce::gaussian {

/// How far Gaussians lie from the surface that their neighbours make, for up to 32 Gaussians of a
/// block spread evenly over it: 1.4826 times the median absolute deviation of the offsets of its 16
/// nearest neighbours in the block along its normal (the file's, else its shortest axis). For
/// normal noise that is its standard deviation. Appends one figure per Gaussian; none for blocks of
/// fewer than 17.
void append_surface_noise(const store::SplatBlock& block, std::vector<float>& figures);

/// The median; 0 if there are none. Reorders `figures`.
float median(std::vector<float>& figures);

}  // namespace pounce::gaussian
