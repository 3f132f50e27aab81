// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "io/files/asset_file.h"
#include "io/problems.h"
#include "mesh/mesh.h"

namespace pounce::io {

/// A texture of an MTL file, as it is named there.
struct MtlTexture {
  std::string name;  ///< empty: none
  bool clamp = false;
  std::array<double, 2> scale{1, 1}, offset{0, 0};
  float strength = 1;  ///< "-bm": of bumps, and of a normal map
};

/// What counts of one material of an MTL file; white where it says nothing.
struct MtlMaterial {
  std::string name;
  std::array<float, 3> diffuse{1, 1, 1}, emission{0, 0, 0};
  float dissolve = 1;
  /// How "Kd" and "Ke" say a colour that is not read: "xyz" or "spectral"; empty: they do not.
  std::string_view unread_diffuse, unread_emission;
  MtlTexture base_color, emissive, normal;  ///< "map_Kd", "map_Ke", "norm"
  /// Textures that no channel is made of: by statement ("map_Bump"), the name.
  std::vector<std::pair<const char*, std::string>> others;
};

/// Reads the materials one after the other, in the order of the file; what is in memory is one of
/// them. Throws Error(storage) or Error(input).
void read_mtl(const std::string& path, const std::function<void(MtlMaterial&&)>& found);

/// No material names more.
inline constexpr std::size_t kMaxMtlTextures = 13;

/// From one pass over the file.
struct MtlSize {
  std::uint64_t bytes = 0;  ///< that all its materials take until the OBJ is read, at most
  std::uint64_t longest_line_bytes = 0;
  /// Statements that name textures, and their bytes.
  std::uint64_t textures = 0, texture_bytes = 0, longest_texture_bytes = 0;
};
MtlSize mtl_size(const std::string& path);

/// Reads the MTL files that an OBJ names, and makes mesh materials of theirs as faces use them.
class ObjMaterials {
 public:
  /// Images go to `mesh`, which must outlive this, like `warnings`.
  /// `tells`: what the material files lack is told.
  ObjMaterials(const std::string& obj_path, bool allow_external, bool tells, mesh::Mesh& mesh,
               MeshWarnings& warnings);

  /// For "mtllib": of the files that it names, and that none named so before, reads the first that
  /// can be read. One that is missing is a warning.
  void load(const std::string& said);
  /// For "usemtl".
  void use(const std::string& name);
  /// Index in mesh.materials of the material in use, made when a face needs it first.
  std::uint32_t current();
  /// Says what no MTL file had. To be called once, at the end.
  void finish();

 private:
  struct Loaded {
    MtlMaterial material;
    const std::string* folder;  ///< of its MTL file
  };

  bool can_load(const std::string& name);
  void read(const std::string& path);
  std::uint32_t make();
  void warn_of_unread(const MtlMaterial& material, const char* statement, std::string_view how);
  void fill(mesh::Material& out, const Loaded& loaded);
  void bind(mesh::Material& material, Channel channel, const MtlTexture& texture,
            const std::string& folder);
  std::uint32_t image(const std::string& name, const std::string& folder);

  std::string path_;
  AssetFolder folder_;
  mesh::Mesh& mesh_;
  MeshWarnings& warnings_;
  const bool tells_;
  std::map<std::string, bool> libraries_;  ///< by path: could it be read?
  std::set<std::string> loaded_names_;     ///< as they were named
  std::set<std::string> folders_;
  std::deque<Loaded> loaded_;                                  // by id
  std::map<std::string, int> ids_;                             // by name
  std::map<std::string, std::uint32_t> images_;                // by path
  std::set<std::string> moved_;                                // images found elsewhere, as named
  std::map<std::pair<int, std::string>, std::uint32_t> made_;  // by (id, name)
  std::pair<int, std::string> in_use_{-1, ""};
  std::optional<std::uint32_t> current_;  ///< what made_ has for in_use_
  std::vector<std::string> unknown_;      ///< names that no MTL file has; the first few
  std::uint64_t unknown_count_ = 0;
};

/// A model that names more material files is refused.
inline constexpr std::size_t kMaxLibraries = 1000;
[[noreturn]] void refuse_libraries(const std::string& obj_path);

/// What an "mtllib" may mean: first the whole as one name, spaces and all, then, if there are any,
/// its words. They count if there is no file of the first name.
std::vector<std::string> library_names(std::string_view said);

/// The file of that name beside an OBJ, if it is there and allowed.
std::optional<std::string> material_library(const std::string& obj_path, const AssetFolder& folder,
                                            const std::string& name);

}  // namespace pounce::io
