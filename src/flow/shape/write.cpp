// SPDX-License-Identifier: Apache-2.0
#include "flow/shape/write.h"

#include <fmt/format.h>

#include <string>

#include "mesh/uv_tiles.h"
#include "meshing/fit.h"
#include "meshing/unfold.h"
#include "unwrap/unwrap.h"

namespace pounce::flow {
namespace {

constexpr int kFitting = 4;  // rounds
/// Cosine: what is a fold in a capture's surface.
constexpr double kOnItsFace = 0.2;

/// Of the surface's room what masks may take while charts are packed, when nothing is unfolded any
/// more: half of what the mesh, its charts and the tiles' rows leave, since masks are many small
/// things.
std::uint64_t masks_bytes(const SourceSurface& made, std::uint32_t tiles) {
  constexpr std::uint64_t kOfTriangle = 700, kOfTile = 1 << 20;
  const std::uint64_t room = made.room.bytes(),
                      taken = kOfTriangle * made.surface.triangles.size() + kOfTile * tiles;
  return room > taken ? (room - taken) / 2 : 0;
}

/// Moves UVs into the tiles of their charts, and sorts triangles by these.
std::vector<io::PlainMaterial> into_tiles(unwrap::Unwrapped& flat, std::uint32_t tiles,
                                          const io::PlainLook& look) {
  if (tiles == 1) return {{"proxy", flat.triangles.size(), look}};
  std::vector<std::vector<unwrap::Triangle>> by_tile(tiles);
  std::vector<std::uint32_t> of_vertex(flat.uvs.size());
  for (std::size_t t = 0; t < flat.triangles.size(); ++t) {
    const std::uint32_t tile = flat.tiles[flat.charts[t]];
    by_tile[tile].push_back(flat.triangles[t]);
    for (const std::uint32_t v : flat.triangles[t]) of_vertex[v] = tile;
  }
  for (std::size_t v = 0; v < flat.uvs.size(); ++v) {
    const mesh::UvTile at = mesh::udim_tile(mesh::kFirstUdim + of_vertex[v]);
    flat.uvs[v].x += static_cast<float>(at.column);
    flat.uvs[v].y += static_cast<float>(mesh::period_y(at));
  }
  std::vector<io::PlainMaterial> materials;
  flat.triangles.clear();
  for (std::uint32_t tile = 0; tile < tiles; ++tile) {
    if (by_tile[tile].empty()) continue;
    materials.push_back({std::to_string(mesh::kFirstUdim + tile), by_tile[tile].size(), look});
    flat.triangles.insert(flat.triangles.end(), by_tile[tile].begin(), by_tile[tile].end());
  }
  return materials;
}

}  // namespace

void write_shape(job::JobContext& job, SourceSurface made, const MeshShape& shape, double end,
                 const std::function<std::uint64_t(const io::PlainMesh&)>& write) {
  const StageTimer timer(job.clock, "mesh");
  job.meter.begin("mesh", 1, "meshes", end);
  meshing::Surface& surface = made.surface;
  const auto poll = [&job] { job.meter.throw_if_cancelled(); };
  if (shape.detail) {
    const meshing::Surface dense = made.is_exact ? surface : meshing::Surface{};
    meshing::simplify_within(surface, length_of(*shape.detail, meshing::box_of(surface)));
    if (made.is_exact) meshing::fit(surface, dense, kFitting, poll);
  } else if (made.is_exact) {
    meshing::simplify_fitted(surface, shape.triangles, poll);
  } else {
    meshing::simplify(surface, shape.triangles);
  }
  if (!made.is_exact) meshing::unfold(surface, kOnItsFace);
  unwrap::Unwrapped flat =
      unwrap::unwrap(surface.positions, surface.triangles,
                     {shape.size, shape.gutter, shape.udims, masks_bytes(made, shape.udims)}, poll);
  if (!flat.fits) {
    throw Error(ErrorKind::usage,
                fmt::format("--size {}: too small for {} charts with {} texels between them; raise "
                            "--size or --udims, or lower --gutter or --triangles",
                            shape.size, flat.chart_count, shape.gutter));
  }
  const std::vector<Vec3f> normals = meshing::normals_of(surface);
  std::vector<Vec3f> positions, own_normals;
  for (const std::uint32_t v : flat.vertex) {
    positions.push_back(surface.positions[v]);
    own_normals.push_back(normals[v]);
  }
  const std::vector<io::PlainMaterial> materials = into_tiles(flat, shape.udims, made.look);
  job.report.bytes_written +=
      write({positions, own_normals, flat.uvs, flat.triangles, materials, made.origin});
  job.note(fmt::format("{} triangles in {} charts, which fill {:.0f} % of the {}",
                       flat.triangles.size(), flat.chart_count, 100 * flat.fill,
                       shape.udims == 1 ? "image" : fmt::format("{} tiles", materials.size())));
  job.meter.advance(1);
  job.meter.end();
}

}  // namespace pounce::flow
