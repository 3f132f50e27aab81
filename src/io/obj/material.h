// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tiny_obj_loader.h>

#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "io/files/asset_folder.h"
#include "io/mesh_warnings.h"
#include "io/obj/mtl_file.h"
#include "mesh/mesh.h"

namespace pounce::io {

/// Reads the MTL files that an OBJ names, and makes mesh materials of theirs as faces use them.
class ObjMaterials : public tinyobj::MaterialReader {
 public:
  /// Images go to `mesh`, which must outlive this, like `warnings`.
  ObjMaterials(const std::string& obj_path, bool allow_external, mesh::Mesh& mesh,
               MeshWarnings& warnings);

  /// Called by tinyobjloader for "mtllib". A missing file is a warning. `materials` stays empty:
  /// what tinyobjloader would keep of each is large.
  bool operator()(const std::string& name, std::vector<tinyobj::material_t>* materials,
                  std::map<std::string, int>* by_name, std::string* warning,
                  std::string* error) override;

  /// Called for "usemtl"; `id` is what by_name says, -1 for a name that no MTL file has.
  void use(const std::string& name, int id);
  /// Index in mesh.materials of the material in use, made when a face needs it first.
  std::uint32_t current();
  /// Says what no MTL file had. To be called once, at the end.
  void finish();

 private:
  struct Loaded {
    MtlMaterial material;
    const std::string* folder;  ///< of its MTL file
  };

  bool read(const std::string& path, std::map<std::string, int>& by_name);
  std::uint32_t make();
  void fill(mesh::Material& out, const Loaded& loaded);
  void bind(mesh::Material& material, Channel channel, const MtlTexture& texture,
            const std::string& folder);
  std::uint32_t image(const std::string& name, const std::string& folder);

  std::string path_;
  AssetFolder folder_;
  mesh::Mesh& mesh_;
  MeshWarnings& warnings_;
  std::map<std::string, bool> libraries_;  ///< by name: could it be read?
  std::set<std::string> folders_;
  std::deque<Loaded> loaded_;                                  // by id
  std::map<std::string, std::uint32_t> images_;                // by path
  std::map<std::pair<int, std::string>, std::uint32_t> made_;  // by (id, name)
  std::pair<int, std::string> in_use_{-1, ""};
  std::optional<std::uint32_t> current_;  ///< what made_ has for in_use_
  std::vector<std::string> unknown_;      ///< names that no MTL file has; the first few
  std::uint64_t unknown_count_ = 0;
};

/// The files that an OBJ's "mtllib NAME" may mean: there and allowed.
std::optional<std::string> material_library(const std::string& obj_path, const AssetFolder& folder,
                                            const std::string& name);

}  // namespace pounce::io
