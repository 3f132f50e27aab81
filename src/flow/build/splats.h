// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "core/axes.h"
#include "flow/job_context.h"
#include "store/blocks/splat_store.h"

namespace pounce::flow {

/// A splat scene as a source.
struct SplatRequest {
  std::string path;  ///< a 3DGS PLY
  Axes axes;         ///< applied to everything that is read
  /// For tests: most Gaussians of a run and most runs merged at once; 0 = what the budget holds.
  /// The store does not depend on them.
  std::uint64_t run_splats = 0;
  std::size_t fan_in = 0;
};

/// Reads, filters and sorts a scene into a store of blocks, or finds the store in the cache. Takes
/// job.meter through a stage "precondition" whose end is `progress_end`. Adds what was left out to
/// job.report.source_filtered, also where the store was cached. Throws Error(input) where the file
/// is none that we read or no Gaussian of it is of use, Error(budget) below splat_least_bytes().
std::unique_ptr<store::SplatStore> splat_store(JobContext& job, const SplatRequest& request,
                                               bool* cached, double progress_end);
/// The least that the work above may need at once; the same for a file of any length.
std::uint64_t splat_least_bytes(const SplatRequest& request);
/// Gaussians that the scene's file holds.
std::uint64_t splat_count(const SplatRequest& request);

}  // namespace pounce::flow
