// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "mesh/mesh.h"
#include "texture/factor.h"

namespace pounce::flow {

/// What a material makes of its texture in a channel; nothing where it leaves it as it is.
std::optional<texture::Factor> texture_factor(const mesh::Material& material, Channel channel);

}  // namespace pounce::flow
