// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "gaussian/gaussian_source.h"
#include "gaussian/splat_keep.h"
#include "gaussian/splat_statistics.h"
#include "job/job_context.h"
#include "store/blocks/splat_store.h"

namespace pounce::flow {

/// A store of Gaussians to be made.
struct GaussianStoreRequest {
  const gaussian::GaussianSource* source = nullptr;
  Hash128 key;
  std::string path;  ///< of the source, for messages
  store::SplatFacts facts;
  gaussian::SplatKeep keep = {};
  gaussian::FadeIsolated fades = gaussian::FadeIsolated::of_no_scene;
  bool are_points = false;  ///< of a cloud: they become discs (gaussian::make_discs())
  /// For tests: most Gaussians of a run and most runs merged at once; 0 = what the budget holds.
  /// The store does not depend on them.
  std::uint64_t run_splats = 0;
  std::size_t fan_in = 0;
};

/// Raised whenever the same Gaussians would make another store: part of every key.
inline constexpr std::uint32_t kGaussianStoreVersion = 6;

/// Samples, filters and sorts Gaussians into a store of blocks. Advances job.meter by twice their
/// number. Throws Error(input) where none is of use, Error(budget) below
/// gaussian_store_least_bytes().
std::unique_ptr<store::SplatStore> build_gaussian_store(job::JobContext& job,
                                                        const GaussianStoreRequest& request);
/// The least that the work above may need at once, for so many Gaussians whose source reads with
/// `read_bytes`, with `lobes` coefficients of harmonics each.
std::uint64_t gaussian_store_least_bytes(std::uint64_t count, std::uint64_t read_bytes,
                                         std::uint32_t lobes);

/// Counts a store of Gaussians that is the job's source in its report; `cached`: it was there
/// already. Returns the lease of its directory.
runtime::Lease count_splat_store(job::JobContext& job, const store::SplatStore& store, bool cached);

/// What a stored scene has left out, into job.report.source_filtered.
void report_filtered(job::JobContext& job, const store::SplatStore& store);

}  // namespace pounce::flow
