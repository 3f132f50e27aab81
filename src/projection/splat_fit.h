// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/vec.h"
#include "pounce/report.h"
#include "projection/splat_blend.h"

namespace pounce::projection {

/// A place of a target's surface that found the scene's: where it is, and how far away that lies.
struct FoundPlace {
  Vec3f position;
  double distance = 0;  ///< in space, positive outside
};

/// Of a target and the scene that its places found.
struct SplatFit {
  /// How well the scene lies at the target: kLeastFit..1, or less where only a few places found it
  /// at all; 0 where it does not.
  double fit = 0;
  double distance = 0;  ///< of nine places in ten the scene lies no farther away; in space
  double middle = 0;    ///< the median of the distances found; in space, positive outside
  double spread = 0;    ///< nine places in ten lie no farther from that; in space
};

/// How far lengths are looked for and from where on they are too far. In space.
struct FitLengths {
  double reach = 0;  ///< of the places
  double usual = 0;  ///< the same, were they not held back: beyond a part of that a scene lies off
};

/// Either the places that found a surface found it at about one distance that is not large, or
/// nearly all of `places` found one, and over regions it lies near.
SplatFit fit_of(std::span<const FoundPlace> found, std::size_t places, const FitLengths& lengths);

/// What places that have been blended found: the first lane of each packet.
std::vector<FoundPlace> found_places(const SplatLimits& limits, const SplatState& state);

}  // namespace pounce::projection
