// SPDX-License-Identifier: Apache-2.0
//
// A textured mesh as a source, as far as it does not matter what becomes of its texels: it is read,
// planned and held, and says what building its stores takes.
//
// The mesh is the largest thing that planning leaves in memory. It stays for the plan, the tangents
// and the places, and for build(), which turns it into blocks; then it goes. The requests of the
// passes still point to it: of these only the pages may be used from then on.
#include "flow/sources/mesh_source.h"

#include <algorithm>

#include "io/read_mesh.h"
#include "job/run_job.h"
#include "mesh/tangent_space.h"
#include "planning/describe_job.h"
#include "planning/load_mesh.h"
#include "projection/mesh_fit.h"

namespace pounce::flow {

void MeshSource::make_plan(job::MemoryNeeds& needs, planning::DiskPlan& disk,
                           const std::function<void(const mesh::Mesh&)>& check_order) {
  read();
  // Before planning, which would report a swapped pair as missing textures.
  check_order(mesh_);
  // A new plan knows no origin; it was decided when the mesh was read.
  const Vec3d origin = plan_.origin;
  plan_ = planning::plan_mesh(options_, mesh_, as_, for_model_);
  plan_.origin = origin;
  places_ = surface::strew(mesh_, projection::kSourcePlaces);
  needs.keep(plan_.table_bytes);
  if (plan_.tangents) add_tangents(needs);
  add_stores(disk);
  report_plan();
}

void MeshSource::read() {
  const std::string& path = options_.source;
  require_early(job_, {reading_bytes(), "reading " + path}, 0);
  planning::PlacedMesh placed =
      planning::place_mesh(path, options_.source_use, "source", options_.allow_external);
  mesh_ = std::move(placed.mesh);
  files_ = mesh_.files;
  plan_.origin = placed.origin;
  job_.report.origin = {placed.origin.x, placed.origin.y, placed.origin.z};
  for (const std::string& warning : mesh_.warnings) job_.warn(warning);
  for (const std::string& note : mesh_.notes) job_.note(note);
  job_.note(planning::origin_note(path, placed.origin));
  job_.meter.advance(1);
}

/// Said before they are made: a mesh whose tangents need far more than there is takes long.
void MeshSource::add_tangents(job::MemoryNeeds& needs) {
  needs.add_now(mesh_.size_bytes() + mesh::tangents_bytes(mesh_), "the tangents of " + mesh_.path,
                mesh_.size_bytes());
  mesh::set_tangents(mesh_, plan_.tangents->uv_sets, plan_.tangents->keeps_own);
}

void MeshSource::report_plan() {
  for (const planning::ChannelPlan& channel : plan_.channels) {
    if (channel.channel == Channel::position)
      job_.note(planning::positions_note(plan_.origin, channel.format.depth));
  }
  report_kind();
  job_.note(planning::not_transferred(options_, plan_, mesh_));
  if (!for_model_) job_.note(planning::factors_note(options_, plan_, mesh_));
  const std::string coarse =
      planning::coarse_positions(mesh_, plan_.origin, plan_.passes.front().size);
  if (!coarse.empty()) plan_.warnings.push_back(coarse);
}

void MeshSource::lease_held() {
  mesh_lease_ = runtime::Lease(job_.budget, mesh_.size_bytes(), "the source's mesh");
}

void MeshSource::drop_mesh() {
  mesh_ = {};
  mesh_lease_ = {};
}

std::uint64_t MeshSource::reading_bytes() const {
  return io::mesh_cost(options_.source, {options_.allow_external, {}, true}, job_.budget.limit())
      .peak_bytes;
}

std::vector<job::LeastMemory> MeshSource::build_needs() const {
  std::vector<job::LeastMemory> needs = column_needs(plan_);
  for (job::LeastMemory& need : further_needs()) needs.push_back(std::move(need));
  for (const planning::PassPlan& pass : plan_.passes) {
    needs.push_back({surface::geometry_least_bytes(pass.source, job_.tile_cap_bytes),
                     "preconditioning " + mesh_.path});
  }
  return needs;
}

std::uint64_t MeshSource::directory_bytes() const {
  std::uint64_t bytes = 0;
  for (const planning::PassPlan& pass : plan_.passes)
    bytes += surface::geometry_directory_bytes(pass.source, job_.tile_cap_bytes);
  return bytes;
}

std::size_t MeshSource::target_places() const { return projection::kTargetPlaces; }

}  // namespace pounce::flow
