// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "flow/early_mesh.h"
#include "flow/sources/source.h"
#include "flow/write/model.h"
#include "flow/write/pending_outputs.h"
#include "job/job_context.h"
#include "mesh/mesh.h"
#include "planning/disk.h"
#include "planning/job_hash.h"
#include "planning/others_outputs.h"
#include "planning/plan.h"
#include "planning/task_share.h"

namespace pounce::flow {

/// The blocks of one page that were made before its turn.
struct VectorizedPage {
  planning::Step step;
  std::unique_ptr<store::GeometryStore> store;
  bool cached = false;
};

/// A target that is planned, with its mesh as long as something has to be vectorized.
struct PlannedTarget {
  mesh::Mesh mesh;
  runtime::Lease mesh_lease;
  planning::TargetPlan plan;
  std::optional<ModelOutput> model;
  std::optional<VectorizedPage> ahead;

  bool has_work() const;  ///< is there an image that has to be written?
  void drop_mesh();
};

/// Everything that is decided before any work: what is read, made and written, what it needs, and
/// whatever a user must hear at once. Reads meshes and headers of images. Not thread-safe.
class TransferPlan {
 public:
  /// `job` must outlive it.
  TransferPlan(job::JobContext& job, const TransferOptions& options, const job::TestKnobs& knobs);
  TransferPlan(const TransferPlan&) = delete;
  TransferPlan& operator=(const TransferPlan&) = delete;
  ~TransferPlan() { job_.budget.forget_all(); }  // then the stores close, one by one

  /// Plans the source and all targets; takes the progress bar to `end`. Throws what is wrong,
  /// Error(budget) too where the budget is below what the job needs.
  void make(double end);

  planning::OutputPolicy policy() const;
  Source& source() { return *source_; }
  bool anything_to_write() const { return anything_to_write_; }  ///< --skip-existing may leave none
  const planning::TargetDetail& detail() const { return detail_; }  ///< of all targets
  std::size_t targets() const { return options_.targets.size(); }
  /// This target, planned again unless it is the only one. Stays until the next is asked for.
  PlannedTarget& target(std::size_t t);

 private:
  void plan_source();
  void plan_target_side(std::size_t t, planning::DiskPlan& disk);
  void need_target(const std::string& path);
  void need_pass(std::size_t pass);
  void check_order(const mesh::Mesh& source);
  void plan_one(std::size_t t);
  bool share_out(std::size_t t);
  void name_jobs();
  std::uint64_t contexts() const;
  mesh::Mesh read_target(const std::string& path, std::uint64_t beside);
  std::uint64_t reading_bytes(const std::string& path) const;
  std::uint64_t reading_bytes(const std::string& path, std::uint64_t most_bytes) const;
  void read_early();
  mesh::Mesh load_target(const std::string& path, Vec3d origin) const;
  mesh::Mesh target_mesh(const std::string& path);
  void add_target_tangents();
  void add_inputs(const std::vector<std::string>& files);

  job::JobContext& job_;
  const TransferOptions options_;
  const std::string model_pattern_;  ///< of the output, if that is a model
  const job::TestKnobs knobs_;
  planning::JobHash job_hash_;
  job::MemoryNeeds needs_;
  std::unique_ptr<Source> source_;
  std::optional<EarlyMesh> early_;  ///< of the first target
  runtime::Lease compressors_lease_, tables_lease_;
  PlannedTarget target_;                       ///< planned last
  std::vector<std::string> outputs_, inputs_;  ///< of all targets
  std::vector<planning::WorkUnit> units_;      ///< of all targets
  std::vector<std::size_t> first_unit_;        ///< by target
  planning::TargetDetail detail_;
  bool anything_to_write_ = false;
};

/// Vectorizes the first page that the target will make. Nothing where that may be left to others.
BesideImages vectorizing_ahead(job::JobContext& job, const planning::OutputPolicy& policy,
                               const planning::SourcePlan& source, PlannedTarget& target);

/// What a job with --skip-existing does about outputs that another one is just making.
enum class OthersWork : std::uint8_t {
  leave,  ///< nothing, where there is nothing else to do
  await,  ///< it waits until they are there, or that job is no more
};

/// Makes one target: page after page it is vectorized, projected and written, then the model, if
/// that is the output. What was found goes to the job's report. The target's mesh goes as soon as
/// its last page is vectorized. Images are outputs once `pending` is done with them. False, and
/// nothing done: others are making all of it that is missing.
bool transfer_to(job::JobContext& job, const planning::OutputPolicy& policy, const Source& source,
                 PlannedTarget& target, PendingOutputs& pending, ProgressRange range,
                 OthersWork others);

}  // namespace pounce::flow
