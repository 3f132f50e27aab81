// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "pounce/options.h"
#include "tiles/colour_store.h"

namespace pounce::projection {

/// One texel's blended channels, 0..1 for integer images, as stored for float ones.
using Blended = std::array<double, 4>;

/// Blends the Gaussians around a hit. `tile` is a decoded colour tile of `image`; (x, y) the hit's
/// texel coordinates from the tile's first texel (apron excluded), -1 <= x, y < 65. noexcept,
/// thread-safe.
///
/// The kernel is the tent (1 - |du|)(1 - |dv|) in the hit Gaussian's texel frame, over the
/// Gaussians of its chart in the image's neighbourhood. Weights are counted in 2^-20 and samples in
/// whole steps (2^-30 of the image's scale for float images), so sums are integers and come out the
/// same in any order.
Blended blend_tent(const tiles::ColourDirectory& image, const std::byte* tile, double x,
                   double y) noexcept;

/// A blend kernel: replaceable, see blend_tent.
using BlendKernel = Blended (*)(const tiles::ColourDirectory&, const std::byte*, double,
                                double) noexcept;

}  // namespace pounce::projection
