// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "flow/project/mesh.h"
#include "flow/sources/mesh_source.h"

namespace pounce::flow {

/// A textured mesh whose surface rays hit: a geometry store per pass and a column per image.
class SurfaceSource final : public MeshSource {
 public:
  SurfaceSource(job::JobContext& job, const TransferOptions& options, bool for_model,
                const job::TestKnobs& knobs);

  std::uint64_t project_least_bytes(std::size_t pass) const override;
  void build(ProgressRange range, std::uint64_t target_texels) override;
  std::uint64_t bytes_read(std::size_t pass) const override;
  Box3f box() const override;
  std::uint64_t tiles_read() const override;
  std::unique_ptr<Projection> projector(std::size_t pass, std::uint32_t page,
                                        const store::GeometryStore& target,
                                        const planning::TargetPlan& target_plan,
                                        const projection::SplatFit& fit) const override;
  std::span<const float> layer_gaps() const override { return layer_gaps_; }

 private:
  void add_stores(planning::DiskPlan& disk) override;
  void report_kind() override;
  void build_geometry(double end);
  void open_geometry(const planning::PassPlan& pass, bool* cached);
  void find_layers();
  void warn_of_coincident();
  std::optional<shading::ShapeOutput> shape_of(const planning::ChannelPlan& channel) const;

  const Filter filter_;
  const NormalY source_y_, output_y_;  ///< of normal maps
  const projection::Kernels* kernels_;
  const projection::BlendLanes* lanes_;
  WantedTiles little_shown_;  ///< of the plan's columns
  SourceColumns columns_;
  std::vector<std::unique_ptr<SurfaceCache>> geometry_;  ///< by pass
  std::vector<float> layer_gaps_;
  std::vector<runtime::Lease> leases_;
  bool all_cached_ = true;
};

}  // namespace pounce::flow
