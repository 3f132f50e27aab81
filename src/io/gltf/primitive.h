// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tiny_gltf.h>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/vec.h"
#include "io/gltf/accessor.h"
#include "io/gltf/scene.h"
#include "mesh/mesh.h"

namespace pounce::io {

/// UV sets beyond these are ignored; no tool writes more.
inline constexpr std::size_t kMaxUvSets = 8;

/// How many vertices and triangles a primitive gives, and which UV sets it has, judged by its
/// accessors alone.
struct PrimitiveShape {
  std::uint64_t vertices = 0;  ///< in the file
  std::uint64_t flattened =
      0;  ///< in the Mesh: three per triangle where there are no normals (flat)
  std::uint64_t triangles = 0;
  std::size_t uv_sets = 0;  ///< one more than the highest TEXCOORD_n
  std::size_t joint_sets = 0;
  bool is_surface = false;  ///< triangles with positions; points and lines are not
  bool has_normals = false;
  bool has_colours = false;  ///< COLOR_0, of a type that glTF has for colours
};

/// What read_primitive() needs besides the primitive.
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

/// Checks types and counts of every attribute. Throws Error(input) naming place and accessor.
PrimitiveShape check_primitive(const AccessorReader& accessors,
                               const tinygltf::Primitive& primitive, const std::string& place,
                               std::size_t skin_joints);

/// Appends a primitive to `mesh`, in world space: positions, normals (flat ones where the file has
/// none), tangents (w = 0 where the file has none), UV sets (zeros where absent; mesh.uv_sets must
/// have its final size), colours on demand (white where absent). Throws Error(input) for indices
/// and values that make no sense.
AppendCounts append_primitive(const PrimitiveContext& context, const PrimitiveShape& shape,
                              std::uint32_t material, mesh::Mesh& mesh);

}  // namespace pounce::io
