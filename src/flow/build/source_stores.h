// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "flow/build/source_columns.h"
#include "flow/build/splats.h"
#include "flow/job_context.h"
#include "flow/plan/plan.h"
#include "flow/project/mesh.h"
#include "flow/project/splats.h"
#include "projection/hit_packet.h"
#include "store/blocks/splat_store.h"

namespace pounce::flow {

/// The preconditioned source of a job: what its targets share. A mesh is a geometry store per pass
/// and a column per image; a splat scene, or a mesh whose texels are Gaussians, is one store. Not
/// thread-safe.
class SourceStores {
 public:
  /// `job`, `options` and `plan` must outlive it. `isa`, `fades_isolated`: see TestKnobs.
  SourceStores(JobContext& job, const TransferOptions& options, const Plan& plan,
               const std::string& isa, bool fades_isolated);

  /// Builds the stores or finds them in the cache; takes the progress bar from `begin` to `end`.
  /// `target_texels`: of the target that has the fewest. The plan's mesh is not needed afterwards.
  void build(double begin, double end, std::uint64_t target_texels);

  /// Does a splat scene lie at a target (find_fit)? `places`: strewn over its surface. Nothing for
  /// other sources.
  std::optional<projection::SplatFit> fit(std::span<const target::Place> places,
                                          const TargetPlan& target_plan) const;
  /// Puts the source in front of one target's texels, for one pass. `fit`: of a scene.
  std::unique_ptr<Projection> projector(std::size_t pass, const store::GeometryStore& target,
                                        const TargetPlan& target_plan,
                                        const projection::SplatFit& fit) const;
  /// The pack that a pass reads most.
  const store::PackReader& pack(std::size_t pass) const;
  /// Where the source of a pass lies.
  Box3f box(std::size_t pass) const;
  /// How far away other layers of a mesh lie that face alike: target::layer_gaps() of places all
  /// over it. Nothing for other sources.
  std::span<const float> layer_gaps() const { return layer_gaps_; }
  /// How often a tile's part of an index was read, so far.
  std::uint64_t tiles_read() const;

 private:
  void build_surface(double begin, double end, std::uint64_t target_texels);
  void build_geometry(double end);
  void find_layers();
  void build_splats(double end);
  void build_texels(double begin, double end);
  void count_splats(bool cached);
  std::unique_ptr<Projection> mesh_projector(std::size_t pass, const store::GeometryStore& target,
                                             const TargetPlan& target_plan) const;
  SplatProjection splat_request(const TargetPlan& target_plan) const;
  std::unique_ptr<Projection> splat_projector(std::size_t pass, const store::GeometryStore& target,
                                              const TargetPlan& target_plan,
                                              const projection::SplatFit& fit) const;
  std::unique_ptr<Projection> gaussian_projector(const store::GeometryStore& target,
                                                 const TargetPlan& target_plan) const;
  std::optional<ShapeOutput> shape_of(const ChannelPlan& channel) const;
  float min_cosine() const;

  JobContext& job_;
  const TransferOptions& options_;
  const Plan& plan_;
  const std::string isa_;
  const bool fades_isolated_;
  const projection::Kernels* kernels_;
  SourceColumns columns_;
  std::vector<std::unique_ptr<SurfaceCache>> geometry_;  ///< by pass
  std::unique_ptr<SplatCache> splats_;
  std::vector<float> layer_gaps_;
  std::vector<runtime::Lease> leases_;
  bool all_cached_ = true;
};

}  // namespace pounce::flow
