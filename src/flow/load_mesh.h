// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "core/axes.h"
#include "mesh/mesh.h"
#include "pounce/options.h"

namespace pounce::flow {

/// A mesh as a job sees it: read, its axes turned, and only what is selected; a source with the
/// colours of its vertices, unless all are white; a target that only knows whether it has such.
/// `side` is "source" or "target", for messages. `allow_external`: see io::MeshReading.
/// `keep_rest`: what was not selected goes to Mesh::rest instead of being dropped. Throws
/// Error(input) if nothing is selected or the UV set asked for does not exist.
mesh::Mesh load_mesh(const std::string& path, const MeshUse& use, const std::string& side,
                     bool allow_external, bool keep_rest = false);

/// Throws Error(input) where the source has no texture, but this target has: they are in the wrong
/// order. A source whose material files are missing may have some; Error(storage) if one is there
/// and cannot be read.
void refuse_swapped(const mesh::Mesh& source, const mesh::Mesh& target);
bool has_textures(const mesh::Mesh& mesh);

/// The axes of that side. Throws Error(usage) where they make no sense, naming the option.
Axes axes_of(const MeshUse& use, const std::string& side);

}  // namespace pounce::flow
