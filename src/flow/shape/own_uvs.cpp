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
#include "job/run_job.h"
#include "mesh/block_bins.h"
#include "mesh/uv_tiles.h"
#include "meshing/collapse.h"
#include "meshing/simplify_wedges.h"
#include "meshing/wedges.h"

namespace pounce::flow {
namespace {

/// Where the reading of the model ends.
constexpr double kAfterReading = 0.3;

using Uvs = std::array<Vec2f, 3>;

/// What a wedge's material stands for: one of the file, and a tile of it.
struct OwnMaterial {
  std::uint32_t material = 0;
  std::optional<std::uint32_t> udim;
  auto operator<=>(const OwnMaterial&) const = default;
};

struct Layout {
  std::vector<Uvs> uvs;                ///< by triangle
  std::vector<std::uint32_t> numbers;  ///< by triangle: of its material
  std::vector<OwnMaterial> materials;  ///< ascending, as in the file
};

/// The set that shows the base colour.
std::uint32_t uv_set_of(const mesh::Material& material, const MeshUse& use) {
  const auto& base = material.textures[static_cast<std::size_t>(Channel::base_color)];
  return use.uv_set.value_or(base ? base->uv_set : 0);
}

/// Do they say on which texels of an image the triangle lies? What a transfer asks of its target.
bool are_usable(const Uvs& uvs, std::uint32_t size) {
  constexpr double kMostPeriods = 65536;
  const auto [left, right] = std::minmax({uvs[0].x, uvs[1].x, uvs[2].x});
  const auto [top, bottom] = std::minmax({uvs[0].y, uvs[1].y, uvs[2].y});
  const double x0 = left, x1 = right, y0 = top, y1 = bottom;
  return mesh::is_near({{x0 * size - 0.5, y0 * size - 0.5}, {x1 * size - 0.5, y1 * size - 0.5}}) &&
         (std::floor(x1) - std::floor(x0) + 1) * (std::floor(y1) - std::floor(y0) + 1) <=
             kMostPeriods;
}

std::vector<Uvs> uvs_of(const mesh::Mesh& mesh, const MeshUse& use, std::uint32_t size) {
  std::vector<Uvs> uvs;
  uvs.reserve(mesh.triangles.size());
  std::uint64_t without = 0;
  std::uint32_t wanted = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const std::uint32_t set = uv_set_of(mesh.materials[mesh.triangle_material[t]], use);
    Uvs& own = uvs.emplace_back();
    bool has_all = true;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = mesh.triangles[t][k];
      has_all = has_all && mesh.has_uv(set, v);
      if (has_all) own[k] = mesh.uv_sets[set][v];
    }
    if (!has_all && ++without == 1) wanted = set;
    if (has_all && !are_usable(own, size)) {
      throw Error(ErrorKind::input,
                  fmt::format("{}: the UVs span too many texels (triangle {}) for --keep-uvs: "
                              "rescale the UVs, use a smaller --size, or leave the option out",
                              mesh.path, t));
    }
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
std::optional<std::uint32_t> tile_of(const Uvs& uvs) {
  const double u = (double{uvs[0].x} + double{uvs[1].x} + double{uvs[2].x}) / 3,
               v = (double{uvs[0].y} + double{uvs[1].y} + double{uvs[2].y}) / 3;
  constexpr double kFar = 1e6;
  if (!(std::abs(u) < kFar && std::abs(v) < kFar)) return std::nullopt;
  return mesh::udim_number(mesh::tile_of_period(static_cast<std::int32_t>(std::floor(u)),
                                                static_cast<std::int32_t>(std::floor(v))));
}

/// Does it lie in one tile, but for what rounding may do?
bool is_within_tile(const Uvs& uvs) {
  constexpr double kSlack = 1e-3;
  const auto is_within = [](double a, double b, double c) {
    const double least = std::floor((a + b + c) / 3);
    return std::min({a, b, c}) >= least - kSlack && std::max({a, b, c}) <= least + 1 + kSlack;
  };
  return is_within(uvs[0].x, uvs[1].x, uvs[2].x) && is_within(uvs[0].y, uvs[1].y, uvs[2].y);
}

/// The materials without a texture whose UVs are laid out in tiles: nothing says that they repeat,
/// and no triangle crosses from one tile to another.
std::vector<bool> untextured_tiles(const mesh::Mesh& mesh, const std::vector<Uvs>& uvs) {
  constexpr std::size_t kMostTiles = 100;  // more: squares that a program has laid side by side
  std::vector<bool> is_tiled;
  for (const mesh::Material& material : mesh.materials) {
    is_tiled.push_back(material.other_textures.empty() &&
                       std::none_of(material.textures.begin(), material.textures.end(),
                                    [](const auto& texture) { return texture.has_value(); }));
  }
  std::vector<std::set<std::uint32_t>> tiles(mesh.materials.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const std::uint32_t material = mesh.triangle_material[t];
    if (!is_tiled[material]) continue;
    const std::optional<std::uint32_t> tile = tile_of(uvs[t]);
    if (tile) tiles[material].insert(*tile);
    is_tiled[material] = tile && is_within_tile(uvs[t]) && tiles[material].size() <= kMostTiles;
  }
  return is_tiled;
}

Layout layout_of(const mesh::Mesh& mesh, const MeshUse& use, const std::vector<bool>& tiled,
                 std::uint32_t size) {
  Layout layout;
  layout.uvs = uvs_of(mesh, use, size);
  const bool leaves_first = std::any_of(layout.uvs.begin(), layout.uvs.end(), [](const Uvs& uvs) {
    return tile_of(uvs) != mesh::kFirstUdim;
  });
  std::vector<bool> has_tiles(mesh.materials.size());
  if (leaves_first) {
    has_tiles = untextured_tiles(mesh, layout.uvs);
    for (std::size_t m = 0; m < has_tiles.size(); ++m) has_tiles[m] = has_tiles[m] || tiled[m];
  }
  std::vector<OwnMaterial> by_triangle;
  by_triangle.reserve(mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const std::uint32_t material = mesh.triangle_material[t];
    by_triangle.push_back({material, std::nullopt});
    if (has_tiles[material]) by_triangle.back().udim = tile_of(layout.uvs[t]);
  }
  layout.materials = by_triangle;
  std::sort(layout.materials.begin(), layout.materials.end());
  layout.materials.erase(std::unique(layout.materials.begin(), layout.materials.end()),
                         layout.materials.end());
  layout.materials.shrink_to_fit();
  layout.numbers.reserve(by_triangle.size());
  for (const OwnMaterial& own : by_triangle) {
    layout.numbers.push_back(static_cast<std::uint32_t>(
        std::lower_bound(layout.materials.begin(), layout.materials.end(), own) -
        layout.materials.begin()));
  }
  return layout;
}

/// Says of which materials nothing can be shown, as their triangles have no area in their UVs:
/// those of a palette's colours, or a model that was never unwrapped.
std::string warning_of_empty(const mesh::Mesh& mesh, const Layout& layout) {
  std::vector<bool> shown(mesh.materials.size()), used(mesh.materials.size());
  for (std::size_t t = 0; t < layout.uvs.size(); ++t) {
    const std::uint32_t material = mesh.triangle_material[t];
    used[material] = true;
    shown[material] = shown[material] || meshing::turn_of(layout.uvs[t]) != 0;
  }
  std::string names;
  for (std::size_t m = 0; m < shown.size(); ++m) {
    if (used[m] && !shown[m]) names += (names.empty() ? "" : ", ") + mesh.materials[m].name;
  }
  if (names.empty()) return {};
  return fmt::format(
      "{}: no triangle of these materials has an area in its UVs, so their new textures stay "
      "empty: "
      "{}; leave --keep-uvs out, or choose other UVs with --source-uv-set of pounce mesh",
      mesh.path, names);
}

/// Texels along the sides of what each material's layout is looked at with.
std::uint32_t edge_of(std::size_t materials, std::uint32_t size) {
  const double each = static_cast<double>(layout_texels(size)) / static_cast<double>(materials);
  return std::clamp(static_cast<std::uint32_t>(std::sqrt(each)), 1U, size);
}

/// What the surface takes beyond what there was room for before it was known: a wedge for each
/// corner of its triangles in the worst case.
runtime::Lease rest_of(job::JobContext& job, const HeavyModel& heavy, const MeshShape& shape,
                       const meshing::WedgeSurface& surface) {
  const std::uint64_t all = meshing::collapsing_bytes_of(surface) + layout_bytes(shape.size);
  if (all <= heavy.room.bytes()) return {};
  const std::string& path = heavy.placed.mesh.path;
  const std::uint64_t least = heavy.held.bytes() + all;
  if (least > job.report.least_memory_bytes) {
    const std::uint64_t made = surface.places.size() * sizeof(Vec3f) +
                               surface.wedges.size() * sizeof(meshing::Wedge) +
                               surface.triangles.size() * sizeof(meshing::Triangle);
    job::require_least(job, {least, "making a lighter " + path}, heavy.held.bytes() + made);
  }
  return {job.budget, all - heavy.room.bytes(), "the surface of " + path};
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
    made.push_back({other, counts[m], look_of(of_file)});
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
  Layout layout = layout_of(mesh, options.source_use, heavy.tiled, shape.size);
  job.warn(warning_of_empty(mesh, layout));
  meshing::WedgeSurface surface =
      meshing::joined(mesh.positions, mesh.triangles, layout.uvs, layout.numbers);
  std::vector<Uvs>().swap(layout.uvs);  // their memory is needed
  std::vector<std::uint32_t>().swap(layout.numbers);
  const runtime::Lease more = rest_of(job, heavy, shape, surface);
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
