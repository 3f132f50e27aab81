// SPDX-License-Identifier: Apache-2.0
//
// A job that several tasks share: who makes which image, or which part of one.
//
// Every task works this out for itself, from the same files, and none knows whether the others are
// at work: so it depends on meshes, sizes and the number of tasks alone, never on what is there
// already.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "planning/plan.h"
#include "pounce/options.h"
#include "pounce/report.h"
#include "store/blocks/geometry_store.h"
#include "store/pack/codec.h"

namespace pounce::planning {

/// A page of a pass as work that somebody has to do.
struct WorkUnit {
  double cost = 0;        ///< in texels of one channel that are covered
  bool in_parts = false;  ///< an image of a model, which nobody can write alone
};

/// The units of a target, pass by pass.
void add_units(const SourcePlan& source, const TargetPlan& target, bool is_model,
               std::vector<WorkUnit>& units);

/// What they take on one thread, roughly.
double work_seconds(const std::vector<WorkUnit>& units, const TransferOptions& options,
                    const SourcePlan& source);

/// Who makes what, by unit. Whole images, the largest first, each to the task that has the least
/// so far. Where that leaves one task with more than a quarter above the mean, units are cut into
/// parts; not unless `may_cut`.
std::vector<StepShare> share_out(const std::vector<WorkUnit>& units, std::uint32_t tasks,
                                 bool may_cut);
/// The most that a task of these shares does, over the mean; 1 where there is no work.
double imbalance(const std::vector<WorkUnit>& units, const std::vector<StepShare>& shares,
                 std::uint32_t tasks);

/// Gives a target its shares, the ones from `first` on. What others make is kept from then on:
/// images of other tasks, and of TaskRole::prepare pages that no two tasks read.
void take_shares(const std::vector<StepShare>& shares, std::size_t first, const TaskShare& share,
                 const SourcePlan& source, TargetPlan& target);

/// Throws Error(busy) that names what is missing, and who has to make it, if anything is.
void refuse_missing(const std::vector<MissingImage>& missing);

/// Calls visit(block, its task) for each block of a page's store, in their order.
void visit_tasks(const store::GeometryStore& target, store::Compressor& compressor,
                 const StepShare& share,
                 const std::function<void(const store::BlockEntry&, std::uint32_t task)>& visit);

/// The part, of so many, in which a block lies that has `texels` behind `before` of the page's
/// `all`.
std::uint32_t part_of(std::uint64_t before, std::uint64_t texels, std::uint64_t all,
                      std::size_t parts);

}  // namespace pounce::planning
