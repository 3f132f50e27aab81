// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "gaussian/gaussian_source.h"
#include "gaussian/splat_keep.h"
#include "io/splats/splat_writer.h"
#include "job/job_context.h"

namespace pounce::flow {

/// A file of Gaussians to be written.
struct GaussianFile {
  std::string path;
  io::SplatFileFacts facts;  ///< its lobes are the source's
  gaussian::SplatKeep keep = {};
  std::optional<std::uint64_t> most;  ///< no more than these, the most important ones
};

/// Writes those Gaussians of a source that are wanted, in its order. Takes job.meter through its
/// stages to its end; tells job.report what was written, left out and changed. Returns how many
/// there are in the file; with none, there is no file.
std::uint64_t write_gaussians(job::JobContext& job, const gaussian::GaussianSource& source,
                              const GaussianFile& file);
/// The least that the work above may need at once: for so many Gaussians, of which any range is
/// read with `read_bytes`.
std::uint64_t write_gaussians_least_bytes(const GaussianFile& file, std::uint64_t count,
                                          std::uint64_t read_bytes);

}  // namespace pounce::flow
