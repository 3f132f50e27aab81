// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "io/splats/splat_writer.h"
#include "store/blocks/splat_block.h"

namespace pounce::io {

/// An SPZ of version 2, in gzip without a time: 24 bits per coordinate with as many of them behind
/// the point as the scene's extent leaves (20 at most), a byte for everything else.
std::unique_ptr<SplatWriter> open_spz_writer(const std::string& path, const SplatFileFacts& facts,
                                             const ScratchFolder& folder);

/// Names the axes of an ellipsoid anew, so that its rotation turns as little as possible: of the 24
/// ways the one with the largest w, which is 0.85 or more. The ellipsoid stays what it was.
void turn_least(store::Splat& splat);

}  // namespace pounce::io
