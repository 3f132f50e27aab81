// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "io/model/model_writer.h"
#include "io/read_mesh.h"
#include "support/gltf_builder.h"
#include "support/model_files.h"
#include "support/test_data.h"

namespace pounce::test {

inline const std::string kOldImage = "\x89PNG\r\n\x1a\n" + std::string(93, 'o');
inline const std::string kNewImage = "\x89PNG\r\n\x1a\n" + std::string(50, 'n');
inline const std::string kOther = "\x89PNG\r\n\x1a\n" + std::string(33, 'x');

/// A triangle with UVs, one material and its baseColor image in the buffer, in front of the UVs.
inline GltfBuilder textured() {
  GltfBuilder b;
  auto& primitive = b.triangle();
  const int image = b.view(kOldImage);
  primitive["attributes"]["TEXCOORD_0"] = b.add<float>({0, 0, 1, 0, 0, 1}, "VEC2");
  primitive["material"] = 0;
  b.doc["images"] = {{{"bufferView", image}, {"mimeType", "image/png"}}};
  b.doc["textures"] = {{{"source", 0}, {"sampler", 0}}};
  b.doc["samplers"] = {{{"wrapS", 33071}}};
  b.doc["materials"] = {{{"name", "skin"},
                         {"alphaMode", "BLEND"},
                         {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
  return b;
}

inline io::ModelTexture base_color(std::uint32_t material) {
  return {material, Channel::base_color, {1, 1, 1, 1}, ""};
}

/// Writes `builder` with these textures (their images: kNewImage and numbers) as a .glb.
inline Glb written(const TempFolder& folder, const GltfBuilder& builder,
                   std::vector<io::ModelTexture> textures, std::uint32_t uv_set = 0) {
  const io::ModelRequest request{builder.write_glb(folder.file("target.glb")),
                                 folder.file("out.glb"), uv_set, textures};
  std::vector<std::string> images;
  for (std::size_t k = 0; k < textures.size(); ++k) images.push_back(kNewImage + std::to_string(k));
  FakeImages(images).write(request);
  io::read_mesh(request.output);  // is valid
  return Glb(request.output);
}

inline std::string geometry(const mesh::Mesh& m) {
  std::string all;
  const auto add = [&](const auto& values) {
    all.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(values[0]));
  };
  add(m.positions), add(m.normals), add(m.tangents), add(m.triangles), add(m.triangle_material);
  for (const auto& set : m.uv_sets) add(set);
  return all;
}

}  // namespace pounce::test
