// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "mesh/mesh.h"

namespace pounce::mesh {

/// Which triangles of a mesh take part. Patterns as in a shell: * any characters, ? one, [a-c] one
/// of these, \ takes the next character as it is; upper and lower case differ. A name that equals
/// the pattern matches, too, whatever characters it has. Several patterns: any of them.
struct Selection {
  std::vector<std::string> meshes;     ///< of Parts::names; empty = all
  std::vector<std::string> materials;  ///< of material names; empty = all
  bool everything() const { return meshes.empty() && materials.empty(); }
};

/// Does the pattern match the name?
bool matches(const std::string& pattern, const std::string& name);

/// Leaves only the triangles whose part and material are both selected, in file order; vertices,
/// materials and images stay. A pattern that matches nothing while another one does is a warning of
/// the mesh. Throws Error(input) if no triangle is left: it lists the names that there are.
/// `side` is "source" or "target", for messages that name the option. `keep_rest`: the other
/// triangles go to Mesh::rest.
void select(Mesh& mesh, const Selection& selection, const std::string& side,
            bool keep_rest = false);

}  // namespace pounce::mesh
