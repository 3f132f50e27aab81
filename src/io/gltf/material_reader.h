// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tiny_gltf.h>

#include <string>
#include <vector>

#include "io/gltf/gltf_file.h"
#include "io/problems.h"
#include "mesh/mesh.h"

namespace pounce::io {

/// Fills mesh.images and mesh.materials, one for one with the file's, and after them one called
/// "default" that primitives without a material use. A channel's texture is left out (with a
/// warning) where an extension keeps its image elsewhere. Never throws for what is wrong with an
/// image: ImageRef::problem says it.
void read_gltf_materials(const GltfFile& file, const tinygltf::Model& model, mesh::Mesh& mesh,
                         MeshWarnings& warnings);

/// KHR_texture_transform as a matrix: scale, then rotate, then offset.
mesh::UvTransform gltf_uv_transform(double offset_u, double offset_v, double rotation,
                                    double scale_u, double scale_v);

}  // namespace pounce::io
