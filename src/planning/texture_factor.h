// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>

#include "mesh/mesh.h"
#include "shading/factor.h"

namespace pounce::planning {

/// What a material makes of its texture in a channel; nothing where it leaves it as it is.
std::optional<shading::Factor> texture_factor(const mesh::Material& material, Channel channel);

/// The same as the factor of a glTF material may be (io::ModelTexture::factor): 0..1, more light as
/// emissive strength, which is the fourth.
std::array<float, 4> material_factor(const mesh::Material& material, Channel channel);

}  // namespace pounce::planning
