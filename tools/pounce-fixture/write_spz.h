// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "splat_scene.h"

namespace pounce::fixture {

/// The scene as an SPZ of version 2 in gzip, in constant memory: its attributes, which lie one
/// behind the other, are collected in files beside it. Positions have 20 fractional bits, so that
/// they reach to 8. Throws Error(storage).
void write_spz(const SplatOptions& options, const SplatScene& scene);

}  // namespace pounce::fixture
