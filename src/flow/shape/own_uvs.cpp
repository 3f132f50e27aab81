// SPDX-License-Identifier: Apache-2.0
//
// A lighter model in the layout of the heavy one. Its UVs are those of the file as they are: a
// transform that a material has for its textures is not applied, since new ones are made, which
// need none. Where a texture is a set of UDIM tiles, glTF has no such thing: each tile is a
// material of its own, whose texture repeats, so that its UVs need not change.
#include "flow/shape/own_uvs.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "flow/shape/model.h"
#include "mesh/uv_tiles.h"
#include "meshing/simplify_wedges.h"
#include "meshing/wedges.h"

namespace pounce::flow {
namespace {

/// Where the reading of the model ends.
constexpr double kAfterReading = 0.3;

/// What a wedge's material stands for: one of the file, and a tile of it.
struct OwnMaterial {
  std::uint32_t material = 0;
  std::optional<std::uint32_t> udim;
  auto operator<=>(const OwnMaterial&) const = default;
};

struct Layout {
  std::vector<std::array<Vec2f, 3>> uvs;  ///< by triangle
  std::vector<std::uint32_t> numbers;     ///< by triangle: of its material
  std::vector<OwnMaterial> materials;     ///< ascending, as in the file
};

/// The set that shows the base colour.
std::uint32_t uv_set_of(const mesh::Material& material, const MeshUse& use) {
  const auto& base = material.textures[static_cast<std::size_t>(Channel::base_color)];
  return use.uv_set.value_or(base ? base->uv_set : 0);
}

std::vector<std::array<Vec2f, 3>> uvs_of(const mesh::Mesh& mesh, const MeshUse& use) {
  std::vector<std::array<Vec2f, 3>> uvs;
  std::uint64_t without = 0;
  std::uint32_t wanted = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const std::uint32_t set = uv_set_of(mesh.materials[mesh.triangle_material[t]], use);
    std::array<Vec2f, 3>& own = uvs.emplace_back();
    bool has_all = true;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = mesh.triangles[t][k];
      has_all = has_all && mesh.has_uv(set, v);
      if (has_all) own[k] = mesh.uv_sets[set][v];
    }
    if (has_all) continue;
    if (++without == 1) wanted = set;
  }
  if (without > 0) {
    throw Error(ErrorKind::input,
                fmt::format("{}: {} of {} triangles have no UVs (set {}), which --keep-uvs needs; "
                            "leave the option out, or choose what has some with --source-mesh, "
                            "--source-material or --source-uv-set of pounce mesh",
                            mesh.path, without, mesh.triangles.size(), wanted));
  }
  return uvs;
}

/// The tile that the triangle's middle lies in; nothing: beyond all that have a number.
std::optional<std::uint32_t> tile_of(const std::array<Vec2f, 3>& uvs) {
  const double u = (double{uvs[0].x} + double{uvs[1].x} + double{uvs[2].x}) / 3,
               v = (double{uvs[0].y} + double{uvs[1].y} + double{uvs[2].y}) / 3;
  constexpr double kFar = 1e6;
  if (!(std::abs(u) < kFar && std::abs(v) < kFar)) return std::nullopt;
  return mesh::udim_number(mesh::tile_of_period(static_cast<std::int32_t>(std::floor(u)),
                                                static_cast<std::int32_t>(std::floor(v))));
}

Layout layout_of(const mesh::Mesh& mesh, const MeshUse& use, const std::vector<bool>& tiled) {
  Layout layout;
  layout.uvs = uvs_of(mesh, use);
  const bool leaves_first = std::any_of(layout.uvs.begin(), layout.uvs.end(), [](const auto& uvs) {
    return tile_of(uvs) != mesh::kFirstUdim;
  });
  const std::vector<bool> has_tiles =
      leaves_first ? tiled : std::vector<bool>(mesh.materials.size());
  std::vector<OwnMaterial> by_triangle;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const std::uint32_t material = mesh.triangle_material[t];
    by_triangle.push_back({material, std::nullopt});
    if (has_tiles[material]) by_triangle.back().udim = tile_of(layout.uvs[t]);
  }
  layout.materials = by_triangle;
  std::sort(layout.materials.begin(), layout.materials.end());
  layout.materials.erase(std::unique(layout.materials.begin(), layout.materials.end()),
                         layout.materials.end());
  for (const OwnMaterial& own : by_triangle) {
    layout.numbers.push_back(static_cast<std::uint32_t>(
        std::lower_bound(layout.materials.begin(), layout.materials.end(), own) -
        layout.materials.begin()));
  }
  return layout;
}

/// Texels along the sides of what each material's layout is looked at with.
std::uint32_t edge_of(std::size_t materials, std::uint32_t size) {
  const double each = static_cast<double>(layout_texels(size)) / static_cast<double>(materials);
  return std::clamp(static_cast<std::uint32_t>(std::sqrt(each)), 1U, size);
}

/// As in the file, with the triangles of each one after the other. No two have one name, which
/// images are named by.
std::vector<io::PlainMaterial> order_by_material(meshing::WedgeSurface& surface,
                                                 const mesh::Mesh& mesh, const Layout& layout) {
  const auto material = [&](const meshing::Triangle& t) { return surface.wedges[t[0]].material; };
  std::stable_sort(surface.triangles.begin(), surface.triangles.end(),
                   [&](const meshing::Triangle& a, const meshing::Triangle& b) {
                     return material(a) < material(b);
                   });
  std::vector<std::uint64_t> counts(layout.materials.size());
  for (const meshing::Triangle& t : surface.triangles) ++counts[material(t)];
  std::vector<io::PlainMaterial> made;
  std::set<std::string> names;
  for (std::size_t m = 0; m < counts.size(); ++m) {
    if (counts[m] == 0) continue;
    const OwnMaterial& own = layout.materials[m];
    const mesh::Material& of_file = mesh.materials[own.material];
    const std::string name =
        own.udim ? fmt::format("{}.{}", of_file.name, *own.udim) : of_file.name;
    std::string other = name;
    for (int k = 2; !names.insert(other).second; ++k) other = fmt::format("{}_{}", name, k);
    made.push_back({other, counts[m], of_file.double_sided});
  }
  return made;
}

}  // namespace

void write_with_own_uvs(job::JobContext& job, const TransferOptions& options,
                        const MeshShape& shape, double end,
                        const std::function<std::uint64_t(const io::PlainMesh&)>& write) {
  std::optional<StageTimer> timer(std::in_place, job.clock, "read");
  job.meter.begin("read meshes", 1, "meshes", kAfterReading * end);
  const HeavyModel heavy = read_heavy(job, options, shape);
  const mesh::Mesh& mesh = heavy.placed.mesh;
  const Layout layout = layout_of(mesh, options.source_use, heavy.tiled);
  meshing::WedgeSurface surface =
      meshing::joined(mesh.positions, mesh.triangles, layout.uvs, layout.numbers);
  job.meter.end();
  timer.emplace(job.clock, "mesh");
  job.meter.begin("mesh", 1, "meshes", end);
  const auto poll = [&job] { job.meter.throw_if_cancelled(); };
  const std::uint32_t edge = edge_of(layout.materials.size(), shape.size);
  const meshing::SharedTexels texels =
      shape.detail ? meshing::simplify_within(
                         surface, length_of(*shape.detail, planning::box_of(mesh)), edge, poll)
                   : meshing::simplify_fitted(surface, shape.triangles, edge, poll);
  const std::vector<io::PlainMaterial> materials = order_by_material(surface, mesh, layout);
  const std::vector<Vec3f> at_places = meshing::normals_of(meshing::welded(surface));
  std::vector<Vec3f> positions, normals;
  std::vector<Vec2f> uvs;
  for (const meshing::Wedge& w : surface.wedges) {
    positions.push_back(surface.places[w.place]);
    normals.push_back(at_places[w.place]);
    uvs.push_back(w.uv);
  }
  job.report.bytes_written +=
      write({positions, normals, uvs, surface.triangles, materials, heavy.placed.origin});
  job.note(fmt::format("{} triangles in {} material{}, with the UVs of {}",
                       surface.triangles.size(), materials.size(), materials.size() == 1 ? "" : "s",
                       mesh.path));
  // None, as far as these texels tell; where folds of the file itself are simplified, a few.
  if (texels.after > texels.before) {
    job.warn(
        fmt::format("{}: with {} texels along a texture's sides, {} more than in {} have several "
                    "triangles on them; ask for more triangles",
                    options.output, edge, texels.after - texels.before, mesh.path));
  }
  job.meter.advance(1);
  job.meter.end();
}

}  // namespace pounce::flow
