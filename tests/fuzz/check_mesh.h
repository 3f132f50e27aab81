// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <string>

#include "commands/inspect_mesh.h"
#include "fuzz/fuzz_image.h"
#include "fuzz/fuzz_support.h"
#include "io/read_mesh.h"
#include "mesh/mesh.h"

namespace pounce::fuzz {

inline bool finite(Vec2f v) { return std::isfinite(v.x) && std::isfinite(v.y); }
inline bool finite(Vec3f v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

inline void check_parts(const mesh::Mesh& mesh) {
  std::uint32_t first = 0;
  for (const mesh::Parts::Run& run : mesh.parts.runs) {
    require(run.part < mesh.parts.part_names.size(), "runs name parts");
    require(run.first_triangle >= first && run.first_triangle < mesh.triangles.size(),
            "runs ascend");
    first = run.first_triangle + 1;
  }
  require(mesh.parts.runs.empty() || mesh.parts.runs[0].first_triangle == 0, "runs begin at 0");
  for (const auto& names : mesh.parts.part_names) {
    for (const std::uint32_t name : names)
      require(name < mesh.parts.names.size(), "parts have names");
  }
}

inline void check_materials(const mesh::Mesh& mesh) {
  for (const mesh::Material& material : mesh.materials) {
    for (const auto& factors : material.factors) {
      for (const float factor : factors) require(std::isfinite(factor), "factors are finite");
    }
    for (const mesh::OtherTexture& other : material.other_textures)
      require(other.image < mesh.images.size(), "textures have images");
    for (const auto& binding : material.textures) {
      if (!binding) continue;
      require(binding->image < mesh.images.size(), "textures have images");
      require(binding->uv_set < mesh.uv_sets.size(), "textures lie on UV sets");
    }
  }
}

/// What mesh.h says that readers guarantee.
inline void check_mesh(const mesh::Mesh& mesh) {
  const std::size_t vertices = mesh.positions.size();
  require(mesh.normals.size() == vertices && mesh.tangents.size() == vertices,
          "every vertex has a normal and a tangent");
  require(mesh.triangle_material.size() == mesh.triangles.size(), "every triangle has a material");
  require(mesh.uv_present.size() == mesh.uv_sets.size(), "every UV set says who has it");
  for (const Vec3f& p : mesh.positions) require(finite(p), "positions are finite");
  for (const Vec3f& n : mesh.normals) {
    const double length = std::sqrt(double{n.x} * n.x + double{n.y} * n.y + double{n.z} * n.z);
    require(finite(n) && (length == 0 || std::abs(length - 1) < 1e-3), "normals are unit or zero");
  }
  for (const Vec4f& t : mesh.tangents)
    require(finite(Vec3f{t.x, t.y, t.z}) && std::isfinite(t.w), "tangents are finite");
  for (std::size_t set = 0; set < mesh.uv_sets.size(); ++set) {
    require(mesh.uv_sets[set].size() == vertices, "every UV set has all vertices");
    require(mesh.uv_present[set].empty() || mesh.uv_present[set].size() == vertices,
            "a UV set knows of all vertices or of none");
    for (const Vec2f& uv : mesh.uv_sets[set]) require(finite(uv), "UVs are finite");
  }
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t corner : triangle) require(corner < vertices, "corners are vertices");
  }
  for (const std::uint32_t material : mesh.triangle_material)
    require(material < mesh.materials.size(), "triangles have materials");
  check_parts(mesh);
  check_materials(mesh);
}

/// Reads a mesh as jobs and inspections do, but for the decoders of its images.
inline void read_and_check(const std::string& path) {
  constexpr std::uint64_t kMostBytes = 256 << 20;
  constexpr std::uint64_t kSlackBytes = 1 << 20;
  const io::MeshCost cost = io::mesh_cost(path, {}, kMostBytes);
  if (cost.peak_bytes > kMostBytes) return;  // refused for the memory that it would take
  PeakMemory::start();
  mesh::Mesh mesh = io::read_mesh(path);
  if (PeakMemory::bytes() > cost.peak_bytes + kSlackBytes) {
    std::fprintf(stderr, "took %zu bytes, %zu were announced\n",
                 static_cast<std::size_t>(PeakMemory::bytes()),
                 static_cast<std::size_t>(cost.peak_bytes));
    require(false, "reading takes no more memory than its cost says");
  }
  check_mesh(mesh);
  for (mesh::ImageRef& image : mesh.images) {
    attempt([&] { guard_image(image); });
    image.problem = "not looked at";
  }
  require(!commands::mesh_text(commands::describe(mesh)).empty(), "a mesh can be described");
  mesh::orient(mesh, parse_axes("x,-z,y"));
  mesh::orient(mesh, parse_axes("-x,y,z"));
  check_mesh(mesh);
  attempt([&] {
    mesh::select(mesh, {{"*a*", "[b-d]?"}, {}}, "source", true);
    check_mesh(mesh);
  });
}

}  // namespace pounce::fuzz
