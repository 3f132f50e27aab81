// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "flow/sources/mesh_source.h"
#include "flow/sources/texel_source.h"
#include "store/blocks/splat_store.h"

namespace pounce::flow {

/// A textured mesh each of whose texels is a Gaussian (--method gaussian): one channel, one pass,
/// one store of Gaussians.
class TexelsSource final : public MeshSource {
 public:
  TexelsSource(job::JobContext& job, const TransferOptions& options, bool for_model,
               const job::TestKnobs& knobs);

  std::uint64_t project_least_bytes(std::size_t pass) const override;
  void build(ProgressRange range, std::uint64_t target_texels) override;
  std::uint64_t bytes_read(std::size_t) const override {
    return splats_->store().pack().bytes_read();
  }
  Box3f box() const override { return splats_->store().directory().middle_box; }
  std::uint64_t tiles_read() const override { return splats_->indices_read(); }
  std::unique_ptr<Projection> projector(std::size_t pass, std::uint32_t page,
                                        const store::GeometryStore& target,
                                        const planning::TargetPlan& target_plan,
                                        const projection::SplatFit& fit) const override;

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
