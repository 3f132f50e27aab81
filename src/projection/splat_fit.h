// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "projection/splat_blend.h"

namespace pounce::projection {

/// How well a scene lies at a target, 0..1, by places all over it that have looked for the scene:
/// `distances` are of those that found a surface, of `places` in all, within `reach`. Either nearly
/// all of them find one, or those that do find it at about one distance.
/// Replaces the order of `distances`.
double fit_of(std::span<double> distances, std::size_t places, double reach);

/// The same of places that have been blended: the first lane of each packet.
double fit_of(const SplatLimits& limits, const SplatState& state);

}  // namespace pounce::projection
