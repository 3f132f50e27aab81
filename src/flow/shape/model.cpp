// SPDX-License-Identifier: Apache-2.0
#include "flow/shape/model.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <optional>
#include <set>
#include <tuple>
#include <vector>

#include "io/read_mesh.h"
#include "job/run_job.h"
#include "planning/describe_job.h"
#include "planning/load_mesh.h"
#include "planning/name_patterns.h"
#include "planning/plan.h"
#include "planning/texture_meaning.h"

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

/// What all materials share that triangles use, where they become one. What they differ by is in an
/// image.
io::PlainLook common_look(const mesh::Mesh& mesh) {
  const std::set<std::uint32_t> used(mesh.triangle_material.begin(), mesh.triangle_material.end());
  const auto is_as_first = [&](std::uint32_t m) {
    return look_of(mesh.materials[m]) == look_of(mesh.materials[*used.begin()]);
  };
  if (!used.empty() && std::all_of(used.begin(), used.end(), is_as_first))
    return look_of(mesh.materials[*used.begin()]);
  std::optional<io::PlainLook> common;
  bool is_masked = true;  // all of them, alike
  for (const std::uint32_t m : used) {
    io::PlainLook own = look_of(mesh.materials[m]);
    const io::PlainLook none;
    if (own.base_color != none.base_color)
      own.base_color = planning::merged_factor(mesh.materials[m], Channel::base_color);
    if (!common) common = own;
    if (common->base_color != own.base_color) common->base_color = none.base_color;
    is_masked = is_masked && own.alpha_cutoff && own.alpha_cutoff == common->alpha_cutoff;
    if (common->roughness != own.roughness || common->metallic != own.metallic) {
      common->roughness = none.roughness;
      common->metallic = none.metallic;
    }
    if (common->emissive != own.emissive || common->emissive_strength != own.emissive_strength) {
      common->emissive = none.emissive;
      common->emissive_strength = none.emissive_strength;
    }
    common->blends = common->blends && own.blends;
    common->double_sided = common->double_sided || own.double_sided;
  }
  if (!common) return {};
  if (!is_masked) common->alpha_cutoff = std::nullopt;
  return *common;
}

}  // namespace

io::PlainLook look_of(const mesh::Material& material) {
  io::PlainLook look;
  look.double_sided = material.double_sided;
  // The factor of an image comes with that, if it comes.
  const auto is_plain = [&](Channel channel) {
    return !material.textures[static_cast<std::size_t>(channel)];
  };
  if (is_plain(Channel::base_color))
    look.base_color = planning::material_factor(material, Channel::base_color);
  if (is_plain(Channel::metallic_roughness) && material.is_pbr) {
    const auto factors = planning::merged_factor(material, Channel::metallic_roughness);
    look.roughness = factors[1];
    look.metallic = factors[2];
  }
  if (is_plain(Channel::emissive)) {
    const auto emissive = planning::merged_factor(material, Channel::emissive);
    std::copy_n(emissive.begin(), 3, look.emissive.begin());
    look.emissive_strength = emissive[3];
  }
  look.alpha_cutoff = material.alpha_cutoff;
  // Of what images show the transfer decides, which sees them.
  look.blends = !material.is_opaque && !look.alpha_cutoff && look.base_color[3] < 1;
  return look;
}

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
      planning::plan_mesh(images, mesh, planning::TexelsAs::surface, true, job.merges_materials);
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
  made.look = common_look(heavy.placed.mesh);
  job.meter.end();
  return made;
}

}  // namespace pounce::flow
