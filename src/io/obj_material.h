// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tiny_obj_loader.h>

#include <map>
#include <string>
#include <vector>

#include "mesh/mesh.h"

namespace pounce::io {

/// Reads the MTL files that an OBJ names, and makes mesh materials of theirs as faces use them.
class ObjMaterials : public tinyobj::MaterialReader {
 public:
  /// Messages and images go to `mesh`, which must outlive this.
  ObjMaterials(const std::string& obj_path, mesh::Mesh& mesh);

  /// Called by tinyobjloader for "mtllib". A missing file is a warning.
  bool operator()(const std::string& name, std::vector<tinyobj::material_t>* materials,
                  std::map<std::string, int>* by_name, std::string* warning,
                  std::string* error) override;

  /// Called for "usemtl"; `id` is tinyobjloader's, -1 for a name that no MTL file has.
  void use(const std::string& name, int id);
  /// Index in mesh.materials of the material in use, made when a face needs it first.
  std::uint32_t current();

 private:
  std::uint32_t make();
  void bind(mesh::Material& material, Channel channel, const std::string& texture,
            const tinyobj::texture_option_t& options, const std::string& folder);
  std::uint32_t image(const std::string& name, const std::string& folder);

  struct Loaded {
    tinyobj::material_t material;
    std::string folder;
  };
  std::string path_;
  mesh::Mesh& mesh_;
  std::vector<Loaded> loaded_;
  std::map<std::string, std::uint32_t> images_;                // by path
  std::map<std::pair<int, std::string>, std::uint32_t> made_;  // by (id, name)
  std::pair<int, std::string> in_use_{-1, ""};
};

}  // namespace pounce::io
