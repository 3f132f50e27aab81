// SPDX-License-Identifier: Apache-2.0
//
// The whole job, as a list of passes. Start here.
//
//   source mesh ─▶ precondition ─▶ source store ─┐ join
//                                                ├─▶ grid ─▶ project ─▶ results ─▶ pad ─▶ images
//   target mesh ─▶ vectorize ────▶ target store ─┘
//
// Stages are functions from values to values; threads, memory and files are wired in this folder.
//
// run_job() may call transfer_in() twice: again, with `rebuild`, if a pack of the cache turned out
// to be damaged. Everything is planned anew then. What must survive the first attempt is in
// job::JobRun, such as which outputs it wrote.
#include "pounce/transfer.h"

#include "flow/transfer.h"
#include "flow/transfer_plan.h"
#include "job/part_files.h"
#include "job/run_job.h"
#include "planning/describe_job.h"
#include "planning/plan.h"
#include "planning/task_share.h"
#include "pounce/error.h"

namespace pounce {
namespace flow {
namespace {

// Shares of the progress bar, measured on a 4096² transfer of a head with a PNG in and out.
constexpr double kAfterReading = 0.02, kAfterSource = 0.2;

std::unique_ptr<job::JobContext> open_transfer(const TransferOptions& options,
                                               const job::TestKnobs& knobs, job::JobRun& run,
                                               bool rebuild, bool plan_only) {
  auto job = job::open_job(options.resources, options.output, knobs.files, rebuild, plan_only, run);
  if (!options.share.folder.empty()) job->parts_folder = options.share.folder + "/parts";
  job->tile_cap_bytes = knobs.tile_cap_bytes != 0 ? knobs.tile_cap_bytes : mesh::kTileCapBytes;
  return job;
}

void make_targets(job::JobContext& job, TransferPlan& plan, PendingOutputs& pending) {
  Source& source = plan.source();
  // Of several targets each is read again when its turn comes.
  const BesideImages ahead =
      plan.targets() == 1 ? vectorizing_ahead(job, plan.policy(), source.plan(), plan.target(0))
                          : BesideImages{};
  source.build({kAfterReading, kAfterSource}, plan.detail(), ahead);
  // From here on only stores are read, never the source's files.
  const double share = (1 - kAfterSource) / static_cast<double>(plan.targets());
  // Two rounds with --skip-existing: a target whose missing outputs are all in work elsewhere is
  // left for the end. Jobs that start together thus spread over the targets and do not queue at the
  // first one.
  std::vector<std::size_t> left;  // to other jobs with --skip-existing
  const auto make = [&](std::size_t t, OthersWork others) {
    const double begin = kAfterSource + share * static_cast<double>(t);
    return transfer_to(job, plan.policy(), source, plan.target(t), pending, {begin, begin + share},
                       others);
  };
  for (std::size_t t = 0; t < plan.targets(); ++t) {
    if (!make(t, OthersWork::leave)) left.push_back(t);
  }
  for (const std::size_t t : left) make(t, OthersWork::await);
  job.report.tiles_read += source.tiles_read();
}

}  // namespace

void transfer_in(job::JobContext& job, const TransferOptions& options,
                 const job::TestKnobs& knobs) {
  PendingOutputs pending(job);
  try {
    TransferPlan plan(job, options, knobs);
    plan.make(kAfterReading);
    // From here on it is known what will be done and that it fits.
    const bool may_keep = options.skip_existing || options.keep_made;
    if (!may_keep || plan.anything_to_write()) make_targets(job, plan, pending);
    // Its stores go while the last images wait for the disk.
  } catch (const Error& e) {
    // Whoever stops a job hears that it has stopped.
    if (e.kind() != ErrorKind::cancelled) pending.finish();
    throw;
  }
  pending.wait();
  if (options.share.role != TaskRole::assemble) return;
  planning::refuse_missing(job.report.missing);
  job::PartFiles::sweep(job);
}

Report transfer(const TransferOptions& options, const job::TestKnobs& knobs, Progress* progress,
                Report* so_far) {
  return job::run_job(options.resources, progress, so_far, [&](job::JobRun& run, bool rebuild) {
    planning::describe(options, false, run.report);
    planning::check_options(options);
    transfer_in(*open_transfer(options, knobs, run, rebuild, false), options, knobs);
  });
}

PlanReport plan(const TransferOptions& options, const job::TestKnobs& knobs, Progress* progress,
                Report* so_far) {
  const Report report =
      job::run_job(options.resources, progress, so_far, [&](job::JobRun& run, bool rebuild) {
        planning::describe(options, true, run.report);
        planning::check_options(options);
        const auto job = open_transfer(options, knobs, run, rebuild, true);
        TransferPlan(*job, options, knobs).make(1);
      });
  return {report.least_memory_bytes,
          report.least_memory_for,
          report.memory_beside_bytes,
          report.memory_budget_bytes,
          report.threads,
          report.disk_most.value_or(DiskForecast{}),
          report.inputs,
          report.outputs,
          report.kept,
          report.warnings,
          report.half_done};
}

}  // namespace flow

Report transfer(const TransferOptions& options, Progress* progress, Report* so_far) {
  return flow::transfer(options, {}, progress, so_far);
}

PlanReport plan(const TransferOptions& options, Progress* progress, Report* so_far) {
  return flow::plan(options, {}, progress, so_far);
}

}  // namespace pounce
