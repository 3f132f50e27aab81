// SPDX-License-Identifier: Apache-2.0
//
// tinyobjloader parses, by callbacks: its own mesh would take 12 bytes per corner and per index,
// and its triangulation never ends on some polygons. What it cannot tell from garbage is refused
// before it sees it (obj_lines). Corners with the same (v, vt, vn) become one vertex.
#include "io/obj/mesh.h"

#include <fmt/format.h>
#include <tiny_obj_loader.h>

#include <algorithm>
#include <cmath>
#include <istream>
#include <limits>
#include <new>
#include <set>

#include "io/material_names.h"
#include "io/mesh_warnings.h"
#include "io/obj/lines.h"
#include "io/obj/material.h"
#include "io/obj/polygon.h"
#include "mesh/vertex_frames.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
constexpr double kSmoothAngleDeg = 60;
/// In the mesh, and the tables that find it.
constexpr std::uint64_t kMeshBytesPerMaterial = sizeof(mesh::Material) + 1024;
/// Of an image: the heads of its texts, and what a problem says beside the model's name.
constexpr std::uint64_t kBytesPerImage = 128;
/// Of the face at hand: tinyobjloader's list of corners while it grows, our copies, the triangles.
constexpr std::uint64_t kBytesPerFaceCorner = 60;
constexpr int kMaxGroups = 64;  // that a face can be selected by

struct CornerKey {
  std::uint32_t position = kNone, texcoord = kNone, normal = kNone;
  bool operator==(const CornerKey&) const = default;
};

/// Numbers equal corners alike, in order of appearance. Open addressing; deterministic.
class CornerSet {
 public:
  std::uint32_t number_of(const CornerKey& key) {
    if (keys_.size() * 2 >= slots_.size()) grow();
    std::size_t slot = hash(key) & (slots_.size() - 1);
    while (slots_[slot] != kNone && keys_[slots_[slot]] != key)
      slot = (slot + 1) & (slots_.size() - 1);
    if (slots_[slot] == kNone) {
      slots_[slot] = static_cast<std::uint32_t>(keys_.size());
      keys_.push_back(key);
    }
    return slots_[slot];
  }
  const std::vector<CornerKey>& keys() const { return keys_; }

 private:
  static std::size_t hash(const CornerKey& key) {
    std::uint64_t h = key.position * 0x9E3779B97F4A7C15ULL;
    h = (h ^ (h >> 32) ^ key.texcoord) * 0xD6E8FEB86659FD93ULL;
    h = (h ^ (h >> 32) ^ key.normal) * 0xD6E8FEB86659FD93ULL;
    return h ^ (h >> 32);
  }
  void grow() {
    slots_.assign(std::max<std::size_t>(1024, slots_.size() * 2), kNone);
    for (std::uint32_t i = 0; i < keys_.size(); ++i) {
      std::size_t slot = hash(keys_[i]) & (slots_.size() - 1);
      while (slots_[slot] != kNone) slot = (slot + 1) & (slots_.size() - 1);
      slots_[slot] = i;
    }
  }
  std::vector<CornerKey> keys_;
  std::vector<std::uint32_t> slots_;
};

class ObjReader {
 public:
  ObjReader(const std::string& path, bool allow_external)
      : path_(path),
        lines_(path),
        warnings_(mesh_),
        materials_(path, allow_external, mesh_, warnings_) {}

  mesh::Mesh read();

 private:
  void reserve();
  void parse();
  void start_part();
  void add_face(const tinyobj::index_t* indices, int count);
  std::uint32_t resolve(int index, std::size_t count, const char* what) const;
  bool keep_vertices();
  void finish_normals(bool all_given);

  std::string path_;
  ObjLines lines_;
  mesh::Mesh mesh_;
  MeshWarnings warnings_;
  ObjMaterials materials_;
  std::vector<Vec3f> positions_, normals_;
  std::vector<Vec2f> texcoords_;
  CornerSet corners_;
  std::string object_;               ///< the last "o"
  std::vector<std::string> groups_;  ///< the last "g"
  mesh::PartsBuilder parts_;
  std::uint64_t small_faces_ = 0, crowded_groups_ = 0;
  // Scratch of add_face.
  std::vector<std::uint32_t> face_;
  std::vector<Vec3f> face_positions_;
};

void ObjReader::reserve() {
  const ObjCounts counts = count_obj(path_);
  if (counts.corners >= kNone || counts.positions >= kNone || counts.texcoords >= kNone ||
      counts.normals >= kNone) {
    throw Error(ErrorKind::input,
                fmt::format("{}: more than 4 billion corners or vertices; split the model", path_));
  }
  positions_.reserve(counts.positions);
  texcoords_.reserve(counts.texcoords);
  normals_.reserve(counts.normals);
  if (counts.corners > 2 * counts.faces) {
    mesh_.triangles.reserve(counts.corners - 2 * counts.faces);
    mesh_.triangle_material.reserve(counts.corners - 2 * counts.faces);
  }
}

void ObjReader::parse() {
  tinyobj::callback_t calls;
  calls.vertex_cb = [](void* data, float x, float y, float z, float) {
    auto* reader = static_cast<ObjReader*>(data);
    if (!std::isfinite(x) || !std::isfinite(y) || !std::isfinite(z)) {
      reader->lines_.fail("a vertex is too large for a float");
    }
    reader->positions_.push_back({x, y, z});
  };
  calls.normal_cb = [](void* data, float x, float y, float z) {
    static_cast<ObjReader*>(data)->normals_.push_back({x, y, z});
  };
  calls.texcoord_cb = [](void* data, float u, float v, float) {
    auto* reader = static_cast<ObjReader*>(data);
    if (!std::isfinite(u) || !std::isfinite(v)) {
      reader->lines_.fail("a texture coordinate is too large for a float");
    }
    reader->texcoords_.push_back({u, static_cast<float>(1.0 - static_cast<double>(v))});
  };
  calls.index_cb = [](void* data, tinyobj::index_t* indices, int count) {
    static_cast<ObjReader*>(data)->add_face(indices, count);
  };
  calls.object_cb = [](void* data, const char* name) {
    auto* reader = static_cast<ObjReader*>(data);
    reader->object_ = name;
    reader->start_part();
  };
  calls.group_cb = [](void* data, const char** names, int count) {
    auto* reader = static_cast<ObjReader*>(data);
    reader->groups_.assign(names, names + std::min(count, kMaxGroups));
    reader->crowded_groups_ += count > kMaxGroups ? 1 : 0;
    reader->start_part();
  };
  calls.usemtl_cb = [](void* data, const char* name, int id) {
    static_cast<ObjReader*>(data)->materials_.use(name, id);
  };
  std::istream stream(&lines_);
  std::string warning, error;
  bool parsed = false;
  try {
    parsed = tinyobj::LoadObjWithCallback(stream, calls, this, &materials_, &warning, &error);
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& e) {
    lines_.fail(e.what());
  }
  if (lines_.failure() != nullptr) std::rethrow_exception(lines_.failure());
  if (!parsed) lines_.fail(error);
}

void ObjReader::start_part() {
  std::vector<std::string> names{object_};
  names.insert(names.end(), groups_.begin(), groups_.end());
  if (object_.empty() && groups_.empty()) names = {"default"};
  parts_.start(static_cast<std::uint32_t>(mesh_.triangles.size()), names);
}

std::uint32_t ObjReader::resolve(int index, std::size_t count, const char* what) const {
  const auto total = static_cast<std::int64_t>(count);
  const std::int64_t zero_based = index > 0 ? std::int64_t{index} - 1 : total + index;
  if (zero_based < 0 || zero_based >= total) {
    lines_.fail(
        fmt::format("a face names {} {}, but {} have been given so far", what, index, count));
  }
  return static_cast<std::uint32_t>(zero_based);
}

void ObjReader::add_face(const tinyobj::index_t* indices, int count) {
  if (count < 3) {
    ++small_faces_;
    return;
  }
  face_.clear();
  face_positions_.clear();
  face_.reserve(static_cast<std::size_t>(count));
  face_positions_.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    CornerKey key;
    key.position = resolve(indices[i].vertex_index, positions_.size(), "vertex");
    if (indices[i].texcoord_index != 0) {
      key.texcoord = resolve(indices[i].texcoord_index, texcoords_.size(), "texture coordinate");
    }
    if (indices[i].normal_index != 0) {
      key.normal = resolve(indices[i].normal_index, normals_.size(), "normal");
    }
    face_.push_back(corners_.number_of(key));
    face_positions_.push_back(positions_[key.position]);
  }
  const std::uint32_t material = materials_.current();
  const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    mesh_.triangles.push_back({face_[a], face_[b], face_[c]});
    mesh_.triangle_material.push_back(material);
  };
  if (count == 3) {
    add(0, 1, 2);
  } else {
    for (const auto& t : triangulate(face_positions_)) add(t[0], t[1], t[2]);
  }
}

/// Turns the distinct corners into vertices. Do all of them have normals?
bool ObjReader::keep_vertices() {
  const std::vector<CornerKey>& keys = corners_.keys();
  bool any_uv = false, all_uv = true, all_normals = true;
  for (const CornerKey& key : keys) {
    any_uv = any_uv || key.texcoord != kNone;
    all_uv = all_uv && key.texcoord != kNone;
    all_normals = all_normals && key.normal != kNone;
  }
  mesh_.positions.reserve(keys.size());
  mesh_.normals.reserve(keys.size());
  for (const CornerKey& key : keys) {
    mesh_.positions.push_back(positions_[key.position]);
    mesh_.normals.push_back(key.normal == kNone ? Vec3f{} : normals_[key.normal]);
  }
  mesh_.tangents.assign(keys.size(), Vec4f{});
  if (any_uv) {
    auto& uvs = mesh_.uv_sets.emplace_back();
    uvs.reserve(keys.size());
    for (const CornerKey& key : keys) {
      uvs.push_back(key.texcoord == kNone ? Vec2f{} : texcoords_[key.texcoord]);
    }
    auto& present = mesh_.uv_present.emplace_back();
    if (!all_uv) {
      for (const CornerKey& key : keys) present.push_back(key.texcoord != kNone);
    }
  }
  return all_normals;
}

void ObjReader::finish_normals(bool all_given) {
  if (!all_given) {
    std::vector<std::uint32_t> position_of;
    std::vector<bool> missing;
    for (const CornerKey& key : corners_.keys()) {
      position_of.push_back(key.position);
      missing.push_back(key.normal == kNone);
    }
    corners_ = CornerSet();
    mesh::smooth_normals(mesh_, position_of, static_cast<std::uint32_t>(positions_.size()), missing,
                         kSmoothAngleDeg);
  }
  const std::uint64_t replaced = mesh::repair_normals(mesh_);
  if (replaced > 0 && all_given) {
    warnings_.add("{} normals were zero or not finite; replaced by those of the triangles",
                  replaced);
  }
}

mesh::Mesh ObjReader::read() {
  mesh_.path = path_;
  mesh_.files = {path_};
  reserve();
  start_part();
  parse();
  mesh_.parts = parts_.finish(static_cast<std::uint32_t>(mesh_.triangles.size()));
  if (mesh_.triangles.empty()) {
    throw Error(
        ErrorKind::input,
        fmt::format("{}: no faces ({} vertices, {} faces of fewer than 3 corners); export a "
                    "model with a surface",
                    path_, positions_.size(), small_faces_));
  }
  if (small_faces_ > 0) {
    warnings_.add("{} faces of fewer than 3 corners left out", small_faces_);
  }
  if (crowded_groups_ > 0) {
    warnings_.add(
        "{} statements put faces into more than {} groups; only the first {} of each count",
        crowded_groups_, kMaxGroups, kMaxGroups);
  }
  materials_.finish();
  finish_normals(keep_vertices());
  mesh::complete_tangents(mesh_);
  std::vector<std::string> names;
  for (const auto& material : mesh_.materials) names.push_back(material.name);
  names = unique_material_names(std::move(names));
  for (std::size_t i = 0; i < names.size(); ++i) {
    mesh::Material& material = mesh_.materials[i];
    material.name = names[i];
    if (!mesh_.uv_sets.empty()) continue;
    for (auto& binding : material.textures) {
      if (!binding) continue;
      warnings_.add(
          "material \"{}\" has a texture, but the model has no texture coordinates; left out",
          material.name);
      binding.reset();
    }
  }
  warnings_.finish();
  return std::move(mesh_);
}

/// What its material files need, and what the mesh keeps of them: the images of its materials.
struct LibraryCost {
  std::uint64_t reading_bytes = 0, kept_bytes = 0;
};

LibraryCost library_cost(const std::string& path, const MeshReading& reading,
                         const ObjCounts& counts) {
  const AssetFolder folder(path, reading.allow_external);
  std::set<std::string> files;
  for (const std::string& name : counts.libraries) {
    if (const auto file = material_library(path, folder, name)) files.insert(*file);
  }
  LibraryCost cost;
  MtlSize all;
  std::uint64_t folder_bytes = 0;
  for (const std::string& file : files) {
    try {
      const MtlSize size = mtl_size(file);
      cost.reading_bytes += size.bytes;
      all.textures += size.textures;
      all.texture_bytes += size.texture_bytes;
      all.longest_texture_bytes = std::max(all.longest_texture_bytes, size.longest_texture_bytes);
      folder_bytes = std::max<std::uint64_t>(folder_bytes, file.size());
    } catch (const Error&) {
      // Reading it says what is wrong.
    }
  }
  const std::uint64_t images = std::min(all.textures, counts.distinct_materials * kMaxMtlTextures);
  const std::uint64_t names = std::min(all.texture_bytes, images * all.longest_texture_bytes);
  // Path, label and, of one that is not there, a problem that names the model.
  cost.kept_bytes =
      images * (sizeof(mesh::ImageRef) + 2 * folder_bytes + path.size() + kBytesPerImage) +
      2 * names;
  // Their list while it grows, and the table that finds them by path.
  cost.reading_bytes +=
      images * (2 * sizeof(mesh::ImageRef) + folder_bytes + kBytesPerImage) + names;
  return cost;
}

}  // namespace

mesh::Mesh read_obj(const std::string& path, const MeshReading& reading) {
  return ObjReader(path, reading.allow_external).read();
}

MeshCost obj_cost(const std::string& path, const MeshReading& reading) {
  const ObjCounts counts = count_obj(path);
  const std::uint64_t triangles =
      counts.corners > 2 * counts.faces ? counts.corners - 2 * counts.faces : 0;
  // Where normals are missing, every corner may become a vertex of its own.
  const bool smooth = counts.normals == 0;
  const std::uint64_t corner_keys = counts.distinct_corners;
  const std::uint64_t vertices = smooth ? counts.corners : corner_keys;
  const std::uint64_t per_vertex = 12 + 12 + 16 + (counts.texcoords > 0 ? 8 + 1 : 0);
  MeshCost cost;
  // Names, what points at them, and while reading the tables that find them again.
  const std::uint64_t name_bytes =
      std::min(counts.name_bytes, 2 * counts.distinct_parts * counts.longest_name_bytes);
  const std::uint64_t runs = std::min(counts.names, counts.faces) * sizeof(mesh::Parts::Run);
  const std::uint64_t part_groups =
      counts.distinct_parts * (1 + std::min<std::uint64_t>(counts.most_groups, kMaxGroups)) * 4;
  const std::uint64_t materials = std::min<std::uint64_t>(counts.distinct_materials, kMaxMaterials);
  const std::uint64_t material_name_bytes =
      std::min(counts.use_bytes, materials * counts.longest_name_bytes);
  const LibraryCost libraries = library_cost(path, reading, counts);
  cost.kept_bytes = vertices * per_vertex + triangles * 16 + runs + counts.distinct_parts * 128 +
                    part_groups + materials * kMeshBytesPerMaterial + material_name_bytes +
                    libraries.kept_bytes + name_bytes * 8 + (1U << 20);
  const std::uint64_t lists = counts.positions * 12 + counts.texcoords * 8 + counts.normals * 12;
  // Keys and slots while they double: three times and one and a half times what is in use.
  const std::uint64_t corner_set = corner_keys * (3 * 12 + 6 * 4);
  // Smoothing: triangles by position, renumbered triangles, copies, and the arrays while they grow.
  const std::uint64_t smoothing = smooth ? counts.positions * 8 + triangles * (12 + 12) +
                                               corner_keys * (8 + per_vertex) +
                                               (vertices - corner_keys) * (3 * 16 + 3 * 4)
                                         : 0;
  const std::uint64_t part_tables =
      counts.distinct_parts * 280 + part_groups + name_bytes * 32 + runs;
  cost.peak_bytes = cost.kept_bytes + part_tables + lists + std::max(corner_set, smoothing) +
                    libraries.reading_bytes + 3 * material_name_bytes +
                    counts.most_corners * kBytesPerFaceCorner + 4 * counts.longest_line_bytes +
                    (4U << 20);  // pieces of the file
  return cost;
}

}  // namespace pounce::io
