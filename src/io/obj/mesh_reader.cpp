// SPDX-License-Identifier: Apache-2.0
//
// Statements become corners, and corners with the same (v, vt, vn) one vertex, numbered as faces
// first name them. A number or an index that is none is refused with its line: read as 0 it would
// bend the surface without a word. Curves, lines, points and smoothing groups are passed over. A
// vertex may have a colour, three numbers more, which programs write as they show it: sRGB.
//
//   v x y z [r g b]             a position, maybe a colour; one number more is a weight, ignored
//   vt u [v]                    v counts from below here, and from above inside
//   vn x y z                    a normal
//   f v[/[vt][/[vn]]] ...       three corners or more; negative indices count from the last entry
//   o NAME, g NAME ...          names that triangles can be selected by (--source-mesh)
//   usemtl NAME, mtllib FILE    materials.cpp
//
// The file is read twice: first it is counted (obj_text.h), so that its lists and the mesh are
// reserved once, at their final size. Beside the mesh there are then the lists of the file and the
// set that numbers equal corners; they go when the vertices are made. Where normals are missing,
// corners of one position that lie within 60 degrees share one, and others are parted: the number
// of vertices can only be bounded before, by the number of corners.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/colour_space.h"
#include "io/obj/corner_set.h"
#include "io/obj/materials.h"
#include "io/obj/numbers.h"
#include "io/obj/obj_text.h"
#include "io/obj/polygon.h"
#include "io/problems.h"
#include "io/read_mesh.h"
#include "mesh/vertex_frames.h"

namespace pounce::io {
namespace {

// What modelling programs take where nothing is said; sharper edges stay edges.
constexpr double kSmoothAngleDeg = 60;

class ObjReader {
 public:
  ObjReader(const std::string& path, const MeshReading& reading)
      : path_(path),
        wants_colours_(reading.vertex_colours),
        origin_(reading.origin),
        text_(path, ObjText::Kind::obj),
        warnings_(mesh_),
        materials_(path, reading.allow_external, reading.needs_materials, mesh_, warnings_) {}

  mesh::Mesh read();

 private:
  /// The indices of a corner (v, vt, vn) as the file counts them; 0: none.
  using Corner = std::array<int, 3>;

  void reserve();
  void parse();
  Vec3f position(std::string_view rest) const;
  template <class T = float>
  std::array<T, 3> numbers(std::string_view rest, std::size_t needed, std::size_t at_most,
                           const char* what) const;
  std::string name(std::string_view rest) const;
  void set_groups(const std::string& names);
  void start_part();
  Corner corner(std::string_view word) const;
  void add_face(std::string_view rest);
  std::uint32_t resolve(int index, std::size_t count, const char* what) const;
  void add_colour(std::string_view vertex);
  void keep_colours();
  bool keep_vertices();
  void finish_normals(bool all_given);

  std::string path_;
  bool wants_colours_, has_colours_ = false;
  const Vec3d origin_;  ///< is subtracted from positions
  ObjText text_;
  mesh::Mesh mesh_;
  MeshWarnings warnings_;
  ObjMaterials materials_;
  std::vector<Vec3f> positions_, normals_;
  std::vector<Vec2f> texcoords_;
  std::vector<Vec4f> colours_;  ///< of the positions, as in the file; where wanted
  CornerSet vertices_;
  std::string object_;               ///< the last "o"
  std::vector<std::string> groups_;  ///< the last "g"
  mesh::PartsBuilder parts_;
  std::uint64_t small_faces_ = 0, crowded_groups_ = 0, bad_colours_ = 0;
  // Scratch of add_face.
  std::vector<Corner> corners_;
  std::vector<std::uint32_t> face_;
  std::vector<Vec3f> face_positions_;
};

void ObjReader::reserve() {
  const ObjCounts counts = count_obj(path_);
  if (counts.corners >= kNone || counts.positions >= kNone || counts.texcoords >= kNone ||
      counts.normals >= kNone) {
    refuse(path_, "more than 4 billion corners or vertices; split the model");
  }
  positions_.reserve(counts.positions);
  mesh_.has_vertex_colours = counts.has_colours;
  if (counts.has_colours && wants_colours_) colours_.reserve(counts.positions);
  texcoords_.reserve(counts.texcoords);
  normals_.reserve(counts.normals);
  vertices_.reserve(counts.distinct_corners, counts.positions);
  mesh_.triangles.reserve(counts.triangles);
  mesh_.triangle_material.reserve(counts.triangles);
}

// Unknown statements are passed over: there are many, and none of them is a surface.
void ObjReader::parse() {
  for (std::string_view statement; text_.next(statement);) {
    std::string_view rest = statement;
    const std::string_view word = next_word(rest);
    if (word == "v") {
      positions_.push_back(position(rest));
      if (mesh_.has_vertex_colours && wants_colours_) add_colour(rest);
    } else if (word == "vt") {
      const auto [u, v, w] = numbers(rest, 1, 2, "a texture coordinate");
      if (!std::isfinite(u) || !std::isfinite(v)) {
        text_.fail("a texture coordinate is too large for a float");
      }
      // OBJ counts v from below; everything inside counts it from above (decision 6).
      texcoords_.push_back({u, static_cast<float>(1.0 - static_cast<double>(v))});
    } else if (word == "vn") {
      const auto [x, y, z] = numbers(rest, 3, 3, "a normal");
      normals_.push_back({x, y, z});  // too large ones are replaced at the end
    } else if (word == "f") {
      add_face(rest);
    } else if (word == "o") {
      object_ = rest.empty() ? "default" : name(rest);
      start_part();
    } else if (word == "g") {
      set_groups(rest.empty() ? "default" : name(rest));
      start_part();
    } else if (word == "usemtl") {
      if (!rest.empty()) materials_.use(name(rest));
    } else if (word == "mtllib") {
      materials_.load(name(rest));
    }
  }
}

// In double precision where an origin is taken off: at map coordinates a float has steps of
// centimetres, and the difference has none.
Vec3f ObjReader::position(std::string_view rest) const {
  constexpr const char* kWhat = "a vertex";
  Vec3f read;
  if (origin_ == Vec3d{}) {
    const auto [x, y, z] = numbers(rest, 3, 3, kWhat);
    read = {x, y, z};
  } else {
    const auto [x, y, z] = numbers<double>(rest, 3, 3, kWhat);
    read = Vec3f(Vec3d{x, y, z} - origin_);
  }
  if (!std::isfinite(read.x) || !std::isfinite(read.y) || !std::isfinite(read.z))
    text_.fail("a vertex is too large for a float");
  return read;
}

/// Of a vertex; white where it has none, or none that is finite: nobody may want them.
void ObjReader::add_colour(std::string_view vertex) {
  Vec4f colour{1, 1, 1, 1};
  if (word_count(vertex) >= kColouredVertexWords) {
    for (int place = 0; place < 3; ++place) next_word(vertex);
    bool is_one = true;
    for (float* const sample : {&colour.x, &colour.y, &colour.z}) {
      const auto value = to_float(next_word(vertex));
      is_one = is_one && value && std::isfinite(*value);
      if (is_one) *sample = *value;
    }
    if (!is_one) {
      colour = {1, 1, 1, 1};
      ++bad_colours_;
    }
  }
  colours_.push_back(colour);
}

/// The numbers of a statement, 0 for those that may be left out.
template <class T>
std::array<T, 3> ObjReader::numbers(std::string_view rest, std::size_t needed, std::size_t at_most,
                                    const char* what) const {
  std::array<T, 3> values{};
  for (std::size_t i = 0; i < at_most; ++i) {
    const std::string_view word = next_word(rest);
    if (word.empty() && i >= needed) break;
    if (word.empty()) text_.fail(fmt::format("{} has {} numbers, but needs {}", what, i, needed));
    std::optional<T> value;
    if constexpr (std::is_same_v<T, float>) {
      value = to_float(word);
    } else {
      value = to_double(word);
    }
    if (!value) {
      text_.fail(
          fmt::format("{} holds \"{}\", which is not a finite number", what, word.substr(0, 40)));
    }
    values[i] = *value;
  }
  return values;
}

std::string ObjReader::name(std::string_view rest) const {
  if (rest.size() > kMaxNameBytes) {
    text_.fail(fmt::format("names of more than {} bytes; this is not a model", kMaxNameBytes));
  }
  return name_in(rest);
}

// "g a b" puts faces into both groups; a limit, because each face costs all of its groups.
void ObjReader::set_groups(const std::string& names) {
  groups_.clear();
  std::string_view rest(names);
  for (std::string_view group = next_word(rest); !group.empty(); group = next_word(rest)) {
    if (groups_.size() == kMaxGroups) {
      ++crowded_groups_;
      break;
    }
    groups_.emplace_back(group);
  }
}

void ObjReader::start_part() {
  std::vector<std::string> names{object_};
  names.insert(names.end(), groups_.begin(), groups_.end());
  if (object_.empty() && groups_.empty()) names = {"default"};
  parts_.start(static_cast<std::uint32_t>(mesh_.triangles.size()), names);
}

// Negative indices count back from the last entry at this place in the file.
std::uint32_t ObjReader::resolve(int index, std::size_t count, const char* what) const {
  const auto total = static_cast<std::int64_t>(count);
  const std::int64_t zero_based = index > 0 ? std::int64_t{index} - 1 : total + index;
  if (zero_based < 0 || zero_based >= total) {
    text_.fail(
        fmt::format("a face refers to {} {}, but only {} are defined so far", what, index, count));
  }
  return static_cast<std::uint32_t>(zero_based);
}

/// One word of a face: "v", "v/vt", "v//vn" or "v/vt/vn"; what is empty behind a slash is none.
ObjReader::Corner ObjReader::corner(std::string_view word) const {
  Corner indices{};
  const char* at = word.data();
  const char* const end = at + word.size();
  for (std::size_t part = 0;; ++part) {
    // Where there is no number, the index stays 0, which is none: the middle of "v//vn".
    const auto result = read_index(at, end, indices[part]);
    if (result.ec == std::errc() && indices[part] == 0) {
      text_.fail(
          fmt::format("the corner \"{}\" has index 0; OBJ counts from 1", word.substr(0, 60)));
    }
    if (result.ec == std::errc::result_out_of_range ||
        (result.ec == std::errc::invalid_argument && part == 0)) {
      text_.fail(fmt::format("the corner \"{}\" has no valid index", word.substr(0, 60)));
    }
    at = result.ec == std::errc() ? result.ptr : at;
    if (at == end) return indices;
    if (*at != '/' || part == 2) {
      text_.fail(fmt::format("\"{}\" is not a corner of a face", word.substr(0, 60)));
    }
    ++at;
  }
}

// Corners, then vertices, then triangles. The lists for one face are kept between faces: there may
// be a hundred million of them.
void ObjReader::add_face(std::string_view rest) {
  corners_.clear();
  for (std::string_view word = next_word(rest); !word.empty(); word = next_word(rest)) {
    corners_.push_back(corner(word));
  }
  const std::size_t count = corners_.size();
  if (count < 3) {
    small_faces_ += count > 0 ? 1 : 0;
    return;
  }
  face_.clear();
  face_.reserve(count);
  // An index may only name what came before it, so each list has its final part already.
  for (const auto& [position, texcoord, normal] : corners_) {
    CornerKey key;
    key.position = resolve(position, positions_.size(), "vertex");
    if (texcoord != 0) key.texcoord = resolve(texcoord, texcoords_.size(), "texture coordinate");
    if (normal != 0) key.normal = resolve(normal, normals_.size(), "normal");
    face_.push_back(vertices_.number_of(key));
  }
  // Asked for here, not at "usemtl": a material that no face uses is never made.
  const std::uint32_t material = materials_.current();
  const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    mesh_.triangles.push_back({face_[a], face_[b], face_[c]});
    mesh_.triangle_material.push_back(material);
  };
  if (count == 3) {
    add(0, 1, 2);
  } else {
    face_positions_.clear();
    face_positions_.reserve(count);
    for (const std::uint32_t vertex : face_)
      face_positions_.push_back(positions_[vertices_.keys()[vertex].position]);
    for (const auto& t : triangulate(face_positions_)) add(t[0], t[1], t[2]);
  }
}

/// Gives the vertices the colours of their positions, as linear light.
void ObjReader::keep_colours() {
  if (colours_.empty()) return;
  if (bad_colours_ > 0) {
    warnings_.add("the colours of {} vertices are not three finite numbers; replaced by white",
                  bad_colours_);
  }
  float largest = 0;
  // The largest of all decides for all: a program writes one range or the other.
  for (const Vec4f& c : colours_) largest = std::max({largest, c.x, c.y, c.z});
  const bool in_bytes = largest > 1;
  if (in_bytes) {
    warnings_.add("vertex colours go up to {}; read as 0 to 255, not 0 to 1",
                  static_cast<double>(largest));
  }
  // The extension was never written down: some programs write 0 to 1, others 0 to 255.
  const double scale = in_bytes ? 1.0 / 255 : 1.0;
  const auto linear = [&](float v) {
    return static_cast<float>(srgb_to_linear(static_cast<double>(v) * scale));
  };
  mesh_.colours.reserve(vertices_.keys().size());
  for (const CornerKey& key : vertices_.keys()) {
    const Vec4f& c = colours_[key.position];
    mesh_.colours.push_back({linear(c.x), linear(c.y), linear(c.z), 1});
  }
}

/// Turns the distinct corners into vertices. Do all of them have normals?
bool ObjReader::keep_vertices() {
  const std::vector<CornerKey>& keys = vertices_.keys();
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
  keep_colours();
  if (any_uv) {
    auto& uvs = mesh_.uv_sets.emplace_back();
    uvs.reserve(keys.size());
    for (const CornerKey& key : keys) {
      uvs.push_back(key.texcoord == kNone ? Vec2f{} : texcoords_[key.texcoord]);
    }
    // Empty where all vertices have UVs, which is nearly always.
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
    for (const CornerKey& key : vertices_.keys()) {
      position_of.push_back(key.position);
      missing.push_back(key.normal == kNone);
    }
    // Its tables are as large as the mesh, and smoothing needs that room.
    vertices_ = CornerSet();
    mesh::smooth_normals(mesh_, position_of, static_cast<std::uint32_t>(positions_.size()), missing,
                         kSmoothAngleDeg);
  }
  // Zeros that smoothing left (at corners of flat triangles) are no fault of the file.
  const std::uint64_t replaced = mesh::repair_normals(mesh_);
  if (replaced > 0 && all_given) {
    warnings_.add("{} normals are zero or not finite; replaced by the normals of the triangles",
                  replaced);
  }
}

// From statements to a mesh as the rest of pounce wants it: parts that are closed, vertices with
// normals of unit length, materials of different names, no texture where there are no UVs.
mesh::Mesh ObjReader::read() {
  mesh_.path = path_;
  mesh_.files = {path_};
  reserve();
  // Faces before the first "o" or "g" belong to a part, too.
  start_part();
  parse();
  mesh_.parts = parts_.finish(static_cast<std::uint32_t>(mesh_.triangles.size()));
  if (mesh_.triangles.empty()) {
    refuse(
        path_,
        "no faces ({} vertices, {} faces with fewer than 3 corners); export a model with a surface",
        positions_.size(), small_faces_);
  }
  if (small_faces_ > 0) {
    warnings_.add("{} faces with fewer than 3 corners ignored", small_faces_);
  }
  if (crowded_groups_ > 0) {
    warnings_.add(
        "{} statements put faces into more than {} groups; only the first {} of each are used",
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
          "material \"{}\" has a texture, but the model has no texture coordinates; texture "
          "ignored",
          material.name);
      binding.reset();
    }
  }
  warnings_.finish();
  return std::move(mesh_);
}

}  // namespace

mesh::Mesh read_obj(const std::string& path, const MeshReading& reading) {
  return ObjReader(path, reading).read();
}

}  // namespace pounce::io
