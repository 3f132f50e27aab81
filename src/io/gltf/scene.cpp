// SPDX-License-Identifier: Apache-2.0
#include "io/gltf/scene.h"

#include <cmath>

namespace pounce::io {
namespace {

Affine local_transform(const tinygltf::Node& node) {
  if (node.matrix.size() == 16) return affine_from_columns(node.matrix.data());
  Affine out;
  if (node.rotation.size() == 4) {
    double x = node.rotation[0], y = node.rotation[1], z = node.rotation[2], w = node.rotation[3];
    const double norm = std::sqrt(x * x + y * y + z * z + w * w);
    x /= norm, y /= norm, z /= norm, w /= norm;
    out.columns = {{{1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)},
                    {2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)},
                    {2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)}}};
  }
  if (node.scale.size() == 3) {
    for (std::size_t i = 0; i < 3; ++i) out.columns[i] = out.columns[i] * node.scale[i];
  }
  if (node.translation.size() == 3) {
    out.offset = {node.translation[0], node.translation[1], node.translation[2]};
  }
  return out;
}

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

}  // namespace

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

}  // namespace pounce::io
