// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "flow/build_splats.h"
#include "flow/job_context.h"
#include "flow/plan.h"
#include "flow/project_mesh.h"
#include "projection/hit_packet.h"
#include "tiles/splat_store.h"

namespace pounce::flow {

/// The preconditioned source of a job: what its targets share. A mesh is a geometry store per pass
/// and a column per image; a splat scene is one store. Not thread-safe.
class SourceStores {
 public:
  /// `job`, `options` and `plan` must outlive it.
  SourceStores(JobContext& job, const TransferOptions& options, const Plan& plan);

  /// Builds the stores or finds them in the cache; takes the progress bar from `begin` to `end`.
  /// The plan's mesh is not needed afterwards.
  void build(double begin, double end);

  /// Puts the source in front of one target's texels, for one pass.
  std::unique_ptr<PageProjector> projector(std::size_t pass, const tiles::GeometryStore& target,
                                           const TargetPlan& target_plan) const;
  /// The pack that a pass reads most.
  const tiles::PackReader& pack(std::size_t pass) const;
  /// Where the source of a pass lies.
  Box3f box(std::size_t pass) const;

 private:
  void build_columns(double end);
  void build_geometry(double end);
  void build_splats(double end);
  std::unique_ptr<PageProjector> mesh_projector(std::size_t pass,
                                                const tiles::GeometryStore& target,
                                                const TargetPlan& target_plan) const;
  std::unique_ptr<PageProjector> splat_projector(const tiles::GeometryStore& target,
                                                 const TargetPlan& target_plan) const;
  float min_cosine() const;

  JobContext& job_;
  const TransferOptions& options_;
  const Plan& plan_;
  const projection::Kernels* kernels_;
  std::vector<std::unique_ptr<tiles::ColourStore>> columns_;     ///< by Plan::columns
  std::vector<TileColumns> tile_sets_;                           ///< by Plan::tile_sets
  std::vector<std::unique_ptr<tiles::GeometryStore>> geometry_;  ///< by pass
  std::unique_ptr<tiles::SplatStore> splats_;
  std::vector<Lease> leases_;
  bool all_cached_ = true;
};

}  // namespace pounce::flow
