// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "io/model/layout.h"

namespace pounce::io {

/// An image of the target that is not replaced, at its new place.
struct MovedImage {
  std::string uri;  ///< of a .gltf: its file, as the JSON names it
  std::string mime_type;
  ViewPlace place;  ///< of a .glb
};

/// What becomes of the JSON besides materials and textures.
struct DocumentParts {
  const ModelRequest& request;
  const ModelSlots& slots;
  const ModelBuffers& buffers;
  std::vector<std::string> buffer_uris;  ///< by ModelBuffers::buffers(); "" = the BIN chunk
  std::vector<ViewPlace> image_places;   ///< of a .glb, by ModelRequest::textures
  std::vector<std::string> image_uris;   ///< of a .gltf, by ModelRequest::textures
  std::map<std::size_t, MovedImage> moved_images;
};

/// The target's JSON with the new textures. `text` is what `document` was read from.
std::string edit_model_json(std::string_view text, const nlohmann::json& document,
                            const DocumentParts& parts);

}  // namespace pounce::io
