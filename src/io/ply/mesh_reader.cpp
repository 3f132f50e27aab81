// SPDX-License-Identifier: Apache-2.0
//
// A PLY mesh: its vertices are those of the mesh, unless faces bring texture coordinates of their
// own (MeshLab's "texcoord"); then a vertex is parted where these differ, as in an OBJ.
//
// v counts from below, as in an OBJ. "comment TextureFile" names a texture, the first for faces
// without a "texnumber"; each that faces use becomes a material, named after the file. Colours are
// sRGB. Where the file has no normals, triangles of one position that lie within 60 degrees share
// one: exporters part vertices at seams, so positions decide and not numbers.
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <system_error>
#include <utility>

#include "core/colour_space.h"
#include "io/files/asset_file.h"
#include "io/obj/polygon.h"
#include "io/ply/rows.h"
#include "io/ply/triple_set.h"
#include "io/problems.h"
#include "io/read_mesh.h"
#include "mesh/vertex_frames.h"

namespace pounce::io {
namespace {

namespace fs = std::filesystem;

constexpr double kSmoothAngleDeg = 60;                                      // as of an OBJ
constexpr std::uint32_t kNoUv = std::numeric_limits<std::uint32_t>::max();  // the bits of a NaN

double at(const PlyVertex& row, PlyValue value) { return row[static_cast<std::size_t>(value)]; }

bool has_all(const PlyRows& rows, std::initializer_list<PlyValue> values) {
  return std::all_of(values.begin(), values.end(), [&](PlyValue v) { return rows.has(v); });
}

/// What a mesh is made of; the same questions are asked for its cost.
struct PlyParts {
  explicit PlyParts(const PlyRows& rows, const MeshReading& reading)
      : normals(has_all(rows, {PlyValue::nx, PlyValue::ny, PlyValue::nz})),
        uvs(has_all(rows, {PlyValue::u, PlyValue::v})),
        face_uvs(rows.has_face_texcoords()),
        colours(has_all(rows, {PlyValue::red, PlyValue::green, PlyValue::blue})),
        keeps_colours(colours && reading.vertex_colours) {}
  bool normals, uvs, face_uvs, colours, keeps_colours;
};

class PlyMeshReader {
 public:
  PlyMeshReader(const std::string& path, const MeshReading& reading)
      : rows_(path),
        parts_(rows_, reading),
        origin_(reading.origin),
        folder_(path, reading.allow_external),
        warnings_(mesh_) {
    mesh_.path = path;
    mesh_.files = {path};
    materials_.assign(rows_.header().textures.size() + 1, kNone);
  }

  mesh::Mesh read();

 private:
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

  void reserve(const PlyCounts& counts);
  void add_vertex(const PlyVertex& row);
  float colour(const PlyVertex& row, PlyValue value) const;
  void add_face(const PlyFace& face);
  std::uint32_t corner(const PlyFace& face, std::size_t k);
  std::uint32_t material(std::int64_t texture);
  std::uint32_t make_material(std::size_t texture);
  std::uint32_t add_image(const std::string& name);
  void part_vertices();
  void smooth();

  PlyRows rows_;
  PlyParts parts_;
  const Vec3d origin_;
  AssetFolder folder_;
  mesh::Mesh mesh_;
  MeshWarnings warnings_;
  TripleSet parted_;                      ///< (vertex, u, v), where faces have UVs
  std::vector<std::uint32_t> materials_;  ///< by texture; the last one for faces without
  std::uint64_t row_ = 0, small_faces_ = 0, unknown_textures_ = 0;
  bool any_face_uv_ = false;
  std::vector<std::uint32_t> face_;
  std::vector<Vec3f> face_positions_;
};

void PlyMeshReader::reserve(const PlyCounts& counts) {
  if (counts.corners >= kNone || counts.triangles >= kNone)
    refuse(mesh_.path, "more than 4 billion corners; split the model");
  mesh_.positions.reserve(counts.vertices);
  if (parts_.normals) mesh_.normals.reserve(counts.vertices);
  if (parts_.uvs || parts_.face_uvs) {
    mesh_.uv_sets.emplace_back().reserve(parts_.uvs ? counts.vertices : 0);
    mesh_.uv_present.emplace_back();
  }
  mesh_.has_vertex_colours = parts_.colours;
  if (parts_.keeps_colours) mesh_.colours.reserve(counts.vertices);
  mesh_.triangles.reserve(counts.triangles);
  mesh_.triangle_material.reserve(counts.triangles);
}

/// Whole numbers are fractions of the largest of their type.
float PlyMeshReader::colour(const PlyVertex& row, PlyValue value) const {
  const PlyType type = rows_.type(value);
  const double largest = type == PlyType::u8 ? 255 : type == PlyType::u16 ? 65535 : 1;
  const double sample = at(row, value) / largest;
  return static_cast<float>(std::isfinite(sample) ? std::clamp(sample, 0.0, 1.0) : 1.0);
}

void PlyMeshReader::add_vertex(const PlyVertex& row) {
  const Vec3f p(Vec3d{at(row, PlyValue::x), at(row, PlyValue::y), at(row, PlyValue::z)} - origin_);
  if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
    refuse(mesh_.path, "vertex {} is too large for a float; scale the model down", row_);
  mesh_.positions.push_back(p);
  if (parts_.normals) {
    mesh_.normals.push_back(
        Vec3f(Vec3d{at(row, PlyValue::nx), at(row, PlyValue::ny), at(row, PlyValue::nz)}));
  }
  if (parts_.uvs) {
    const Vec2f uv{static_cast<float>(at(row, PlyValue::u)),
                   static_cast<float>(1.0 - at(row, PlyValue::v))};
    if (!std::isfinite(uv.x) || !std::isfinite(uv.y))
      refuse(mesh_.path,
             "a texture coordinate of vertex {} is not a finite number; export it again", row_);
    mesh_.uv_sets[0].push_back(uv);
  }
  if (parts_.keeps_colours) {
    const auto linear = [&](PlyValue value) {
      return static_cast<float>(srgb_to_linear(static_cast<double>(colour(row, value))));
    };
    mesh_.colours.push_back({linear(PlyValue::red), linear(PlyValue::green), linear(PlyValue::blue),
                             rows_.has(PlyValue::alpha) ? colour(row, PlyValue::alpha) : 1.0F});
  }
  ++row_;
}

/// The vertex of a corner in the mesh.
std::uint32_t PlyMeshReader::corner(const PlyFace& face, std::size_t k) {
  const std::uint32_t vertex = face.corners[k];
  if (!parts_.face_uvs) return vertex;
  Triple key{vertex, kNoUv, kNoUv};
  if (!face.texcoords.empty()) {
    // Both zeros are one place.
    const float u = face.texcoords[2 * k] + 0.0F;
    const auto v = static_cast<float>(1.0 - static_cast<double>(face.texcoords[2 * k + 1]));
    key = {vertex, std::bit_cast<std::uint32_t>(u), std::bit_cast<std::uint32_t>(v + 0.0F)};
    any_face_uv_ = true;
  } else if (parts_.uvs) {
    const Vec2f uv = mesh_.uv_sets[0][vertex];
    key = {vertex, std::bit_cast<std::uint32_t>(uv.x), std::bit_cast<std::uint32_t>(uv.y)};
  }
  return parted_.number_of(key);
}

void PlyMeshReader::add_face(const PlyFace& face) {
  const std::size_t count = face.corners.size();
  if (count < 3) {
    ++small_faces_;
    return;
  }
  const std::uint32_t material = this->material(face.texture);
  face_.clear();
  face_positions_.clear();
  for (std::size_t k = 0; k < count; ++k) {
    face_.push_back(corner(face, k));
    face_positions_.push_back(mesh_.positions[face.corners[k]]);
  }
  const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    mesh_.triangles.push_back({face_[a], face_[b], face_[c]});
    mesh_.triangle_material.push_back(material);
  };
  if (count == 3) return add(0, 1, 2);
  for (const auto& t : triangulate(face_positions_)) add(t[0], t[1], t[2]);
}

std::uint32_t PlyMeshReader::material(std::int64_t texture) {
  const std::size_t none = materials_.size() - 1;
  std::size_t wanted = none;
  if (texture >= 0 && static_cast<std::uint64_t>(texture) < none) {
    wanted = static_cast<std::size_t>(texture);
  } else if (texture > 0) {
    ++unknown_textures_;
  }
  if (materials_[wanted] == kNone) materials_[wanted] = make_material(wanted);
  return materials_[wanted];
}

std::uint32_t PlyMeshReader::make_material(std::size_t texture) {
  if (mesh_.materials.size() == kMaxMaterials)
    refuse(mesh_.path, "its faces use more than {} textures; split the model", kMaxMaterials);
  mesh::Material& out = mesh_.materials.emplace_back();
  out.name = "default";
  if (texture + 1 < materials_.size()) {
    std::string name = rows_.header().textures[texture];
    std::replace(name.begin(), name.end(), '\\', '/');
    out.name = fs::path(name).stem().string();
    if (mesh_.uv_sets.empty()) {
      warnings_.add("has the texture {}, but no texture coordinates; texture ignored", name);
    } else {
      mesh::TextureBinding binding;
      binding.image = add_image(name);
      out.textures[static_cast<std::size_t>(Channel::base_color)] = binding;
    }
  }
  return static_cast<std::uint32_t>(mesh_.materials.size() - 1);
}

// A path of another machine, or to elsewhere on this one: the file is often beside the PLY.
std::uint32_t PlyMeshReader::add_image(const std::string& name) {
  const fs::path folder = fs::path(mesh_.path).parent_path();
  fs::path path = folder / name;
  const auto is_readable = [&](const fs::path& file) {
    std::error_code error;
    return fs::is_regular_file(file, error) && folder_.holds(file.string());
  };
  const fs::path beside = folder / path.filename();
  if (!is_readable(path) && is_readable(beside)) {
    mesh_.notes.push_back(
        fmt::format("{}: {} is missing or not readable; {} of the same name is used instead",
                    mesh_.path, name, beside.string()));
    path = beside;
  }
  mesh::ImageRef& out = mesh_.images.emplace_back();
  out.path = out.label = path.string();
  std::error_code error;  // whatever else is wrong with it, reading says
  if (fs::status(path, error).type() == fs::file_type::not_found) {
    out.problem = fmt::format("the file is missing (named as TextureFile by {})", mesh_.path);
    out.missing = true;
  } else if (!folder_.holds(path.string())) {
    out.problem =
        fmt::format("the file (named as TextureFile by {}) {}", mesh_.path, kOutsideProblem);
  }
  return static_cast<std::uint32_t>(mesh_.images.size() - 1);
}

/// Makes the vertices of the mesh from those of the file, where faces have UVs of their own.
void PlyMeshReader::part_vertices() {
  const std::vector<Triple>& keys = parted_.keys();
  const auto gather = [&](auto& values) {
    if (values.empty()) return;
    std::remove_reference_t<decltype(values)> parted;
    parted.reserve(keys.size());
    for (const Triple& key : keys) parted.push_back(values[key[0]]);
    values = std::move(parted);
  };
  gather(mesh_.positions);
  gather(mesh_.normals);
  gather(mesh_.colours);
  std::vector<Vec2f> uvs;
  std::vector<bool> present;
  uvs.reserve(keys.size());
  bool all = true;
  for (const Triple& key : keys) {
    const bool has_uv = key[1] != kNoUv;
    all = all && has_uv;
    uvs.push_back(has_uv ? Vec2f{std::bit_cast<float>(key[1]), std::bit_cast<float>(key[2])}
                         : Vec2f{});
    present.push_back(has_uv);
  }
  mesh_.uv_sets[0] = std::move(uvs);
  if (!all) mesh_.uv_present[0] = std::move(present);
}

void PlyMeshReader::smooth() {
  TripleSet places;
  std::vector<std::uint32_t> position_of;
  position_of.reserve(mesh_.positions.size());
  for (const Vec3f& p : mesh_.positions) position_of.push_back(places.number_of(place_key(p)));
  mesh_.normals.assign(mesh_.positions.size(), Vec3f{});
  const auto count = static_cast<std::uint32_t>(places.keys().size());
  places = TripleSet();
  mesh::smooth_normals(mesh_, position_of, count, std::vector<bool>(position_of.size(), true),
                       kSmoothAngleDeg);
}

mesh::Mesh PlyMeshReader::read() {
  reserve(rows_.count());
  mesh::PartsBuilder parts;
  parts.start(0, {"default"});
  rows_.read([&](const PlyVertex& row) { add_vertex(row); },
             [&](const PlyFace& face) { add_face(face); });
  if (mesh_.triangles.empty()) {
    refuse(mesh_.path,
           "no faces ({} vertices, {} faces with fewer than 3 corners); export a model with a "
           "surface",
           mesh_.positions.size(), small_faces_);
  }
  if (small_faces_ > 0) warnings_.add("{} faces with fewer than 3 corners ignored", small_faces_);
  if (unknown_textures_ > 0) {
    warnings_.add("{} faces have the number of a texture that the header does not name",
                  unknown_textures_);
  }
  mesh_.parts = parts.finish(static_cast<std::uint32_t>(mesh_.triangles.size()));
  if (parts_.face_uvs) part_vertices();
  parted_ = TripleSet();
  if (parts_.face_uvs && !any_face_uv_ && !parts_.uvs) {
    mesh_.uv_sets.clear();
    mesh_.uv_present.clear();
    for (mesh::Material& material : mesh_.materials) material.textures = {};
  }
  if (!parts_.normals) smooth();
  mesh_.tangents.assign(mesh_.positions.size(), Vec4f{});
  const std::uint64_t replaced = mesh::repair_normals(mesh_);
  if (replaced > 0 && parts_.normals) {
    warnings_.add("{} normals are zero or not finite; replaced by the normals of the triangles",
                  replaced);
  }
  mesh::complete_tangents(mesh_);
  std::vector<std::string> names;
  for (const auto& material : mesh_.materials) names.push_back(material.name);
  names = unique_material_names(std::move(names));
  for (std::size_t i = 0; i < names.size(); ++i) mesh_.materials[i].name = names[i];
  warnings_.finish();
  return std::move(mesh_);
}

}  // namespace

mesh::Mesh read_ply(const std::string& path, const MeshReading& reading) {
  return PlyMeshReader(path, reading).read();
}

// As obj_cost(): what the mesh keeps, then the vertices of the file, then the larger of what parts
// vertices and what smooths normals.
MeshCost ply_cost(const std::string& path, const MeshReading& reading) {
  const PlyRows rows(path);
  const PlyParts parts(rows, reading);
  const PlyCounts counts = rows.count();
  const std::uint64_t per_vertex =
      12 + 12 + 16 + (parts.uvs || parts.face_uvs ? 8 + 1 : 0) + (parts.keeps_colours ? 16 : 0);
  const std::uint64_t own = parts.face_uvs ? counts.corners : counts.vertices;
  const std::uint64_t vertices =
      parts.normals ? own : std::max(own, counts.vertices) + counts.corners;
  constexpr std::uint64_t kPerTexture = 4096, kPerFaceCorner = 200;
  const std::uint64_t textures = rows.header().textures.size() + 1;
  MeshCost cost;
  cost.kept_bytes = vertices * per_vertex + counts.triangles * 16 +
                    textures * (kPerTexture + 4 * path.size()) + (2U << 20);
  const std::uint64_t lists = parts.face_uvs ? counts.vertices * per_vertex : 0;
  const std::uint64_t parting = parts.face_uvs ? TripleSet::bytes(counts.corners) : 0;
  const std::uint64_t smoothing =
      parts.normals ? 0
                    : std::max(TripleSet::bytes(own), own * (8 + 8 + per_vertex) +
                                                          counts.triangles * (12 + 12) +
                                                          (vertices - own) * (3 * 16 + 3 * 4));
  cost.peak_bytes = cost.kept_bytes + lists + std::max(parting, smoothing) + 4 * own +
                    counts.most_corners * kPerFaceCorner + (6U << 20);
  return cost;
}

}  // namespace pounce::io
