// SPDX-License-Identifier: Apache-2.0
#include "flow/write/pending_outputs.h"

#include <exception>
#include <utility>

#include "core/timer.h"
#include "outcome/not_written.h"

namespace pounce::flow {
namespace {

/// Each image holds descriptors, and the file that it replaces its room on the disk: only what
/// smooths the disk's pace may wait.
constexpr std::size_t kMostPending = 3;

}  // namespace

PendingOutputs::PendingOutputs(job::JobContext& job)
    : job_(job), thread_(job.run.has_spare_thread) {}

PendingOutputs::~PendingOutputs() {
  try {
    finish();
  } catch (...) {
    // Whoever wanted to know has asked. What is there is in the report.
  }
}

void PendingOutputs::add(PendingImage image) {
  if (!image.files.empty()) begin(std::move(image), nullptr);
}

void PendingOutputs::end_step(std::unique_ptr<job::StepPack> pack) {
  if (pack != nullptr) begin({}, std::move(pack));
}

// Begun first: what is whole becomes an output even if one before it did not.
void PendingOutputs::begin(PendingImage image, std::unique_ptr<job::StepPack> pack) {
  Pending& own = pending_.emplace_back();
  own.image = std::move(image);
  own.pack = std::move(pack);
  own.committed.reserve(own.image.files.size());
  own.committing = thread_.begin([&own] {
    for (std::unique_ptr<io::OutputFile>& file : own.image.files) {
      file->commit();
      own.committed.push_back(file->path());
      file.reset();
    }
    own.image.claim.reset();
  });
  while (pending_.size() > kMostPending) finish_first();
}

void PendingOutputs::begin_step() {
  for (const Pending& pending : pending_) {
    if (pending.pack != nullptr) return wait();
  }
}

void PendingOutputs::wait() {
  while (!pending_.empty()) finish_first();
}

void PendingOutputs::finish() {
  std::exception_ptr error;
  const bool was_thrown = failed_;
  while (!pending_.empty()) {
    try {
      finish_first();
    } catch (...) {
      if (!error) error = std::current_exception();
    }
  }
  if (error && !was_thrown) std::rethrow_exception(error);
}

void PendingOutputs::finish_first() {
  const StageTimer timer(job_.clock, "assemble");
  std::exception_ptr error;
  try {
    if (pending_.front().committing != nullptr) pending_.front().committing->wait();
  } catch (...) {
    error = std::current_exception();
  }
  // The thread is done with it. It leaves first: without memory for a report it must not come
  // again.
  const Pending first = std::move(pending_.front());
  pending_.pop_front();
  const bool is_there = first.committed.size() == first.image.files.size();
  failed_ = failed_ || error || !is_there;
  // From here on a second attempt would composite over its own result.
  if (first.image.in_place && is_there) job_.run.painted_in_place = true;
  // Of a step whose images are not all there a later run needs it.
  if (first.pack != nullptr && !failed_) first.pack->forget();
  report(first);
  if (error) std::rethrow_exception(error);
}

// An image before its coverage, which gets its name first.
void PendingOutputs::report(const Pending& pending) {
  job_.report.outputs.insert(job_.report.outputs.end(), pending.committed.rbegin(),
                             pending.committed.rend());
  for (const std::unique_ptr<io::OutputFile>& file : pending.image.files) {
    if (file != nullptr) outcome::not_written(file->path(), job_.report);
  }
}

}  // namespace pounce::flow
