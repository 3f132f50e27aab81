// SPDX-License-Identifier: Apache-2.0
//
// A mesh as a job sees it: read, turned to the job's axes, and only what was selected.
#include "flow/load_mesh.h"

#include <fmt/format.h>

#include <algorithm>

#include "io/read_mesh.h"
#include "mesh/orient.h"
#include "mesh/select.h"
#include "pounce/error.h"

namespace pounce::flow {

Axes axes_of(const MeshUse& use, const std::string& side) {
  if (use.axes.empty()) return {};
  try {
    return parse_axes(use.axes);
  } catch (const Error& e) {
    throw Error(ErrorKind::usage, fmt::format("--{}-axes: {}", side, e.what()));
  }
}

bool has_textures(const mesh::Mesh& mesh) {
  return std::any_of(mesh.materials.begin(), mesh.materials.end(), [](const mesh::Material& m) {
    return std::any_of(m.textures.begin(), m.textures.end(),
                       [](const auto& texture) { return texture.has_value(); });
  });
}

void refuse_swapped(const mesh::Mesh& source, const mesh::Mesh& target) {
  if (has_textures(source) || !source.colours.empty()) return;
  for (const mesh::UnreadFile& file : source.unread_files) {
    if (!file.refused.empty()) throw Error(ErrorKind::storage, file.refused);
  }
  // It may have some, and whoever needs them says what is missing.
  if (!source.unread_files.empty() || !has_textures(target)) return;
  throw Error(
      ErrorKind::input,
      fmt::format("{}: the source has no texture, but the target {} has; the source comes first: "
                  "swap the two, or give --source-texture baseColor=FILE",
                  source.path, target.path));
}

namespace {

/// White everywhere says nothing, and many programs write it.
void drop_white(std::vector<Vec4f>& colours) {
  const bool is_white = std::all_of(colours.begin(), colours.end(), [](const Vec4f& c) {
    return c == Vec4f{1, 1, 1, 1};
  });
  if (is_white) colours = {};
}

}  // namespace

mesh::Mesh load_mesh(const std::string& path, const MeshUse& use, const std::string& side,
                     bool allow_external, bool keep_rest) {
  const bool is_source = side == "source";
  mesh::Mesh mesh =
      io::read_mesh(path, {allow_external, is_source ? use.uv_set : std::nullopt, true, is_source});
  drop_white(mesh.colours);
  if (!is_source) {  // what matters of a target's is that a renderer shows them
    mesh.has_vertex_colours = !mesh.colours.empty();
    mesh.colours = {};
  }
  mesh::orient(mesh, axes_of(use, side));
  mesh::select(mesh, {use.meshes, use.materials}, side, keep_rest);
  if (use.uv_set && *use.uv_set >= mesh.uv_sets.size()) {
    const std::size_t count = mesh.uv_sets.size();
    throw Error(ErrorKind::input,
                fmt::format("{}: --{}-uv-set {}: there is no such UV set; it has {}{}", path, side,
                            *use.uv_set, count,
                            count == 0   ? ""
                            : count == 1 ? ", number 0"
                                         : fmt::format(", numbers 0 to {}", count - 1)));
  }
  return mesh;
}

}  // namespace pounce::flow
