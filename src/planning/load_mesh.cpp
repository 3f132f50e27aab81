// SPDX-License-Identifier: Apache-2.0
//
// A mesh as a job sees it: read, turned to the job's axes, and only what was selected.
//
// The order is that of the data: positions lose the origin while they are still double precision,
// then axes change, then parts are selected. What comes later, hashes of stores included, sees the
// result only, so a mesh that is stored rotated and one that is rotated by an option share their
// stores.
#include "planning/load_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/job_space.h"
#include "io/read_mesh.h"
#include "mesh/mesh.h"
#include "pounce/error.h"

namespace pounce::planning {

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
  throw Error(ErrorKind::input,
              fmt::format("{}: the source has no texture, but the target {} has one; the source "
                          "comes first: swap the two, or add --source-texture baseColor=FILE",
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

/// So is black, by those that have room for colours and none: it would hide every texture.
void drop_black(mesh::Mesh& mesh) {
  const bool is_black = std::all_of(mesh.colours.begin(), mesh.colours.end(), [](const Vec4f& c) {
    return c.x == 0 && c.y == 0 && c.z == 0;
  });
  if (mesh.colours.empty() || !is_black) return;
  mesh.colours = {};
  mesh.notes.push_back(
      fmt::format("{}: its vertex colours are ignored because all are black (some programs write "
                  "black where there are none)",
                  mesh.path));
}

}  // namespace

mesh::Mesh load_mesh(const std::string& path, const MeshUse& use, const std::string& side,
                     bool allow_external, Vec3d origin, bool keep_rest) {
  // The origin is in the job's axes, and the reader subtracts it in the file's.
  const bool is_source = side == "source";
  const Axes axes = axes_of(use, side);
  mesh::Mesh mesh = io::read_mesh(path, {allow_external, is_source ? use.uv_set : std::nullopt,
                                         true, is_source, axes.undo(origin)});
  drop_white(mesh.colours);
  if (is_source) {
    drop_black(mesh);
  } else {  // what matters of a target's is that a renderer shows them
    mesh.has_vertex_colours = !mesh.colours.empty();
    mesh.colours = {};
  }
  mesh::orient(mesh, axes);
  mesh::select(mesh, {use.meshes, use.materials}, side, keep_rest);
  if (use.uv_set && *use.uv_set >= mesh.uv_sets.size()) {
    const std::size_t count = mesh.uv_sets.size();
    throw Error(ErrorKind::input,
                fmt::format("{}: --{}-uv-set {}: no such UV set; the mesh has {}{}", path, side,
                            *use.uv_set, count,
                            count == 0   ? ""
                            : count == 1 ? ", number 0"
                                         : fmt::format(", numbers 0 to {}", count - 1)));
  }
  return mesh;
}

Box3f box_of(const mesh::Mesh& mesh) {
  Box3f box;
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t v : triangle) box.extend(mesh.positions[v]);
  }
  return box;
}

namespace {

double largest(Vec3d v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); }

/// The value of the last binary digit that is not 0.
double last_digit(double value) {
  int exponent = 0;
  // All 53 binary digits as a whole number: its lowest bit that is set is the last digit.
  auto digits = static_cast<std::int64_t>(std::ldexp(std::frexp(value, &exponent), 53));
  return std::ldexp(static_cast<double>(digits & -digits), exponent - 53);
}

/// The power of two that all positions are multiples of along the axis in which that is largest.
double step_of(const mesh::Mesh& mesh, Vec3d origin) {
  // The origin is a multiple of a much larger power of two than a file's steps, so positions
  // relative to it are still multiples of these steps.
  double step = 0;
  for (const auto axis : {0, 1, 2}) {
    const double from = axis == 0 ? origin.x : axis == 1 ? origin.y : origin.z;
    double along = std::numeric_limits<double>::infinity(), nearest = std::abs(from);
    for (const Vec3f& p : mesh.positions) {
      const float local = axis == 0 ? p.x : axis == 1 ? p.y : p.z;
      if (local != 0) along = std::min(along, last_digit(local));
      nearest = std::min(nearest, std::abs(from + double{local}));
    }
    // Whole numbers may well be meant; what single precision makes is its last place, and nothing
    // finer.
    const double last_place = std::abs(from) * double{std::numeric_limits<float>::epsilon()};
    int exponent = 0;
    std::frexp(nearest, &exponent);
    const bool is_single = along <= last_place && along >= std::ldexp(1.0, exponent - 24);
    if (is_single) step = std::max(step, along);
  }
  return step;
}

}  // namespace

PlacedMesh place_mesh(const std::string& path, const MeshUse& use, const std::string& side,
                      bool allow_external) {
  PlacedMesh placed{load_mesh(path, use, side, allow_external), {}};
  placed.origin = origin_for(box_of(placed.mesh));
  // The first reading has rounded positions to single precision already, so it can show where the
  // mesh is, but not repair it. Nearly all meshes end here.
  if (placed.origin == Vec3d{}) return placed;
  placed.mesh = {};  // the second one takes its memory
  placed.mesh = load_mesh(path, use, side, allow_external, placed.origin);
  return placed;
}

std::string origin_note(const std::string& path, Vec3d origin) {
  if (origin == Vec3d{}) return "";
  return fmt::format(
      "{}: far from the origin for its size, as with map coordinates; positions are processed "
      "relative to ({} {} {}) and written in the file's coordinates",
      path, origin.x, origin.y, origin.z);
}

std::string positions_note(Vec3d origin, Depth depth) {
  if (origin == Vec3d{}) return "";
  int exponent = 0;
  std::frexp(largest(origin), &exponent);
  const bool is_half = depth == Depth::half;
  return fmt::format("position: {} store these coordinates in steps of {:g}",
                     is_half ? "half floats" : "floats",
                     std::ldexp(1.0, exponent - (is_half ? 11 : 24)));
}

std::string coarse_positions(const mesh::Mesh& mesh, Vec3d origin, ImageSize size) {
  constexpr std::size_t kEnough = 64;  // of vertices, to tell single precision from a plan
  if (origin == Vec3d{} || mesh.positions.size() < kEnough) return "";
  double area = 0;
  for (const auto& t : mesh.triangles) {
    const Vec3d a(mesh.positions[t[0]]), b(mesh.positions[t[1]]), c(mesh.positions[t[2]]);
    area += length(cross(b - a, c - a)) / 2;
  }
  const double texel = std::sqrt(area / (double{1} * size.width * size.height));
  const double step = step_of(mesh, origin);
  if (!(step > texel)) return "";
  return fmt::format(
      "{}: stores positions in steps of {:g} (single precision that far from the origin), but a "
      "texel is only about {:.2g} wide: its surface is stepped; export it closer to the origin, "
      "with its offset in a node's translation (glTF), or with more digits (OBJ)",
      mesh.path, step, texel);
}

}  // namespace pounce::planning
