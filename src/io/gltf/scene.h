// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tiny_gltf.h>

#include <array>
#include <cstddef>
#include <vector>

#include "core/vec.h"

namespace pounce::io {

/// Affine map of space in double: point -> linear * point + offset. columns[i] is the image of axis
/// i.
struct Affine {
  std::array<Vec3d, 3> columns{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  Vec3d offset;

  Vec3d point(Vec3d p) const { return direction(p) + offset; }
  Vec3d direction(Vec3d d) const { return columns[0] * d.x + columns[1] * d.y + columns[2] * d.z; }
  /// A surface normal, to be normalised: the inverse transpose times |determinant|, which also
  /// holds for flat (singular) maps and keeps the outside outside under mirroring.
  Vec3d normal(Vec3d n) const;
  double determinant() const { return dot(columns[0], cross(columns[1], columns[2])); }
  void add(const Affine& other, double weight);
};
Affine operator*(const Affine& a, const Affine& b);
/// From 16 numbers, column after column, as glTF stores them. The last row is taken as 0 0 0 1.
Affine affine_from_columns(const double* m);

/// One use of a mesh in the scene.
struct MeshInstance {
  int mesh = 0;
  int node = -1;  ///< -1: the file has no nodes, the mesh stands at the origin
  Affine to_world;
};

/// World transforms of all nodes (of every tree, since a skin's joints may lie outside the scene).
std::vector<Affine> world_transforms(const tinygltf::Model& model);

/// The meshes of the scene to read (the default one, else the first, else all root nodes; a file
/// without nodes shows every mesh once), depth first in file order.
std::vector<MeshInstance> mesh_instances(const tinygltf::Model& model,
                                         const std::vector<Affine>& worlds);

}  // namespace pounce::io
