// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pounce/error.h"
#include "pounce/export.h"
#include "pounce/options.h"
#include "pounce/progress.h"
#include "pounce/report.h"

namespace pounce {

/// Transfers the source's appearance onto the target's textures and writes the images; with
/// `options.share` what that says of it. TaskRole::assemble throws Error(busy), once it has made
/// what it can, if parts are missing: Report::missing names them.
///
/// Out of core: never holds more than options.resources.memory_bytes of big data. Same input, same
/// output bytes, at any budget, thread count and cache state. Output files appear whole or not at
/// all.
///
/// Blocks until done; one job may run beside another in one process (each with its own budget).
/// Throws pounce::Error. `progress` may be null; it must outlive the call. `so_far`, if given, is
/// the report also of a job that throws: what was done until then, and its failure.
POUNCE_API Report transfer(const TransferOptions& options, Progress* progress = nullptr,
                           Report* so_far = nullptr);

/// Finds out what transfer() would do with these options, and what it would take: reads the meshes
/// and the headers of images, writes nothing. Throws what transfer() would throw before its work,
/// Error(ErrorKind::budget) among it if the budget is below the least that works: ask with a large
/// one to get the least as a number. `so_far`, if given, is the same as a report (its `failure` and
/// `options` too), also when it throws.
POUNCE_API PlanReport plan(const TransferOptions& options, Progress* progress = nullptr,
                           Report* so_far = nullptr);

/// Vectorizes the target alone and writes its projection maps as images:
/// "position" (xyz in the target's units), "normal" (unit xyz) and "mask" (1 = covered).
/// Same promises as transfer().
POUNCE_API Report maps(const MapsOptions& options, Progress* progress = nullptr,
                       Report* so_far = nullptr);

}  // namespace pounce
