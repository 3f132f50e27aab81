// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "flow/project/mesh.h"
#include "flow/sources/source.h"
#include "flow/sources/texel_source.h"
#include "mesh/mesh.h"
#include "runtime/memory_budget.h"
#include "store/blocks/splat_store.h"

namespace pounce::flow {

/// What all kinds of sources that are textured meshes have in common: the mesh is read and planned
/// once and held until its stores are built.
class MeshSource : public Source {
 public:
  void make_plan(job::MemoryNeeds& needs, planning::DiskPlan& disk,
                 const std::function<void(const mesh::Mesh&)>& check_order) override;
  std::uint64_t held_bytes() const override { return mesh_.size_bytes(); }
  void lease_held() override;
  std::uint64_t reading_bytes() const override;
  std::vector<job::LeastMemory> build_needs() const override;
  std::uint64_t directory_bytes() const override;
  std::size_t target_places() const override;
  std::span<const surface::Place> places() const override { return places_; }

 protected:
  MeshSource(job::JobContext& job, const TransferOptions& options, planning::TexelsAs as,
             bool for_model)
      : Source(job, options), as_(as), for_model_(for_model) {}
  void drop_mesh();
  std::uint64_t geometry_least_bytes() const;  ///< what making the blocks of a pass takes

  mesh::Mesh mesh_;

 private:
  void read();
  void add_tangents(job::MemoryNeeds& needs);
  void report_plan();
  /// What building needs beside its columns and its geometry.
  virtual std::vector<job::LeastMemory> further_needs() const { return {}; }
  virtual void add_stores(planning::DiskPlan& disk) = 0;
  virtual void report_kind() = 0;  ///< what the report says of the kind

  const planning::TexelsAs as_;
  const bool for_model_;
  runtime::Lease mesh_lease_;
  std::vector<surface::Place> places_;
};

// --- what rays see of it -------------------------------------------------------------------------

/// A textured mesh whose surface rays hit: a geometry store per pass and a column per image.
class SurfaceSource final : public MeshSource {
 public:
  SurfaceSource(job::JobContext& job, const TransferOptions& options, bool for_model,
                const job::TestKnobs& knobs);

  std::uint64_t project_least_bytes(std::size_t pass) const override;
  void build(ProgressRange range, const planning::TargetDetail& targets,
             const BesideImages& ahead) override;
  std::uint64_t bytes_read(std::size_t pass) const override;
  Box3f box() const override;
  std::uint64_t tiles_read() const override;
  std::unique_ptr<Projection> projector(std::size_t pass, std::uint32_t page,
                                        const store::GeometryStore& target,
                                        const planning::TargetPlan& target_plan,
                                        const Before& before) const override;
  std::span<const float> layer_gaps() const override { return layer_gaps_; }

 private:
  void add_stores(planning::DiskPlan& disk) override;
  void report_kind() override;
  struct MadeGeometry {
    std::unique_ptr<store::GeometryStore> store;
    bool cached = false;
    runtime::Lease directory;
  };
  std::vector<MadeGeometry> make_geometry();  ///< by pass
  void open_geometry(std::vector<MadeGeometry> made);
  void open_pass(const planning::PassPlan& pass, MadeGeometry made);
  void find_layers();
  void warn_of_coincident();
  std::optional<shading::ShapeOutput> shape_of(const planning::ChannelPlan& channel) const;

  const Filter filter_;
  const NormalY source_y_, output_y_;  ///< of normal maps
  const projection::Kernels* kernels_;
  const projection::BlendLanes* lanes_;
  planning::WantedTiles little_shown_;  ///< of the plan's columns
  SourceColumns columns_;
  std::vector<std::unique_ptr<SurfaceCache>> geometry_;  ///< by pass
  std::vector<float> layer_gaps_;
  std::vector<runtime::Lease> leases_;
  bool all_cached_ = true;
};

// --- its texels as Gaussians ---------------------------------------------------------------------

/// A textured mesh each of whose texels is a Gaussian (--method gaussian): one channel, one pass,
/// one store of Gaussians.
class TexelsSource final : public MeshSource {
 public:
  TexelsSource(job::JobContext& job, const TransferOptions& options, bool for_model,
               const job::TestKnobs& knobs);

  std::uint64_t project_least_bytes(std::size_t pass) const override;
  void build(ProgressRange range, const planning::TargetDetail& targets,
             const BesideImages& ahead) override;
  std::uint64_t bytes_read(std::size_t) const override {
    return splats_->store().pack().bytes_read();
  }
  Box3f box() const override { return splats_->store().directory().middle_box; }
  std::uint64_t tiles_read() const override { return splats_->indices_read(); }
  std::unique_ptr<Projection> projector(std::size_t pass, std::uint32_t page,
                                        const store::GeometryStore& target,
                                        const planning::TargetPlan& target_plan,
                                        const Before& before) const override;

 private:
  void add_stores(planning::DiskPlan& disk) override;
  void report_kind() override;
  std::vector<job::LeastMemory> further_needs() const override;
  const surface::GeometryRequest& geometry() const { return plan_.passes.front().source; }
  std::uint64_t most_gaussians() const;
  Hash128 store_key() const;
  std::unique_ptr<store::SplatStore> sort(const Hash128& key, ProgressRange range) const;

  const double sigma_;
  const bool densify_;
  const projection::SplatKernels* kernels_;
  std::unique_ptr<SplatCache> splats_;
  runtime::Lease directory_lease_;
};

}  // namespace pounce::flow
