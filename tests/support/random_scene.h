// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "pounce/options.h"

namespace pounce::test {

/// A small transfer made from a seed: two curved layers close above each other (in odd scenes they
/// face away from each other), three materials (two image sizes, wrap modes, a texture transform, a
/// constant), a target with another tessellation displaced by about 1 %, sizes that are no multiple
/// of 64. Files go to `folder`; baseColor and, on another image size, metallicRoughness.
/// `options` has source, target, size, search limits; output and resources are the caller's.
TransferOptions make_random_scene(const std::string& folder, std::uint32_t seed);

}  // namespace pounce::test
