// SPDX-License-Identifier: Apache-2.0
//
// A mesh as the paper has it: every texel is a Gaussian on the surface, and a target's texel blends
// all that its ray meets (--method gaussian, docs/paper.md).
//
// Columns of colours and blocks of triangles are what the Gaussians are made from (sources/
// texel_source.h); sorted into one store they are all that a projection reads, so where the cache
// has that store no image and no triangle is looked at.
#include "flow/sources/texels_source.h"

#include <algorithm>

#include "flow/project/gaussians.h"
#include "flow/stores/find_store.h"
#include "flow/stores/gaussian_store.h"
#include "planning/job_hash.h"

namespace pounce::flow {
namespace {

/// Raised whenever the same mesh and images would make other Gaussians.
constexpr std::uint32_t kTexelSourceVersion = 1;

}  // namespace

TexelsSource::TexelsSource(job::JobContext& job, const TransferOptions& options, bool for_model,
                           const job::TestKnobs& knobs)
    : MeshSource(job, options, planning::TexelsAs::gaussians, for_model),
      sigma_(options.mesh.sigma_texels.value_or(kDefaultSigma)),
      densify_(options.mesh.densify),
      kernels_(&projection::splat_kernels(knobs.isa)) {}

void TexelsSource::report_kind() {
  job_.report.sigma_texels = sigma_;
  job_.report.densify = densify_;
}

void TexelsSource::add_stores(planning::DiskPlan& disk) {
  for (const planning::ColumnPlan& column : plan_.columns) disk.add_column(column.info);
  disk.add_geometry(geometry());
  disk.add_splats(most_gaussians(), 0, 0);
}

/// Splitting makes at most three of one, on average.
std::uint64_t TexelsSource::most_gaussians() const {
  return texel_count_bound(geometry()) * (densify_ ? 4 : 1);
}

std::vector<job::LeastMemory> TexelsSource::further_needs() const {
  const std::uint64_t triangles =
      std::min<std::uint64_t>(mesh_.triangles.size(), store::kMostTrianglesPerBlock);
  const std::uint64_t reading =
      TexelSource::read_bytes(triangles, triangles * 160 + (1 << 16), colour_tile_bytes(plan_));
  // The list of blocks is in memory beside each step of the sort.
  const std::uint64_t lists = TexelSource::list_bytes(geometry());
  return {{lists + reading, "counting the texels of " + mesh_.path},
          {lists + gaussian_store_least_bytes(most_gaussians(), reading, 0),
           "sorting the texels of " + mesh_.path}};
}

std::uint64_t TexelsSource::project_least_bytes(std::size_t pass) const {
  return project_gaussians_least_bytes(result_texel_bytes(pass));
}

void TexelsSource::build(ProgressRange range, std::uint64_t) {
  const StageTimer timer(job_.clock, "precondition");
  job_.report.isa = kernels_->isa;
  const job::ScratchPack runs_go(job_, store::PackKind::splats);  // what the store is sorted from
  // The key needs hashes of all images, but no decoding: a job that finds its store reads the mesh,
  // the hashes and the store.
  const Hash128 key = store_key();
  auto store =
      find_store(job_, store::PackKind::splats, key, [&](std::unique_ptr<store::PackReader> pack) {
        return std::make_unique<store::SplatStore>(std::move(pack), store::SplatFacts{},
                                                   job_.compressor());
      });
  const bool cached = store != nullptr;
  if (!cached) store = sort(key, range);
  report_filtered(job_, *store);
  splats_ = std::make_unique<SplatCache>(job_.budget, SplatReader{{&job_, std::move(store)}});
  directory_lease_ = count_splat_store(job_, splats_->store(), cached);
  drop_mesh();
  job_.meter.keep(range.end);  // what of it the cache had
}

std::unique_ptr<store::SplatStore> TexelsSource::sort(const Hash128& key,
                                                      ProgressRange range) const {
  // Columns and blocks are needed while Gaussians are made, not afterwards: both are closed when
  // this returns, and their memory with them.
  const auto until = [&](double share) { return range.begin + (range.end - range.begin) * share; };
  const SourceColumns columns = build_columns(job_, plan_, {}, until(0.2));
  job_.meter.begin("precondition", 0, "tiles", until(0.3));
  bool cached = false;
  const auto blocks = geometry_store(job_, geometry(), &cached);
  job_.count_store(blocks->pack(), cached);
  job_.meter.end();
  if (const std::uint64_t degenerate = blocks->directory().degenerate; degenerate > 0)
    job_.report.source_filtered["degenerate triangles"] = degenerate;
  const runtime::Lease lease(job_.budget, blocks->size_bytes(),
                             "the directory of the source store");
  const TexelSource source(
      job_,
      {blocks.get(), columns.pages_of(plan_.channels.front(), plan_.passes.front().source.pages),
       sigma_, densify_, planning::texels_are_linear(plan_)},
      until(0.4));
  job_.meter.begin("sort", 2 * source.count(), "Gaussians", range.end);
  auto made = build_gaussian_store(job_, {&source, key, mesh_.path, {}, {}, false, 0, 0});
  job_.meter.end();
  job_.report.bytes_read += blocks->pack().bytes_read() + columns.bytes_read();
  return made;
}

Hash128 TexelsSource::store_key() const {
  // All that a Gaussian is made of, by content. A term that is missing here is found by no check: a
  // job with other options would get these Gaussians from the cache.
  std::vector<Hash128> columns;
  for (const planning::ColumnPlan& column : plan_.columns)
    columns.push_back(colour_key(job_, request_of(column)));
  Hasher hash;
  hash.add(std::string_view("texels"));
  hash.add(store::kFormatVersion);
  hash.add(kGaussianStoreVersion);
  hash.add(kTexelSourceVersion);
  hash.add(surface::geometry_key(geometry()));
  for (const planning::PageTexture& page : plan_.channels.front().pages)
    planning::add_page(page, columns, hash);
  hash.add(static_cast<std::uint64_t>(plan_.tile_sets.size()));
  for (const planning::TileSetPlan& set : plan_.tile_sets)
    planning::add_tile_set(set, columns, hash);
  hash.add(sigma_);
  hash.add(densify_);
  return hash.digest();
}

std::unique_ptr<Projection> TexelsSource::projector(std::size_t, std::uint32_t,
                                                    const store::GeometryStore& target,
                                                    const planning::TargetPlan& target_plan,
                                                    const projection::SplatFit&) const {
  const planning::ChannelPlan& channel = plan_.channels.front();
  GaussianProjection request;
  request.source = splats_.get();
  request.target = &target;
  request.format = channel.format;
  request.linear = planning::texels_are_linear(plan_);
  request.has_alpha = channel.source_alpha;
  request.kernels = kernels_;
  request.limits.max_distance = target_plan.max_distance;
  request.limits.first_reach = first_reach(target_plan.diagonal, channel.size);
  request.limits.min_cosine = min_cosine_;
  request.smallest_edge = target_plan.smallest_edge;
  return project_gaussians(job_, request);
}

}  // namespace pounce::flow
