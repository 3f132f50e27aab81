// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/file.h"
#include "pounce/options.h"

namespace pounce::io {

/// What becomes of a material that is OPAQUE: viewers leave its alpha alone.
enum class ModelAlpha { as_it_is, mask, blend };

/// A new texture of a model: one channel of one material.
struct ModelTexture {
  /// As Mesh::materials counts them; one past the file's own is that of primitives without one.
  std::uint32_t material = 0;
  Channel channel = Channel::base_color;
  /// By channel: baseColorFactor rgba; (unused, roughnessFactor, metallicFactor); the strength of
  /// occlusion; emissiveFactor rgb and the emissive strength. Finite.
  std::array<float, 4> factor{1, 1, 1, 1};
  std::string path;                         ///< the PNG file of a .gltf; of a .glb unused
  ModelAlpha alpha = ModelAlpha::as_it_is;  ///< of base colour
};

/// A glTF file with new textures and everything else as it was.
struct ModelRequest {
  std::string target;        ///< .gltf or .glb: what to copy
  std::string output;        ///< .gltf or .glb: the format to write
  std::uint32_t uv_set = 0;  ///< what the new textures were drawn on
  std::vector<ModelTexture> textures;
  bool allow_external = false;  ///< copy files from outside of the target's folder, too
  std::string job = {};         ///< hash of the job, for asset.extras; "" = none
};

/// Is this the name of a model that can be written (.glb, .gltf)?
bool is_model_path(const std::string& path);
bool is_glb_path(const std::string& path);

/// What write_model() will do.
struct ModelPlan {
  std::vector<std::string> outputs;  ///< every file, in the order they are written
  std::vector<std::string> inputs;   ///< every file that is read: none may be an output
  std::vector<std::string> warnings;
  std::uint64_t least_bytes = 0;  ///< memory
};
/// Throws Error(usage) where target or output is no glTF file, Error(input) where a buffer of the
/// target is missing.
ModelPlan plan_model(const ModelRequest& request);

/// Where an encoded image is.
struct EncodedImage {
  std::uint64_t offset_bytes = 0, size_bytes = 0;
};

/// Writes the model. `places` has one PNG file within `images` for each of request.textures.
///
/// A .glb holds all buffers and images; a .gltf gets its buffers and images as files beside it, but
/// data URIs stay. What is replaced and not used elsewhere is dropped. Files appear whole, images
/// and buffers first and the model last; after an error none of them does. Throws Error(usage) when
/// the result is more than a .glb can hold (4 GiB), Error(storage) naming path and reason.
void write_model(const ModelRequest& request, const ReadFile& images,
                 std::span<const EncodedImage> places);

}  // namespace pounce::io
