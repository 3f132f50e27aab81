// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "io/model/write.h"

namespace pounce::io {

/// Primitives that must not show a written material: it needs UVs that they lack. They get a copy
/// of the material as it was.
struct MaterialCopy {
  std::size_t material = 0;  ///< the original
  std::size_t index = 0;     ///< of the copy
};
/// A primitive that gets another material.
struct PrimitiveMaterial {
  std::size_t mesh = 0, primitive = 0, material = 0;
};

/// Where the new textures go in the arrays of a document.
struct ModelSlots {
  struct Texture {
    std::size_t texture = 0, image = 0;
    std::optional<std::size_t> view;  ///< of a .glb, the buffer view that becomes the new image's
  };
  std::vector<Texture> textures;  ///< by ModelRequest::textures
  std::vector<MaterialCopy> copies;
  std::vector<PrimitiveMaterial> primitives;
  /// Buffer views whose bytes nobody needs any more, sorted. Some of them have a new use.
  std::vector<std::size_t> free_views;
};

/// Decides it. A slot is used again only when nothing else in the document refers to it; extensions
/// and extras that are not known here are taken to refer to every number they hold.
ModelSlots find_slots(const nlohmann::json& document, const ModelRequest& request);

}  // namespace pounce::io
