// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tiny_gltf.h>

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "io/gltf/accessor.h"
#include "io/gltf/file.h"
#include "io/gltf/primitive.h"
#include "io/gltf/scene.h"

namespace pounce::io {

/// One mesh of the file, as the nodes see it that show it with a skin, or without.
struct MeshShape {
  std::vector<PrimitiveShape> primitives;
  std::vector<std::size_t> surfaces;  ///< those that become triangles
  std::uint64_t vertices = 0, triangles = 0;
  std::uint64_t skipped = 0, splats = 0;  ///< as Plan counts them
  std::uint64_t largest_primitive_bytes = 0;
  std::uint64_t reading_bytes = 0;   ///< what is read each time it is shown
  std::uint64_t morphing_bytes = 0;  ///< and what comes to that if it is morphed
  std::size_t uv_sets = 0;
  bool has_colours = false;  ///< has one of the primitives?
};

/// What the scene becomes, found without reading geometry.
struct ScenePlan {
  std::vector<Affine> worlds;
  std::vector<MeshInstance> instances;
  std::map<std::pair<int, bool>, MeshShape> meshes;  ///< by mesh and whether it has a skin
  std::vector<const MeshShape*> shapes;              ///< by instance
  std::set<int> skins;                               ///< that instances have
  std::uint64_t vertices = 0, triangles = 0, reading_bytes = 0;
  std::uint64_t skipped = 0;  ///< primitives without a surface
  std::uint64_t splats = 0;   ///< primitives of Gaussians
  std::uint64_t largest_primitive_bytes = 0;
  std::size_t uv_sets = 0;
  bool has_colours = false;

  /// What Mesh::colours takes, where they are asked for.
  std::uint64_t colour_bytes() const { return has_colours ? vertices * sizeof(Vec4f) : 0; }
  std::uint64_t mesh_bytes() const {
    const std::uint64_t per_vertex =
        sizeof(Vec3f) * 2 + sizeof(Vec4f) + uv_sets * sizeof(Vec2f) + (uv_sets + 7) / 8;
    return vertices * per_vertex + triangles * (sizeof(std::uint32_t) * 4);
  }
};

/// Throws Error(input) where the scene is empty, or too large for its file.
ScenePlan plan_scene(const GltfFile& file, const tinygltf::Model& model,
                     const AccessorReader& accessors);

/// The skin of the node that shows a mesh; -1: none.
int skin_of(const tinygltf::Model& model, const MeshInstance& instance);
/// Morph weights: a node's own, or its mesh's.
const std::vector<double>& weights_of(const tinygltf::Model& model, const MeshInstance& instance);
/// "mesh 0 \"Head\" primitive 1", for messages.
std::string primitive_place(const tinygltf::Model& model, int mesh, std::size_t primitive);
/// What makes Gaussians of points in this model, for messages.
std::string splat_extensions(const tinygltf::Model& model);

}  // namespace pounce::io
