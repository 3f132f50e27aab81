// SPDX-License-Identifier: Apache-2.0
//
// A tree of spheres over a block of Gaussians, which culls sixteen at once. It has no pointers: the
// store orders Gaussians along a curve, so that sixteen in a row lie together, and sixteen times
// sixteen, too. Spheres only cull: each is a little too large rather than too small, and what they
// let through is decided again by the Gaussian's own ellipse.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/page_pool.h"

namespace pounce::gaussian {

/// Responses beyond so many standard deviations weigh exactly nothing.
inline constexpr float kSplatCutOff = 3;
/// Spheres of the tree are a little larger than what they hold: culling them decides nothing that
/// culling the Gaussians would not.
inline constexpr float kSphereMargin = 1.0001F;

/// Spheres below one of the next level, and lanes of a register.
inline constexpr std::size_t kFanOut = 16;
constexpr std::size_t whole_registers(std::size_t count) {
  return (count + kFanOut - 1) / kFanOut * kFanOut;
}

/// Spheres that hold Gaussians out to their cut-off (without a texel's footprint), in arrays, so
/// that sixteen are culled at once. Always whole registers.
struct SplatSpheres {
  std::array<PageVector<float>, 3> centre;
  PageVector<float> radius;
  std::size_t count = 0;
};

/// Level 0 of the tree are the Gaussians; sphere i of level k + 1 holds spheres 16 i to 16 i + 15
/// of level k.
using SplatTree = std::array<SplatSpheres, 3>;

void resize(SplatSpheres& spheres, std::size_t count);
/// Makes what is above level 0.
void make_levels(SplatTree& tree);
/// Of a tree over so many Gaussians.
std::uint64_t tree_bytes(std::uint64_t splats);

}  // namespace pounce::gaussian
