// SPDX-License-Identifier: Apache-2.0
//
// Which reader a mesh file gets, and what both readers share.
//
// Often what is named is no mesh but the splat scene or the folder that belongs elsewhere on the
// command line: these are told apart first, so that the message is about the mistake and not about
// the first byte that no mesh has.
#include "io/read_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <set>
#include <string_view>

#include "core/file.h"
#include "core/input_file.h"
#include "io/files/asset_file.h"
#include "io/ply/ply_header.h"
#include "io/problems.h"
#include "io/splats/ply_scene.h"
#include "io/splats/scene.h"

namespace pounce::io {
namespace {

enum class Format { gltf, obj, ply, stl };

/// A splat scene where a mesh is wanted: often the two are in the wrong order.
[[noreturn]] void refuse_splats(const std::string& path, const SplatFormat& format) {
  if (format.kind == SplatKind::ply) {
    const auto file = open_input(path);
    if (is_ply(*file)) read_ply_header(*file, path);  // what is wrong with it may hide its faces
    if (!holds_splats(*file, path)) {
      refuse(path,
             "a PLY file without faces (lists \"vertex_indices\") is read as a splat scene, which "
             "can only be a source; export a mesh with its faces");
    }
  }
  if (format.kind == SplatKind::point_ply || format.kind == SplatKind::las) {
    refuse(path,
           "a point cloud, but a mesh (.glb, .gltf, .obj, .ply or .stl) is required; a cloud comes "
           "first, as the source of a transfer: pounce transfer CLOUD TARGET.glb -o OUTPUT");
  }
  refuse(path,
         "a Gaussian splat scene in {}, but a mesh (.glb, .gltf, .obj, .ply or .stl) is required; "
         "a scene "
         "comes first, as the source of a transfer: pounce transfer SCENE TARGET.glb -o OUTPUT",
         format.name);
}

// A folder and a scene are looked for before the file is opened as a mesh.
/// Content first: a GLB is one whatever its name. JSON and OBJ are text, so their ending decides,
/// after a look at the first character.
Format format_of(const std::string& path) {
  if (const auto splats = splat_format(path)) refuse_splats(path, *splats);
  if (std::error_code ignored; std::filesystem::is_directory(path, ignored)) {
    throw Error(
        ErrorKind::storage,
        fmt::format("{}: is a folder; name a mesh in it (.glb, .gltf, .obj, .ply or .stl) or, "
                    "as a source, a splat scene",
                    path));
  }
  const auto file = open_input(path);
  std::array<char, 64> head{};
  const std::uint64_t size = file->size_bytes();
  const std::size_t count = std::min<std::uint64_t>(size, head.size());
  file->read(0, std::as_writable_bytes(std::span(head).first(count)));
  std::string_view text(head.data(), count);
  if (text.starts_with("glTF")) return Format::gltf;
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  const std::string ending = lower_ending(path);
  const std::size_t start = text.find_first_not_of(" \t\r\n");
  const bool is_json = start != std::string_view::npos && text[start] == '{';
  // A .glb that holds JSON, or a .json, is still read: what is inside decides, and the ending only
  // where it leaves a doubt.
  if (ending == ".gltf" || ending == ".glb" || (is_json && ending != ".obj")) {
    if (size == 0) refuse(path, "the file is empty; export it again");
    if (ending == ".glb" && !is_json) {
      refuse(path,
             "does not begin like a GLB file; it is damaged or in another format (.glb, .gltf, "
             ".obj, .ply and .stl are supported)");
    }
    return Format::gltf;
  }
  if (is_ply(*file)) return Format::ply;  // and no splat scene
  if (ending == ".obj") return Format::obj;
  if (ending == ".stl") return Format::stl;
  refuse(path, "not a supported mesh format; convert it to .glb, .gltf, .obj, .ply or .stl");
}

}  // namespace

mesh::Mesh read_mesh(const std::string& path, const MeshReading& reading) {
  switch (format_of(path)) {
    case Format::gltf:
      return read_gltf(path, reading);
    case Format::obj:
      return read_obj(path, reading);
    case Format::ply:
      return read_ply(path, reading);
    case Format::stl:
      break;
  }
  return read_stl(path, reading);
}

MeshCost mesh_cost(const std::string& path, const MeshReading& reading, std::uint64_t most_bytes) {
  switch (format_of(path)) {
    case Format::gltf:
      return gltf_cost(path, reading, most_bytes);
    case Format::obj:
      return obj_cost(path, reading);
    case Format::ply:
      return ply_cost(path, reading);
    case Format::stl:
      break;
  }
  return stl_cost(path);
}

bool is_gltf(const std::string& path) { return format_of(path) == Format::gltf; }

// Outputs are named after materials, so two of one name would be one file.
std::vector<std::string> unique_material_names(std::vector<std::string> names) {
  // A suffix may give a name that a later material has of its own: then that one moves on. Earlier
  // names never change, so outputs keep theirs when materials are added at the end.
  std::set<std::string> taken;
  std::map<std::string, std::size_t> last_suffix;  // so that a million equal names stay cheap
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i].empty()) names[i] = "material_" + std::to_string(i);
    const std::string base = names[i];
    while (!taken.insert(names[i]).second) {
      std::size_t& suffix = last_suffix[base];
      suffix = suffix == 0 ? 2 : suffix + 1;
      names[i] = base + "_" + std::to_string(suffix);
    }
  }
  return names;
}

}  // namespace pounce::io
