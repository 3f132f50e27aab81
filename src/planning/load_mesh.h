// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "core/bounds.h"
#include "core/job_space.h"
#include "core/vec.h"
#include "mesh/mesh.h"
#include "pounce/options.h"

namespace pounce::planning {

/// A mesh as a job sees it: read, its axes turned, and only what is selected; a source with the
/// colours of its vertices, unless all are white or black; a target that only knows whether it has
/// such. `side` is "source" or "target", for messages. `allow_external`: see io::MeshReading.
/// `origin`: the job's, which is subtracted from all positions. `keep_rest`: what was not selected
/// goes to Mesh::rest instead of being dropped. Throws Error(input) if nothing is selected or the
/// UV set asked for does not exist.
mesh::Mesh load_mesh(const std::string& path, const MeshUse& use, const std::string& side,
                     bool allow_external, Vec3d origin = {}, bool keep_rest = false);

/// The same of the mesh that decides where the job's origin is: one that lies far from 0 is read
/// twice. The origin is zero for all others.
struct PlacedMesh {
  mesh::Mesh mesh;
  Vec3d origin;
};
PlacedMesh place_mesh(const std::string& path, const MeshUse& use, const std::string& side,
                      bool allow_external);

/// What a user should know of a job with such an origin; empty for zero.
std::string origin_note(const std::string& path, Vec3d origin);
/// The same of images of positions that are stored so.
std::string positions_note(Vec3d origin, Depth depth);
/// Where the file itself holds positions in steps that are wider than a texel of images of this
/// size, as single precision does far from 0: a warning; else empty.
std::string coarse_positions(const mesh::Mesh& mesh, Vec3d origin, ImageSize size);

/// The box of the mesh's triangles.
Box3f box_of(const mesh::Mesh& mesh);

/// Throws Error(input) where the source has no texture, but this target has: they are in the wrong
/// order. A source whose material files are missing may have some; Error(storage) if one is there
/// and cannot be read.
void refuse_swapped(const mesh::Mesh& source, const mesh::Mesh& target);
bool has_textures(const mesh::Mesh& mesh);

/// The axes of that side. Throws Error(usage) where they make no sense, naming the option.
Axes axes_of(const MeshUse& use, const std::string& side);

}  // namespace pounce::planning
