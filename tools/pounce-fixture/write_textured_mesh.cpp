// SPDX-License-Identifier: Apache-2.0
#include "write_textured_mesh.h"

#include <filesystem>
#include <optional>

#include "output_file.h"
#include "write_glb.h"
#include "write_obj.h"

namespace pounce::fixture {

void write_textured_mesh(const MeshFiles& files, const GridMesh& mesh, const RenderSpec& spec,
                         const RenderRow& texture, Paths& written) {
  const bool embeds = files.texture_format == "png" || files.texture_format == "jpg";
  const bool keep_image = files.obj || !embeds;
  const std::string image = files.stem + (keep_image ? "." : ".embedding.") + files.texture_format;
  std::optional<RemoveAtEnd> remove_image;
  if (!keep_image) remove_image.emplace(image);
  render_image(image, spec, texture);
  if (keep_image) written.push_back(image);
  if (files.glb) {
    GlbWriter glb;
    const int bound = embeds ? static_cast<int>(glb.add_embedded_texture(image)) : -1;
    const auto material = static_cast<int>(glb.add_material("skin", bound));
    glb.add_mesh(std::filesystem::path(files.stem).filename().string());
    glb.add_primitive(mesh, material);
    glb.write(files.stem + ".glb");
    written.push_back(files.stem + ".glb");
  }
  if (files.obj) {
    write_obj(files.stem + ".obj", mesh, std::filesystem::path(image).filename().string());
    written.insert(written.end(), {files.stem + ".obj", files.stem + ".mtl"});
  }
}

void write_plain_mesh(const MeshFiles& files, const GridMesh& mesh, Paths& written) {
  if (files.glb) {
    GlbWriter glb;
    glb.add_mesh(std::filesystem::path(files.stem).filename().string());
    glb.add_primitive(mesh, -1);
    glb.write(files.stem + ".glb");
    written.push_back(files.stem + ".glb");
  }
  if (files.obj) {
    write_obj(files.stem + ".obj", mesh, "");
    written.push_back(files.stem + ".obj");
  }
}

}  // namespace pounce::fixture
