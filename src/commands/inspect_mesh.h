// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/vec.h"
#include "io/image/read.h"
#include "mesh/mesh.h"
#include "pounce/options.h"

namespace pounce::commands {

/// The double with the fewest digits that names this float: JSON writes it as short as that.
inline double shortest(float value) {
  return std::strtod(fmt::format("{}", value).c_str(), nullptr);
}

/// What a mesh holds: counts, bounding box, names of its parts, UV sets with their ranges and UDIM
/// tiles, materials with all their textures, those that no channel takes among them. Images that
/// cannot be read are named with their problem; nothing is thrown for them. `origin` was subtracted
/// from its positions. `trust`: as in TransferOptions.
nlohmann::ordered_json describe(const mesh::Mesh& mesh, Vec3d origin = {},
                                const ImageTrust& trust = {});
/// That description for people.
std::string mesh_text(const nlohmann::ordered_json& description);

nlohmann::ordered_json describe(const io::ImageInfo& info);
/// "1024 x 1024, 3 channels, u8, png".
std::string image_text(const nlohmann::ordered_json& description);

}  // namespace pounce::commands
