// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tiny_gltf.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/vec.h"
#include "io/gltf/accessor.h"
#include "mesh/mesh.h"

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

/// The skin of the node that shows a mesh; -1: none.
int skin_of(const tinygltf::Model& model, const MeshInstance& instance);
/// Morph weights: a node's own, or its mesh's.
const std::vector<double>& weights_of(const tinygltf::Model& model, const MeshInstance& instance);
/// "mesh 0 \"Head\" primitive 1", for messages.
std::string primitive_place(const tinygltf::Model& model, int mesh, std::size_t primitive);

/// What append_primitive() needs besides the primitive.
struct PrimitiveContext {
  const AccessorReader& accessors;
  const tinygltf::Primitive& primitive;
  std::string place;  ///< "mesh 0 \"Head\" primitive 1", for messages
  const std::vector<double>& morph_weights;
  const Affine& to_world;             ///< used where `joints` is empty
  const std::vector<Affine>& joints;  ///< joint matrices of a skinned node
  bool with_colours = false;          ///< fill Mesh::colours
  Vec3d origin = {};                  ///< is subtracted from positions in space
};

/// What was wrong with a primitive, but not enough to refuse it.
struct AppendCounts {
  std::uint64_t incomplete_triangles = 0;  ///< left out at the end (0 or 1)
  std::uint64_t bad_normals = 0;           ///< of the file: zero or not finite, now zero
  std::uint64_t bad_colours = 0;           ///< of the file: not finite, now white
};

/// Appends a primitive to `mesh`, in world space: positions, normals (flat ones where the file has
/// none), tangents (w = 0 where the file has none), UV sets (zeros where absent; mesh.uv_sets must
/// have its final size), colours on demand (white where absent). Throws Error(input) for indices
/// and values that make no sense.
AppendCounts append_primitive(const PrimitiveContext& context, const PrimitiveShape& shape,
                              std::uint32_t material, mesh::Mesh& mesh);

}  // namespace pounce::io
