// SPDX-License-Identifier: Apache-2.0
//
// A textured model as a viewer shows it, with its base colour and its normal map.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "image.h"
#include "mesh/mesh.h"
#include "picture.h"

namespace pounce::score {

struct Model {
  mesh::Mesh mesh;  ///< with tangents where a material has a normal map
  struct Textures {
    std::optional<Image> colour, normal;
  };
  std::vector<Textures> materials;
};

/// Throws pounce::Error.
Model read_model(const std::string& path);

/// The model from a side, as see_mesh() draws it: base colour without factors, or, `lit`, that
/// under a lamp from the upper right behind the camera.
Seen see_model(const Model& model, const View& view, std::uint32_t finer, bool lit);

}  // namespace pounce::score
