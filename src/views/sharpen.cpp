// SPDX-License-Identifier: Apache-2.0
#include "views/sharpen.h"

#include <algorithm>
#include <iterator>

namespace pounce::views {
namespace {

/// Of the region's diagonal.
constexpr float kRingRadius = 0.005F;
/// Of the ring's radius: surfaces that lean by up to 63 degrees count as one.
constexpr float kMostApart = 2;
constexpr float kAmount = 0.44F;

}  // namespace

Sharpening sharpening_of(const Grid& grid) {
  const float radius = grid.diagonal() * kRingRadius;
  const int reach = static_cast<int>(std::min(radius / grid.pixel(), 1e3F) + 0.5F);
  return {std::min(reach, Sharpening::kMostReach), grid.in_steps(kMostApart * radius), kAmount};
}

const PixelRows& Sharpener::sharpened() {
  if (how_.reach == 0) return pixels_;
  kernels_->sharpen(pixels_, how_, sharpened_);
  return sharpened_;
}

PixelRows::PixelRows() { std::fill(std::begin(depth), std::end(depth), kNoDepth); }

}  // namespace pounce::views
