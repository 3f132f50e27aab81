// SPDX-License-Identifier: Apache-2.0
//
// From nodes and primitives to triangles in world space.
//
// pounce has no scene graph: each use of a mesh by a node becomes triangles of its own, morphed,
// skinned and moved. Here is where nodes place meshes (an affine map each, in double precision,
// walked without recursion, since a file may nest as deep as it likes), and how one primitive is
// read, bent and appended.
//
// PrimitiveReader holds one primitive as the file has it, which is the only thing in memory beside
// the mesh and the JSON. Its steps are in the order in which glTF wants them: morph targets, then
// the skin or the node, then normals and tangents by the same map, then the winding where that map
// mirrors. Without normals in the file triangles are flat, so their corners are not shared.
//
// What a number does to the result decides what is done about a bad one: an index or a position
// that makes no sense is refused with its place, a normal or a colour is counted, replaced and
// warned of.
//
// Animations are not played: a transfer sees the pose that nodes and weights have in the file.
// Source and target in different poses would not lie on each other, whatever their textures.
#include "io/gltf/placed_primitive.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string_view>

#include "core/directions.h"

namespace pounce::io {
namespace {

// A Vec is read as so many floats in a row.
static_assert(sizeof(Vec2f) == 8 && sizeof(Vec3f) == 12 && sizeof(Vec4f) == 16);

/// Messages are made for every primitive of every instance, needed or not.
constexpr std::size_t kShownNameBytes = 100;

/// A matrix as it is, or translation * rotation * scale; the rotation is normalised.
Affine local_transform(const tinygltf::Node& node) {
  if (node.matrix.size() == 16) return affine_from_columns(node.matrix.data());
  Affine out;
  if (node.rotation.size() == 4) {
    double x = node.rotation[0], y = node.rotation[1], z = node.rotation[2], w = node.rotation[3];
    const double norm = std::sqrt(x * x + y * y + z * z + w * w);
    x /= norm, y /= norm, z /= norm, w /= norm;
    out.columns = rotation_columns(w, x, y, z);
  }
  if (node.scale.size() == 3) {
    for (std::size_t i = 0; i < 3; ++i) out.columns[i] = out.columns[i] * node.scale[i];
  }
  if (node.translation.size() == 3) {
    out.offset = {node.translation[0], node.translation[1], node.translation[2]};
  }
  return out;
}

/// Nodes that no other names as its child.
std::vector<int> root_nodes(const tinygltf::Model& model) {
  std::vector<bool> is_child(model.nodes.size(), false);
  for (const auto& node : model.nodes) {
    for (const int child : node.children) is_child[static_cast<std::size_t>(child)] = true;
  }
  std::vector<int> roots;
  for (std::size_t i = 0; i < model.nodes.size(); ++i) {
    if (!is_child[i]) roots.push_back(static_cast<int>(i));
  }
  return roots;
}

/// Visits nodes depth first, children in file order, without recursion (files may nest as deep as
/// they like).
template <class F>
void walk(const tinygltf::Model& model, const std::vector<int>& roots, F visit) {
  std::vector<int> stack(roots.rbegin(), roots.rend());
  while (!stack.empty()) {
    const int node = stack.back();
    stack.pop_back();
    visit(static_cast<std::size_t>(node));
    const auto& children = model.nodes[static_cast<std::size_t>(node)].children;
    stack.insert(stack.end(), children.rbegin(), children.rend());
  }
}

/// One primitive being read, before it is put into the mesh.
class PrimitiveReader {
 public:
  PrimitiveReader(const PrimitiveContext& context, const PrimitiveShape& shape, mesh::Mesh& mesh)
      : context_(context), shape_(shape), mesh_(mesh), vertices_(shape.vertices) {}

  AppendCounts append(std::uint32_t material);

 private:
  static int find_in(const std::map<std::string, int>& attributes, const std::string& name) {
    const auto it = attributes.find(name);
    return it == attributes.end() ? -1 : it->second;
  }
  int find(const std::string& name) const { return find_in(context_.primitive.attributes, name); }
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

// Indices are checked one by one: each names a vertex that is read from memory later. The highest
// value of their type would restart a strip in OpenGL, and is forbidden.
void PrimitiveReader::read_triangles() {
  const int index = context_.primitive.indices;
  std::vector<std::uint32_t> corners;
  if (index >= 0) {
    corners.resize(context_.accessors.count(index));
    context_.accessors.read_whole(index, corners.data(), at("indices"));
    const int type = context_.accessors.accessor(index).componentType;
    const std::uint32_t restart = type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE    ? 0xFF
                                  : type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ? 0xFFFF
                                                                                   : 0xFFFFFFFF;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      if (corners[i] == restart) {
        context_.accessors.fail(index, at("indices"),
                                fmt::format("element {} is the primitive restart value {}, which "
                                            "glTF forbids",
                                            i, restart));
      }
      if (corners[i] >= vertices_) {
        context_.accessors.fail(
            index, at("indices"),
            fmt::format("element {} is {}, but only {} vertices exist", i, corners[i], vertices_));
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
      // Every second triangle of a strip is turned, so that all face the same side.
      triangles_[i] = {corner(i), corner(i + 1 + i % 2), corner(i + 2 - i % 2)};
    } else {
      triangles_[i] = {corner(i + 1), corner(i + 2), corner(0)};
    }
  }
}

// In double precision, target by target, in the order of the file: the sum is always the same.
void PrimitiveReader::morph(const std::string& name, std::vector<Vec3f>& values) const {
  const auto& targets = context_.primitive.targets;
  std::vector<Vec3f> delta;
  for (std::size_t t = 0; t < targets.size() && t < context_.morph_weights.size(); ++t) {
    const double weight = context_.morph_weights[t];
    const int index = find_in(targets[t], name);
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

// Any number of sets of four joints. A joint beyond the skin is an error only where its weight
// counts: exporters fill unused places with anything.
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
          context_.accessors.fail(
              find(joints), at(joints),
              fmt::format("element {} refers to joint {}, but the skin has only {}", i,
                          joints_.back()[i][k], context_.joints.size()));
        }
      }
    }
  }
}

// Linear blend skinning, by weights that are made to sum to 1: files of integers miss it a little.
Affine PrimitiveReader::skin_of(std::size_t vertex) const {
  Affine blended;
  blended.columns = {};
  double sum = 0;
  for (const auto& set : weights_) {
    sum += static_cast<double>(set[vertex].x) + set[vertex].y + set[vertex].z + set[vertex].w;
  }
  // Without weights a vertex follows its first joint: it must go somewhere.
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

// Into world space. The winding is what shows which side of a triangle is outside, so where a map
// mirrors, triangles are turned back; of a skin each vertex has a map of its own, and the first
// corner decides.
void PrimitiveReader::transform() {
  const bool skinned = !context_.joints.empty() && shape_.joint_sets > 0;
  if (skinned) read_skin();
  // One entry for all, or with a skin one per vertex: joints may mirror, too.
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
    // Normals stand on the surface and take the cofactors of the map; tangents lie in it and take
    // the map itself.
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

// Every triangle gets corners of its own with the normal of its plane, as glTF has it.
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

// Cofactors instead of an inverse: they exist for flat maps, too.
Vec3d Affine::normal(Vec3d n) const {
  const double sign = determinant() < 0 ? -1 : 1;
  const Vec3d out = cross(columns[1], columns[2]) * n.x + cross(columns[2], columns[0]) * n.y +
                    cross(columns[0], columns[1]) * n.z;
  return out * sign;
}

void Affine::add(const Affine& other, double weight) {
  for (std::size_t i = 0; i < 3; ++i) columns[i] = columns[i] + other.columns[i] * weight;
  offset = offset + other.offset * weight;
}

Affine operator*(const Affine& a, const Affine& b) {
  Affine out;
  for (std::size_t i = 0; i < 3; ++i) out.columns[i] = a.direction(b.columns[i]);
  out.offset = a.point(b.offset);
  return out;
}

Affine affine_from_columns(const double* m) {
  Affine out;
  for (std::size_t i = 0; i < 3; ++i) out.columns[i] = {m[4 * i], m[4 * i + 1], m[4 * i + 2]};
  out.offset = {m[12], m[13], m[14]};
  return out;
}

// In one walk from the roots, so each node costs one product however deep it lies.
std::vector<Affine> world_transforms(const tinygltf::Model& model) {
  std::vector<Affine> worlds(model.nodes.size());
  for (std::size_t i = 0; i < worlds.size(); ++i) worlds[i] = local_transform(model.nodes[i]);
  // A node is visited before its children, so its own entry is already that of the world.
  walk(model, root_nodes(model), [&](std::size_t node) {
    for (const int child : model.nodes[node].children) {
      Affine& below = worlds[static_cast<std::size_t>(child)];
      below = worlds[node] * below;
    }
  });
  return worlds;
}

std::vector<MeshInstance> mesh_instances(const tinygltf::Model& model,
                                         const std::vector<Affine>& worlds) {
  std::vector<MeshInstance> instances;
  if (model.nodes.empty()) {
    for (std::size_t i = 0; i < model.meshes.size(); ++i) {
      instances.push_back({static_cast<int>(i), -1, Affine{}});
    }
    return instances;
  }
  // Other scenes of a file are alternatives, not parts.
  std::vector<int> roots;
  if (model.scenes.empty()) {
    roots = root_nodes(model);
  } else {
    const int scene = model.defaultScene < 0 ? 0 : model.defaultScene;
    roots = model.scenes[static_cast<std::size_t>(scene)].nodes;
  }
  walk(model, roots, [&](std::size_t node) {
    if (model.nodes[node].mesh >= 0) {
      instances.push_back({model.nodes[node].mesh, static_cast<int>(node), worlds[node]});
    }
  });
  return instances;
}

int skin_of(const tinygltf::Model& model, const MeshInstance& instance) {
  return instance.node < 0 ? -1 : model.nodes[static_cast<std::size_t>(instance.node)].skin;
}

const std::vector<double>& weights_of(const tinygltf::Model& model, const MeshInstance& instance) {
  if (instance.node >= 0) {
    const auto& own = model.nodes[static_cast<std::size_t>(instance.node)].weights;
    if (!own.empty()) return own;
  }
  return model.meshes[static_cast<std::size_t>(instance.mesh)].weights;
}

std::string primitive_place(const tinygltf::Model& model, int mesh, std::size_t primitive) {
  const std::string& name = model.meshes[static_cast<std::size_t>(mesh)].name;
  if (name.empty()) return fmt::format("mesh {} primitive {}", mesh, primitive);
  std::size_t shown = std::min(name.size(), kShownNameBytes);
  while (shown < name.size() && (name[shown] & 0xC0) == 0x80) --shown;  // whole characters
  return fmt::format("mesh {} \"{}{}\" primitive {}", mesh, std::string_view(name).substr(0, shown),
                     shown < name.size() ? "..." : "", primitive);
}

AppendCounts append_primitive(const PrimitiveContext& context, const PrimitiveShape& shape,
                              std::uint32_t material, mesh::Mesh& mesh) {
  return PrimitiveReader(context, shape, mesh).append(material);
}

}  // namespace pounce::io
