// SPDX-License-Identifier: Apache-2.0
//
// Outputs that other jobs make: with --skip-existing several share them
// (docs/decisions/039-output-claims.md).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "job/job_context.h"
#include "job/output_claim.h"
#include "planning/existing_outputs.h"
#include "planning/plan.h"

namespace pounce::planning {

/// A page of a pass: what is vectorized, projected and written at once.
struct Step {
  std::size_t pass = 0;
  std::uint32_t page = 0;
  bool operator==(const Step&) const = default;
};

/// The images of a step that are not kept.
std::vector<std::string> images_to_make(const SourcePlan& source, const TargetPlan& target,
                                        const Step& step);

/// What others make of a target. Without --skip-existing there are no others. Not thread-safe.
class OthersOutputs {
 public:
  OthersOutputs(job::JobContext& job, const OutputPolicy& policy, const SourcePlan& source,
                TargetPlan& target, ModelFile model)
      : job_(job), policy_(policy), source_(source), target_(target), model_(std::move(model)) {}

  /// Nothing if another job makes some of it. A model is claimed as a whole.
  std::optional<job::OutputClaim> claim(const Step& step);
  bool is_any_free(const std::vector<Step>& steps);
  /// Keeps the images of a step that others have made meanwhile; returns their channels.
  std::vector<std::size_t> keep_made(const Step& step);
  /// A moment; throws Error(busy) where nobody may be waited for.
  void wait();
  job::OutputClaim await_model();
  /// Has another job made the model, and all files beside it? Then its images are kept.
  bool keep_made_model();

 private:
  job::JobContext& job_;
  const OutputPolicy policy_;
  const SourcePlan& source_;
  TargetPlan& target_;
  const ModelFile model_;
  std::string other_;  ///< job that has claimed what this one wanted, for messages
};

}  // namespace pounce::planning
