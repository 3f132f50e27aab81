// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "flow/sources/columns.h"
#include "flow/sources/source.h"
#include "mesh/mesh.h"
#include "runtime/memory_budget.h"

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

}  // namespace pounce::flow
