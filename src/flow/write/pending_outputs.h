// SPDX-License-Identifier: Apache-2.0
//
// Images that are written and wait for the disk while the next ones are made.
//
// An image is an output once its bytes, its name and its folder are on the disk: some milliseconds
// in which no processor works, again and again where a target has hundreds of UDIMs. A thread of
// its own waits for that, image after image. Until then nobody else may make the image, a later
// run still has what it would go on with, and the report does not name it
// (docs/decisions/087-pending-outputs.md).
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/files/output_file.h"
#include "job/job_context.h"
#include "job/output_claim.h"
#include "job/step_pack.h"
#include "runtime/waiting_thread.h"

namespace pounce::flow {

/// A written image.
struct PendingImage {
  /// Closed; they get their names in this order.
  std::vector<std::unique_ptr<io::OutputFile>> files;
  std::optional<job::OutputClaim> claim;  ///< held until then, whatever becomes of the job
  bool in_place = false;                  ///< the last takes the place of what it was painted onto
};

/// Gives images their names, in order. Not thread-safe.
class PendingOutputs {
 public:
  explicit PendingOutputs(job::JobContext& job);
  ~PendingOutputs();  ///< as finish(), but throws nothing
  PendingOutputs(const PendingOutputs&) = delete;
  PendingOutputs& operator=(const PendingOutputs&) = delete;

  /// Takes over an image. Throws what went wrong with one before: Error(storage).
  void add(PendingImage image);
  /// The images of a step were added: when they are there, what a later run would have gone on
  /// with goes. Null: nothing.
  void end_step(std::unique_ptr<job::StepPack> pack);
  /// Before a step that makes scratch files of its own: those of steps before are gone.
  void begin_step();
  /// All is on the disk, and the report names it. Throws the first thing that went wrong.
  void wait();
  /// The job has met an error: waits for all, and throws what went wrong with an image if nothing
  /// of that kind was thrown before. A job that cannot store its images begins no second attempt.
  void finish();

 private:
  struct Pending {
    PendingImage image;
    std::vector<std::string> committed;
    std::unique_ptr<job::StepPack> pack;
    std::unique_ptr<BegunWork> committing;  ///< works on all above but the pack
  };

  void begin(PendingImage image, std::unique_ptr<job::StepPack> pack);
  void finish_first();
  void report(const Pending& pending);

  job::JobContext& job_;
  bool failed_ = false;  ///< some image got no name: its step is not done
  runtime::WaitingThread thread_;
  std::deque<Pending> pending_;  // stay where they are: the thread works on them
};

}  // namespace pounce::flow
