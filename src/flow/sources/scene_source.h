// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "flow/project/splats.h"
#include "flow/sources/source.h"
#include "flow/stores/splats.h"

namespace pounce::flow {

/// A trained splat scene: its Gaussians, filtered and sorted into one store.
class SceneSource final : public Source {
 public:
  SceneSource(job::JobContext& job, const TransferOptions& options, bool for_model,
              const job::TestKnobs& knobs);

  void make_plan(job::MemoryNeeds& needs, planning::DiskPlan& disk,
                 const std::function<void(const mesh::Mesh&)>& check_order) override;
  /// What is far from every target need not be sorted.
  void meet(const planning::TargetPlan& target, const mesh::Mesh& mesh) override;
  std::vector<job::LeastMemory> build_needs() const override;
  std::uint64_t directory_bytes() const override;
  std::uint64_t project_least_bytes(std::size_t pass) const override;
  void build(ProgressRange range, const planning::TargetDetail& targets,
             const BesideImages& ahead) override;
  std::uint64_t bytes_read(std::size_t) const override {
    return gaussians_->store().pack().bytes_read();
  }
  Box3f box() const override { return gaussians_->store().directory().middle_box; }
  std::uint64_t tiles_read() const override { return gaussians_->indices_read(); }
  std::unique_ptr<Projection> projector(std::size_t pass, std::uint32_t page,
                                        const store::GeometryStore& target,
                                        const planning::TargetPlan& target_plan,
                                        const Before& before) const override;
  std::unique_ptr<SceneViews> views_of(const planning::TargetPlan& target_plan,
                                       const mesh::Mesh& mesh, double area,
                                       ProgressRange range) const override;
  std::size_t target_places() const override { return surface::kStrewnPlaces; }
  std::optional<projection::SplatFit> fit(std::span<const surface::Place> places,
                                          const planning::TargetPlan& target_plan) const override;
  /// A capture's whole box is made by a few floaters, so that of its middle is known.
  std::string box_name() const override {
    return "The scene without its outer tenths (\"middle\" in pounce inspect)";
  }
  std::string cure() const override;

 private:
  SplatProjection projection(const planning::TargetPlan& target_plan) const;

  const bool for_model_;
  bool looks_around() const;

  const SplatOptions splats_;  ///< how the scene is blended
  const projection::SplatKernels* kernels_;
  const views::ViewKernels* drawing_;
  const std::size_t most_ellipses_;
  planning::SplatRequest request_;
  planning::SceneFacts facts_;
  std::shared_ptr<store::SplatStore> store_;
  std::unique_ptr<SplatCache> gaussians_;
  runtime::Lease directory_lease_;
};

}  // namespace pounce::flow
