// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "flow/sources/source.h"
#include "flow/stores/build_stores.h"
#include "planning/known_map.h"
#include "projection/blend_lanes.h"

namespace pounce::flow {

/// A hit map: nothing is searched, images are looked up where it says. Its target is in it.
class MapSource final : public Source {
 public:
  MapSource(job::JobContext& job, const TransferOptions& options, const job::TestKnobs& knobs);

  void make_plan(job::MemoryNeeds& needs, planning::DiskPlan& disk,
                 const std::function<void(const mesh::Mesh&)>& check_order) override;
  std::vector<job::LeastMemory> build_needs() const override;
  std::uint64_t directory_bytes() const override { return 0; }
  std::uint64_t project_least_bytes(std::size_t pass) const override;
  void build(ProgressRange range, const planning::TargetDetail& targets,
             const BesideImages& ahead) override;
  std::uint64_t bytes_read(std::size_t) const override { return 0; }  // each page's counts its own
  Box3f box() const override { return {}; }
  std::uint64_t tiles_read() const override { return 0; }
  std::unique_ptr<Projection> projector(std::size_t pass, std::uint32_t page,
                                        const store::GeometryStore& target,
                                        const planning::TargetPlan& target_plan,
                                        const Before& before) const override;
  std::optional<mesh::Mesh> own_target() const override { return planning::map_target(map_); }
  std::uint64_t texels_of(const PageResult& result, std::uint64_t target_texels) const override;
  std::size_t target_places() const override { return 0; }

 private:
  MapRequest request(std::uint32_t udim) const;

  const Filter filter_;
  const projection::BlendLanes* lanes_;
  planning::KnownMap map_;
  mesh::Mesh mesh_;  ///< planning::map_source()
  SourceColumns columns_;
};

}  // namespace pounce::flow
