// SPDX-License-Identifier: Apache-2.0
#include "flow/shape/model.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <tuple>
#include <vector>

#include "io/read_mesh.h"
#include "job/run_job.h"
#include "planning/describe_job.h"
#include "planning/load_mesh.h"
#include "planning/name_patterns.h"
#include "planning/plan.h"

namespace pounce::flow {
namespace {

/// What a transfer of small images needs, which follows.
constexpr std::uint64_t kTransferring = 12ULL << 20;

/// Vertices at one place become one. Triangles of which two corners are one then go.
meshing::Surface welded(const mesh::Mesh& mesh) {
  std::vector<std::uint32_t> order(mesh.positions.size()), number(mesh.positions.size());
  std::iota(order.begin(), order.end(), 0U);
  const auto place = [&](std::uint32_t v) {
    const Vec3f& p = mesh.positions[v];
    return std::tuple(p.x, p.y, p.z, v);
  };
  std::sort(order.begin(), order.end(),
            [&](std::uint32_t a, std::uint32_t b) { return place(a) < place(b); });
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool is_same = i > 0 && mesh.positions[order[i]] == mesh.positions[order[i - 1]];
    number[order[i]] = is_same ? number[order[i - 1]] : order[i];
  }
  meshing::Surface surface;
  surface.positions = mesh.positions;
  surface.triangles.reserve(mesh.triangles.size());
  for (const auto& t : mesh.triangles) {
    const meshing::Triangle own{number[t[0]], number[t[1]], number[t[2]]};
    if (own[0] != own[1] && own[1] != own[2] && own[2] != own[0]) surface.triangles.push_back(own);
  }
  meshing::drop_unused(surface);
  return surface;
}

}  // namespace

HeavyModel read_heavy(job::JobContext& job, const TransferOptions& options,
                      const MeshShape& shape) {
  const std::string& path = options.source;
  const io::MeshCost cost = io::mesh_cost(path, {options.allow_external, {}}, job.budget.limit());
  require_early(job, {cost.peak_bytes, "reading " + path}, 0);
  HeavyModel made{
      planning::place_mesh(path, options.source_use, "source", options.allow_external), {}, {}, {}};
  const mesh::Mesh& mesh = made.placed.mesh;
  planning::add_input(path, job.report);
  for (const std::string& file : mesh.files) planning::add_input(file, job.report);
  planning::refuse_over_input(options.output, {path});
  planning::refuse_over_input(options.output, mesh.files);
  const Vec3f size = planning::box_of(mesh).hi - planning::box_of(mesh).lo;
  if (const float longest = std::max({size.x, size.y, size.z}); !is_usable_size(longest)) {
    throw Error(
        ErrorKind::input,
        fmt::format("{}: spans {:g} units, of which no mesh can be made; scale it", path, longest));
  }
  // What the transfer would refuse of the textures is refused before the mesh is made for it.
  TransferOptions images = options;
  images.output = planning::model_image_pattern(options.output);
  const planning::SourcePlan plan =
      planning::plan_mesh(images, mesh, planning::TexelsAs::surface, true);
  made.tiled.resize(mesh.materials.size());
  for (const planning::ChannelPlan& channel : plan.channels) {
    for (std::size_t m = 0; m < made.tiled.size(); ++m)
      made.tiled[m] = made.tiled[m] || channel.pages[m].tile_set >= 0;
  }
  const std::uint64_t count = mesh.triangles.size();
  const std::uint64_t left = shape.detail ? count : std::min<std::uint64_t>(count, shape.triangles);
  const std::uint64_t laying =
      shape.keep_uvs ? collapsing_bytes(count) + layout_bytes(shape.size) : unfolding_bytes(left);
  const std::uint64_t room = std::max(fitting_bytes(count), laying);
  const std::uint64_t most = std::max(
      {cost.peak_bytes, mesh.size_bytes() + room,
       kTransferring + job.threads * store::Compressor::context_bytes() + mesh.size_bytes()});
  require_least(job, {most, "making a lighter " + path}, mesh.size_bytes());
  made.held = runtime::Lease(job.budget, mesh.size_bytes(), "the mesh of " + path);
  made.room = runtime::Lease(job.budget, room, "the surface of " + path);
  return made;
}

SourceSurface surface_of_model(job::JobContext& job, const TransferOptions& options,
                               const MeshShape& shape, double end) {
  const StageTimer timer(job.clock, "read");
  job.meter.begin("read meshes", 1, "meshes", end);
  HeavyModel heavy = read_heavy(job, options, shape);
  SourceSurface made;
  made.room = std::move(heavy.room);
  made.surface = welded(heavy.placed.mesh);
  made.origin = heavy.placed.origin;
  made.is_exact = true;
  job.meter.end();
  return made;
}

}  // namespace pounce::flow
