// SPDX-License-Identifier: Apache-2.0
#include "io/gltf/primitive.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "pounce/error.h"

namespace pounce::io {
namespace {

// A Vec is read as so many floats in a row.
static_assert(sizeof(Vec2f) == 8 && sizeof(Vec3f) == 12 && sizeof(Vec4f) == 16);

constexpr int kByte = TINYGLTF_COMPONENT_TYPE_BYTE, kUByte = TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE,
              kShort = TINYGLTF_COMPONENT_TYPE_SHORT,
              kUShort = TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT,
              kUInt = TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT, kFloat = TINYGLTF_COMPONENT_TYPE_FLOAT;

/// What glTF and KHR_mesh_quantization together allow for an attribute.
struct AttributeRule {
  int type;
  std::vector<int> components;  ///< besides float
  bool integers_normalized_only = false;
  bool allows_float = true;
};

AttributeRule rule_of(const std::string& name) {
  if (name == "POSITION") return {TINYGLTF_TYPE_VEC3, {kByte, kUByte, kShort, kUShort}, false};
  if (name == "NORMAL") return {TINYGLTF_TYPE_VEC3, {kByte, kShort}, true};
  if (name == "TANGENT") return {TINYGLTF_TYPE_VEC4, {kByte, kShort}, true};
  if (name.starts_with("TEXCOORD_")) {
    return {TINYGLTF_TYPE_VEC2, {kByte, kUByte, kShort, kUShort}, false};
  }
  if (name.starts_with("JOINTS_")) return {TINYGLTF_TYPE_VEC4, {kUByte, kUShort}, false, false};
  if (name.starts_with("WEIGHTS_")) return {TINYGLTF_TYPE_VEC4, {kUByte, kUShort}, true};
  return {0, {}, false};
}

/// glTF's colours: RGB or RGBA, of floats or of normalised integers without sign.
bool holds_colours(const tinygltf::Accessor& a) {
  const bool is_wide = a.type == TINYGLTF_TYPE_VEC3 || a.type == TINYGLTF_TYPE_VEC4;
  const bool is_whole = a.componentType == kUByte || a.componentType == kUShort;
  return is_wide && (a.componentType == kFloat || (is_whole && a.normalized));
}

const char* type_name(int type) {
  switch (type) {
    case TINYGLTF_TYPE_SCALAR:
      return "SCALAR";
    case TINYGLTF_TYPE_VEC2:
      return "VEC2";
    case TINYGLTF_TYPE_VEC3:
      return "VEC3";
    case TINYGLTF_TYPE_VEC4:
      return "VEC4";
    default:
      return "a matrix type";
  }
}

void check_type(const AccessorReader& accessors, int index, const std::string& name,
                const std::string& place) {
  const tinygltf::Accessor& a = accessors.accessor(index);
  const AttributeRule rule = rule_of(name);
  if (rule.type == 0) {
    if (a.componentType == kUInt) {
      accessors.fail(index, place, "is of 32-bit integers, which no attribute may be");
    }
    return;
  }
  const bool is_float = a.componentType == kFloat;
  const bool allowed = is_float ? rule.allows_float
                                : std::find(rule.components.begin(), rule.components.end(),
                                            a.componentType) != rule.components.end() &&
                                      (a.normalized || !rule.integers_normalized_only);
  if (a.type != rule.type || !allowed) {
    accessors.fail(
        index, place,
        fmt::format("is of {} with component type {}{}, which this attribute may not be",
                    type_name(a.type), a.componentType, a.normalized ? " (normalized)" : ""));
  }
}

/// TEXCOORD_2 -> 2; nothing for other names and for sets beyond kMaxUvSets.
std::optional<std::size_t> set_index(const std::string& name, const char* prefix) {
  const std::string_view head(prefix);
  if (!name.starts_with(head) || name.size() != head.size() + 1) return std::nullopt;
  const char digit = name.back();
  if (digit < '0' || digit > '9') return std::nullopt;
  const auto index = static_cast<std::size_t>(digit - '0');
  return index < kMaxUvSets ? std::optional(index) : std::nullopt;
}

int attribute(const std::map<std::string, int>& attributes, const std::string& name) {
  const auto it = attributes.find(name);
  return it == attributes.end() ? -1 : it->second;
}

void check_attribute_set(const AccessorReader& accessors,
                         const std::map<std::string, int>& attributes, std::uint64_t vertices,
                         const std::string& place) {
  for (const auto& [name, index] : attributes) {
    const std::string where = place + " " + name;
    check_type(accessors, index, name, where);
    if (accessors.count(index) != vertices) {
      accessors.fail(
          index, where,
          fmt::format("has {} elements, but POSITION has {}", accessors.count(index), vertices));
    }
  }
}

std::size_t check_joint_sets(const AccessorReader& accessors,
                             const std::map<std::string, int>& attributes,
                             const std::string& place) {
  std::size_t sets = 0;
  for (const auto& [name, index] : attributes) {
    const bool joints = name.starts_with("JOINTS_");
    if (!joints && !name.starts_with("WEIGHTS_")) continue;
    const std::string number = name.substr(joints ? 7 : 8);
    if (!attributes.contains((joints ? "WEIGHTS_" : "JOINTS_") + number)) {
      accessors.fail(index, place + " " + name, "has no matching joints or weights");
    }
    if (joints) ++sets;
  }
  for (std::size_t set = 0; set < sets; ++set) {
    if (!attributes.contains("JOINTS_" + std::to_string(set))) {
      const auto first = attributes.lower_bound("JOINTS_");
      accessors.fail(first->second, place + " " + first->first, "is not numbered from 0");
    }
  }
  return sets;
}

std::uint64_t triangle_count(int mode, std::uint64_t corners) {
  if (mode == TINYGLTF_MODE_TRIANGLES) return corners / 3;
  return corners < 3 ? 0 : corners - 2;
}

/// One primitive being read, before it is put into the mesh.
class PrimitiveReader {
 public:
  PrimitiveReader(const PrimitiveContext& context, const PrimitiveShape& shape, mesh::Mesh& mesh)
      : context_(context), shape_(shape), mesh_(mesh), vertices_(shape.vertices) {}

  AppendCounts append(std::uint32_t material);

 private:
  int find(const std::string& name) const { return attribute(context_.primitive.attributes, name); }
  std::string at(const std::string& name) const { return context_.place + " " + name; }
  void read_triangles();
  void read_vertices();
  void morph(const std::string& name, std::vector<Vec3f>& values) const;
  void read_colours();
  void read_skin();
  Affine skin_of(std::size_t vertex) const;
  void transform();
  void append_vertex(std::size_t vertex);
  void append_flat(std::uint32_t material);
  void append_shared(std::uint32_t material);
  Vec3f face_normal(const std::array<std::uint32_t, 3>& t) const;

  const PrimitiveContext& context_;
  const PrimitiveShape& shape_;
  mesh::Mesh& mesh_;
  std::size_t vertices_;
  AppendCounts counts_;
  std::vector<Vec3f> positions_, normals_;
  std::vector<Vec4f> tangents_, colours_;
  std::vector<std::vector<Vec2f>> uvs_;
  std::vector<std::array<std::uint32_t, 3>> triangles_;
  std::vector<std::vector<std::array<std::uint32_t, 4>>> joints_;
  std::vector<std::vector<Vec4f>> weights_;
  std::vector<bool> mirrored_;  // per vertex: its own transform mirrors (skins; else all alike)
};

void PrimitiveReader::read_triangles() {
  const int index = context_.primitive.indices;
  std::vector<std::uint32_t> corners;
  if (index >= 0) {
    corners.resize(context_.accessors.count(index));
    context_.accessors.read_whole(index, corners.data(), at("indices"));
    const int type = context_.accessors.accessor(index).componentType;
    const std::uint32_t restart = type == kUByte ? 0xFF : type == kUShort ? 0xFFFF : 0xFFFFFFFF;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      if (corners[i] == restart) {
        context_.accessors.fail(index, at("indices"),
                                fmt::format("element {} is the primitive restart value {}, which "
                                            "glTF forbids",
                                            i, restart));
      }
      if (corners[i] >= vertices_) {
        context_.accessors.fail(index, at("indices"),
                                fmt::format("element {} is {}, but there are only {} vertices", i,
                                            corners[i], vertices_));
      }
    }
  }
  const std::uint64_t count = index >= 0 ? corners.size() : vertices_;
  const auto corner = [&](std::uint64_t i) {
    return index >= 0 ? corners[i] : static_cast<std::uint32_t>(i);
  };
  const int mode = context_.primitive.mode;
  if (mode == TINYGLTF_MODE_TRIANGLES ? count % 3 != 0 : count < 3)
    counts_.incomplete_triangles = 1;
  triangles_.resize(shape_.triangles);
  for (std::uint64_t i = 0; i < triangles_.size(); ++i) {
    if (mode == TINYGLTF_MODE_TRIANGLES) {
      triangles_[i] = {corner(3 * i), corner(3 * i + 1), corner(3 * i + 2)};
    } else if (mode == TINYGLTF_MODE_TRIANGLE_STRIP) {
      triangles_[i] = {corner(i), corner(i + 1 + i % 2), corner(i + 2 - i % 2)};
    } else {
      triangles_[i] = {corner(i + 1), corner(i + 2), corner(0)};
    }
  }
}

void PrimitiveReader::morph(const std::string& name, std::vector<Vec3f>& values) const {
  const auto& targets = context_.primitive.targets;
  std::vector<Vec3f> delta;
  for (std::size_t t = 0; t < targets.size() && t < context_.morph_weights.size(); ++t) {
    const double weight = context_.morph_weights[t];
    const int index = attribute(targets[t], name);
    if (weight == 0 || index < 0) continue;
    delta.resize(values.size());
    context_.accessors.read_floats(index, &delta[0].x, fmt::format("{} target {}", at(name), t));
    for (std::size_t i = 0; i < values.size(); ++i) {
      values[i] = Vec3f(Vec3d(values[i]) + Vec3d(delta[i]) * weight);
    }
  }
}

void PrimitiveReader::read_vertices() {
  positions_.resize(vertices_);
  context_.accessors.read_floats(find("POSITION"), &positions_[0].x, at("POSITION"));
  morph("POSITION", positions_);
  if (const int index = find("NORMAL"); index >= 0) {
    normals_.resize(vertices_);
    context_.accessors.read_floats(index, &normals_[0].x, at("NORMAL"), true);
    morph("NORMAL", normals_);
  }
  // Without normals the file's tangents have nothing to be orthogonal to (and glTF says: ignore
  // them).
  if (const int index = find("TANGENT"); index >= 0 && !normals_.empty()) {
    tangents_.resize(vertices_);
    context_.accessors.read_floats(index, &tangents_[0].x, at("TANGENT"), true);
    std::vector<Vec3f> directions(vertices_);
    for (std::size_t i = 0; i < vertices_; ++i) {
      directions[i] = {tangents_[i].x, tangents_[i].y, tangents_[i].z};
    }
    morph("TANGENT", directions);
    for (std::size_t i = 0; i < vertices_; ++i) {
      tangents_[i] = {directions[i].x, directions[i].y, directions[i].z, tangents_[i].w};
    }
  }
  uvs_.resize(mesh_.uv_sets.size());
  for (std::size_t set = 0; set < uvs_.size(); ++set) {
    const std::string name = "TEXCOORD_" + std::to_string(set);
    if (const int index = find(name); index >= 0) {
      uvs_[set].resize(vertices_);
      context_.accessors.read_floats(index, &uvs_[set][0].x, at(name));
    }
  }
}

void PrimitiveReader::read_colours() {
  if (!context_.with_colours || !shape_.has_colours) return;
  const int index = find("COLOR_0");
  const std::size_t samples = context_.accessors.accessor(index).type == TINYGLTF_TYPE_VEC4 ? 4 : 3;
  std::vector<float> values(vertices_ * samples);
  context_.accessors.read_floats(index, values.data(), at("COLOR_0"), true);
  colours_.resize(vertices_);
  for (std::size_t i = 0; i < vertices_; ++i) {
    const float* const v = &values[i * samples];
    if (std::all_of(v, v + samples, [](float sample) { return std::isfinite(sample); })) {
      colours_[i] = {v[0], v[1], v[2], samples == 4 ? v[3] : 1.0F};
    } else {
      colours_[i] = {1, 1, 1, 1};
      ++counts_.bad_colours;
    }
  }
}

void PrimitiveReader::read_skin() {
  for (std::size_t set = 0; set < shape_.joint_sets; ++set) {
    const std::string joints = "JOINTS_" + std::to_string(set);
    const std::string weights = "WEIGHTS_" + std::to_string(set);
    joints_.emplace_back(vertices_);
    weights_.emplace_back(vertices_);
    context_.accessors.read_whole(find(joints), joints_.back()[0].data(), at(joints));
    context_.accessors.read_floats(find(weights), &weights_.back()[0].x, at(weights));
    for (std::size_t i = 0; i < vertices_; ++i) {
      const Vec4f& w = weights_.back()[i];
      const std::array<float, 4> each{w.x, w.y, w.z, w.w};
      for (std::size_t k = 0; k < 4; ++k) {
        if (each[k] < 0) {
          context_.accessors.fail(find(weights), at(weights),
                                  fmt::format("element {} is negative", i));
        }
        if (each[k] > 0 && joints_.back()[i][k] >= context_.joints.size()) {
          context_.accessors.fail(find(joints), at(joints),
                                  fmt::format("element {} names joint {}, but the skin has only {}",
                                              i, joints_.back()[i][k], context_.joints.size()));
        }
      }
    }
  }
}

Affine PrimitiveReader::skin_of(std::size_t vertex) const {
  Affine blended;
  blended.columns = {};
  double sum = 0;
  for (const auto& set : weights_) {
    sum += static_cast<double>(set[vertex].x) + set[vertex].y + set[vertex].z + set[vertex].w;
  }
  if (sum <= 0) {
    const std::size_t joint = joints_[0][vertex][0];
    return context_.joints[joint < context_.joints.size() ? joint : 0];
  }
  for (std::size_t set = 0; set < weights_.size(); ++set) {
    const Vec4f& w = weights_[set][vertex];
    const std::array<float, 4> each{w.x, w.y, w.z, w.w};
    for (std::size_t k = 0; k < 4; ++k) {
      if (each[k] > 0) {
        blended.add(context_.joints[joints_[set][vertex][k]], static_cast<double>(each[k]) / sum);
      }
    }
  }
  return blended;
}

Vec3f unit(Vec3d v) {
  const double size = length(v);
  // Zero and NaN stay recognisable: the mesh's normals are repaired when it is whole.
  return size > 0 && std::isfinite(size) ? Vec3f(v * (1 / size)) : Vec3f{};
}

void PrimitiveReader::transform() {
  const bool skinned = !context_.joints.empty() && shape_.joint_sets > 0;
  if (skinned) read_skin();
  mirrored_.assign(skinned ? vertices_ : 1, context_.to_world.determinant() < 0);
  for (std::size_t i = 0; i < vertices_; ++i) {
    const Affine map = skinned ? skin_of(i) : context_.to_world;
    if (skinned) mirrored_[i] = map.determinant() < 0;
    const Vec3f moved(map.point(Vec3d(positions_[i])) - context_.origin);
    if (!std::isfinite(moved.x) || !std::isfinite(moved.y) || !std::isfinite(moved.z)) {
      context_.accessors.fail(find("POSITION"), at("POSITION"),
                              fmt::format("element {} is moved to infinity by its node", i));
    }
    positions_[i] = moved;
    if (!normals_.empty()) {
      normals_[i] = unit(map.normal(Vec3d(normals_[i])));
      if (normals_[i] == Vec3f{}) ++counts_.bad_normals;
    }
    if (!tangents_.empty()) {
      Vec4f& t = tangents_[i];
      const Vec3f direction = unit(map.direction({t.x, t.y, t.z}));
      const float sign = (t.w < 0) != mirrored_[skinned ? i : 0] ? -1.0F : 1.0F;
      t = direction == Vec3f{} ? Vec4f{} : Vec4f{direction.x, direction.y, direction.z, sign};
    }
  }
  // Mirrored triangles turn inside out; turn them back.
  for (auto& t : triangles_) {
    if (mirrored_[skinned ? t[0] : 0]) std::swap(t[1], t[2]);
  }
}

Vec3f PrimitiveReader::face_normal(const std::array<std::uint32_t, 3>& t) const {
  const Vec3d a(positions_[t[0]]), b(positions_[t[1]]), c(positions_[t[2]]);
  return unit(cross(b - a, c - a));
}

void PrimitiveReader::append_vertex(std::size_t vertex) {
  mesh_.positions.push_back(positions_[vertex]);
  mesh_.tangents.push_back(tangents_.empty() ? Vec4f{} : tangents_[vertex]);
  if (context_.with_colours)
    mesh_.colours.push_back(colours_.empty() ? Vec4f{1, 1, 1, 1} : colours_[vertex]);
  for (std::size_t set = 0; set < uvs_.size(); ++set) {
    mesh_.uv_sets[set].push_back(uvs_[set].empty() ? Vec2f{} : uvs_[set][vertex]);
    if (!mesh_.uv_present[set].empty() || uvs_[set].empty()) {
      // The first vertex without this set: all earlier ones had it.
      mesh_.uv_present[set].resize(mesh_.positions.size() - 1, true);
      mesh_.uv_present[set].push_back(!uvs_[set].empty());
    }
  }
}

void PrimitiveReader::append_flat(std::uint32_t material) {
  for (const auto& t : triangles_) {
    const auto first = static_cast<std::uint32_t>(mesh_.positions.size());
    const Vec3f normal = face_normal(t);
    for (const std::uint32_t vertex : t) {
      append_vertex(vertex);
      mesh_.normals.push_back(normal);
    }
    mesh_.triangles.push_back({first, first + 1, first + 2});
    mesh_.triangle_material.push_back(material);
  }
}

void PrimitiveReader::append_shared(std::uint32_t material) {
  const auto first = static_cast<std::uint32_t>(mesh_.positions.size());
  for (std::size_t i = 0; i < vertices_; ++i) {
    append_vertex(i);
    mesh_.normals.push_back(normals_[i]);
  }
  for (const auto& t : triangles_) {
    mesh_.triangles.push_back({first + t[0], first + t[1], first + t[2]});
    mesh_.triangle_material.push_back(material);
  }
}

AppendCounts PrimitiveReader::append(std::uint32_t material) {
  read_triangles();
  read_vertices();
  read_colours();
  transform();
  if (normals_.empty()) {
    append_flat(material);
  } else {
    append_shared(material);
  }
  return counts_;
}

}  // namespace

PrimitiveShape check_primitive(const AccessorReader& accessors,
                               const tinygltf::Primitive& primitive, const std::string& place,
                               std::size_t skin_joints) {
  PrimitiveShape shape;
  const int position = attribute(primitive.attributes, "POSITION");
  if (position < 0) return shape;
  shape.vertices = accessors.count(position);
  check_attribute_set(accessors, primitive.attributes, shape.vertices, place);
  for (std::size_t t = 0; t < primitive.targets.size(); ++t) {
    for (const auto& [name, index] : primitive.targets[t]) {
      const std::string where = fmt::format("{} target {} {}", place, t, name);
      // The displacement of a tangent has no handedness.
      if (rule_of(name).type != 0 && name != "TEXCOORD_0" &&
          accessors.accessor(index).type != TINYGLTF_TYPE_VEC3 && !name.starts_with("TEXCOORD_")) {
        accessors.fail(index, where, "is not an accessor of VEC3");
      }
      if (accessors.count(index) != shape.vertices) {
        accessors.fail(index, where,
                       fmt::format("has {} elements, but POSITION has {}", accessors.count(index),
                                   shape.vertices));
      }
    }
  }
  const std::size_t joint_sets = check_joint_sets(accessors, primitive.attributes, place);
  if (skin_joints > 0) shape.joint_sets = joint_sets;
  std::uint64_t corners = shape.vertices;
  if (primitive.indices >= 0) {
    const tinygltf::Accessor& indices = accessors.accessor(primitive.indices);
    const std::string where = place + " indices";
    if (indices.type != TINYGLTF_TYPE_SCALAR || indices.normalized ||
        (indices.componentType != kUByte && indices.componentType != kUShort &&
         indices.componentType != kUInt)) {
      accessors.fail(primitive.indices, where, "is not an accessor of unsigned integers");
    }
    corners = indices.count;
  }
  shape.is_surface = primitive.mode >= TINYGLTF_MODE_TRIANGLES;
  if (!shape.is_surface) return shape;
  shape.triangles = triangle_count(primitive.mode, corners);
  shape.has_normals = primitive.attributes.contains("NORMAL");
  const int colours = attribute(primitive.attributes, "COLOR_0");
  shape.has_colours = colours >= 0 && holds_colours(accessors.accessor(colours));
  shape.flattened = shape.has_normals ? shape.vertices : 3 * shape.triangles;
  for (const auto& item : primitive.attributes) {
    const auto set = set_index(item.first, "TEXCOORD_");
    if (set) shape.uv_sets = std::max(shape.uv_sets, *set + 1);
  }
  return shape;
}

AppendCounts append_primitive(const PrimitiveContext& context, const PrimitiveShape& shape,
                              std::uint32_t material, mesh::Mesh& mesh) {
  return PrimitiveReader(context, shape, mesh).append(material);
}

}  // namespace pounce::io
