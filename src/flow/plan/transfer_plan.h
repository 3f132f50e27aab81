// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "flow/job_context.h"
#include "flow/plan/disk.h"
#include "flow/plan/existing_outputs.h"
#include "flow/plan/job_hash.h"
#include "flow/plan/plan.h"
#include "flow/write/model.h"
#include "mesh/mesh.h"

namespace pounce::flow {

/// A target that is planned, with its mesh as long as something has to be vectorized.
struct PlannedTarget {
  mesh::Mesh mesh;
  runtime::Lease mesh_lease;
  TargetPlan plan;
  std::optional<ModelOutput> model;

  /// Is there an image of this page in these channels that has to be written? Any at all?
  bool has_work(const std::vector<std::size_t>& channels, std::size_t page) const;
  bool has_work() const;
  void drop_mesh();
};

/// Everything that is decided before any work: what is read, made and written, what it needs, and
/// whatever a user must hear at once. Reads meshes and headers of images. Not thread-safe.
class TransferPlan {
 public:
  /// `job` must outlive it. `stripe_rows`: see TestKnobs.
  TransferPlan(JobContext& job, const TransferOptions& options, std::uint32_t stripe_rows);

  /// Plans the source and all targets; takes the progress bar to `end`. Throws what is wrong,
  /// Error(budget) too where the budget is below what the job needs.
  void make(double end);

  const TransferOptions& options() const { return options_; }  ///< a model output as its images
  const Plan& source() const { return source_plan_; }
  bool anything_to_write() const { return anything_to_write_; }  ///< --skip-existing may leave none
  /// Of the images of one channel of the target that has the fewest.
  std::uint64_t least_target_texels() const { return least_target_texels_; }
  /// The stores of the source are made: its mesh is not needed any more.
  void drop_source_mesh();
  /// This target, planned again unless it is the only one. Stays until the next is asked for.
  PlannedTarget& target(std::size_t t);

 private:
  void plan_source_side(DiskPlan& disk);
  void plan_target_side(const std::string& path, DiskPlan& disk);
  void need_target(const std::string& path);
  void check_channel_outputs() const;
  void need(std::uint64_t bytes, const std::string& why);
  void check_order();
  void plan_one(const std::string& path);
  void name_jobs();
  /// Said before they are made: a mesh whose tangents need far more than there is takes long.
  void need_tangents(const mesh::Mesh& mesh, std::uint64_t beside);
  void add_tangents(const TangentPlan& tangents, mesh::Mesh& mesh);
  void keep_what_is_there();
  bool keeps_model(FileTime inputs);
  void warn_of_kept();
  std::uint64_t contexts() const;
  void read_source();
  mesh::Mesh read_target(const std::string& path, std::uint64_t beside);
  std::uint64_t reading_bytes(const std::string& path) const;
  mesh::Mesh load_target(const std::string& path) const;
  void warn_of_own_colours();
  void add_warnings(const std::vector<std::string>& warnings);
  void add_warning(const std::string& warning);  // unless it is empty, as in what follows
  void add_note(const std::string& note);
  void add_inputs(const std::vector<std::string>& files);

  JobContext& job_;
  const TransferOptions options_;
  const std::string model_pattern_;  ///< of the output, if that is a model
  const std::uint32_t stripe_rows_;
  JobHash job_hash_;
  mesh::Mesh source_;
  runtime::Lease source_lease_, compressors_lease_, tables_lease_;
  std::vector<std::string> source_files_;
  Vec3d origin_;
  Plan source_plan_;
  PlannedTarget target_;                       ///< planned last
  std::vector<std::string> outputs_, inputs_;  ///< of all targets
  LeastMemory least_;
  std::uint64_t least_target_texels_ = UINT64_MAX;
  bool anything_to_write_ = false;
};

}  // namespace pounce::flow
