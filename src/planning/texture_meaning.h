// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>

#include "mesh/mesh.h"
#include "pounce/options.h"
#include "shading/texel_input.h"

namespace pounce::planning {

/// Whether a map of this name usually is colour (diffuse, specular, ...) or data (displacement,
/// mask, ...), whatever the case of its letters and with or without - and _. Nothing: the name says
/// neither.
std::optional<bool> usually_colour(const std::string& name);

/// Data is never converted between sRGB coding and linear light. A map whose name says nothing is
/// data.
bool is_colour(const TransferOptions& options, Channel channel);

// --- factors -------------------------------------------------------------------------------------

/// What a material makes of its texture in a channel; nothing where it leaves it as it is.
std::optional<shading::Factor> texture_factor(const mesh::Material& material, Channel channel);

/// The same as the factor of a glTF material may be (io::ModelTexture::factor): 0..1, more light as
/// emissive strength, which is the fourth.
std::array<float, 4> material_factor(const mesh::Material& material, Channel channel);
/// The same of a material that becomes one with others: its alpha is its opacity, whatever its mode
/// makes of it; without metal where its file says nothing of that; dark where it does not shine.
std::array<float, 4> merged_factor(const mesh::Material& material, Channel channel);

}  // namespace pounce::planning
