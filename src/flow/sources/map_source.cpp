// SPDX-License-Identifier: Apache-2.0
//
// What is left of a transfer when its search is known: images become columns, an image of the map
// becomes a store of hits, and shading looks one up at the other. planning/known_map.h says how a
// map's note stands for the two meshes.
#include "flow/sources/map_source.h"

#include <algorithm>
#include <numeric>

#include "flow/project/known_hits.h"
#include "planning/describe_job.h"
#include "pounce/error.h"

namespace pounce::flow {

MapSource::MapSource(job::JobContext& job, const TransferOptions& options,
                     const job::TestKnobs& knobs)
    : Source(job, options),
      filter_(options.mesh.filter.value_or(kDefaultFilter)),
      lanes_(&projection::blend_lanes(knobs.isa)) {}

void MapSource::make_plan(job::MemoryNeeds& needs, planning::DiskPlan& disk,
                          const std::function<void(const mesh::Mesh&)>&) {
  map_ = planning::read_known_map(options_.source, options_.trust);
  for (const planning::KnownMap::Page& page : map_.pages) files_.push_back(page.path);
  mesh_ = planning::map_source(map_, options_);
  plan_ = planning::plan_mesh(options_, mesh_, planning::TexelsAs::surface, false);
  planning::check_map_channels(map_, options_, plan_);
  if (plan_.passes.size() != 1)
    throw Error(ErrorKind::internal, map_.pattern + ": its channels need several searches");
  plan_.passes.front().keeps_hits = false;  // they are the map's
  needs.keep(plan_.table_bytes);
  for (const planning::ColumnPlan& column : plan_.columns) disk.add_seen_column(column.info, false);
  disk.add_map(map_.size, map_.pages.size());
  job_.report.filter = filter_name(filter_);
  job_.note(planning::factors_note(options_, plan_, mesh_));
  if (!options_.composite.onto.empty())
    job_.note(
        "nothing is filled around the charts, since a map does not know which empty texels belong "
        "to others; pounce transfer --onto does");
  job_.meter.advance(1);
}

std::vector<job::LeastMemory> MapSource::build_needs() const { return column_needs(plan_); }

std::uint64_t MapSource::project_least_bytes(std::size_t pass) const {
  // A page's map is read when its turn comes, before its pieces are under way.
  return std::max(map_hits_bytes(request(map_.pages.front().udim)),
                  known_least_bytes(
                      result_texel_bytes(pass),
                      shading_bytes(colour_tile_bytes(plan_), plan_.passes[pass].channels.size())));
}

void MapSource::build(ProgressRange range, const planning::TargetDetail&, const BesideImages&) {
  const StageTimer timer(job_.clock, "precondition");
  columns_ = build_columns(job_, plan_, {}, range.end);
  if (columns_.all_cached) job_.clock.set_cached("precondition");
  job_.meter.keep(range.end);  // what of it the cache had
}

MapRequest MapSource::request(std::uint32_t udim) const {
  const auto page =
      std::find_if(map_.pages.begin(), map_.pages.end(),
                   [&](const planning::KnownMap::Page& one) { return one.udim == udim; });
  if (page == map_.pages.end())
    throw Error(ErrorKind::internal, map_.pattern + ": a page that the map does not have");
  return {page->path,
          map_.size,
          map_.decoder_bytes,
          map_.note.pages,
          static_cast<float>(map_.note.max_distance),
          options_.trust};
}

std::unique_ptr<Projection> MapSource::projector(std::size_t pass, std::uint32_t page,
                                                 const store::GeometryStore& target,
                                                 const planning::TargetPlan& target_plan,
                                                 const Before&) const {
  bool cached = false;
  auto hits = map_hits(job_, request(target_plan.pages[page].udim), &cached);
  job_.count_store(hits->pack(), cached);
  MeshProjection projection;
  projection.target = &target;
  projection.lookup = {lanes_, projection::kernel_of(filter_), columns_.levels.get()};
  std::vector<mesh::Lattice> lattices;
  for (const planning::MapNote::Material& material : map_.note.materials)
    lattices.push_back(material.lattice);
  for (const std::size_t c : plan_.passes[pass].channels) {
    const planning::ChannelPlan& channel = plan_.channels[c];
    projection.channels.push_back(
        {channel.format, columns_.pages_of(channel, lattices), std::nullopt, false});
  }
  return shade_known(job_, projection, std::move(hits));
}

/// The map does not say which of its empty texels belong to the target.
std::uint64_t MapSource::texels_of(const PageResult& result, std::uint64_t) const {
  return std::accumulate(result.distances.begin(), result.distances.end(), std::uint64_t{0});
}

}  // namespace pounce::flow
