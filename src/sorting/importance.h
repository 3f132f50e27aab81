// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "gaussian/gaussian_source.h"
#include "gaussian/splat_keep.h"
#include "job/job_context.h"

namespace pounce::sorting {

/// How much of a picture a Gaussian can make, as a number to compare by: its opacity times the
/// product of its two larger standard deviations, in double precision, by its bits.
std::uint64_t importance(const store::Splat& splat);

/// The most important Gaussians of a source: exactly so many; of equally important ones the first.
/// Holds eight bytes for each part of the source.
class ImportanceCut {
 public:
  /// Reads the source once, in parts of `part_rows`, and a nameless file of its importances five
  /// times. Advances job.meter by the source's number of rows.
  ImportanceCut(job::JobContext& job, const gaussian::GaussianSource& source,
                const gaussian::SplatKeep& keep, std::uint64_t count, std::uint64_t part_rows);

  /// Gaussians that can be used and are wanted before this part.
  std::uint64_t first(std::size_t part) const { return first_[part]; }
  /// Is the Gaussian among them? `ordinal`: how many come before it.
  bool takes(std::uint64_t importance, std::uint64_t ordinal) const {
    return importance > least_ || (importance == least_ && ordinal < ties_end_);
  }
  /// Gaussians that are among them, and that are not.
  std::uint64_t taken() const { return first_.back() - left_out_; }
  std::uint64_t left_out() const { return left_out_; }

  /// What making it takes beside reading one part: for a source of so many rows.
  static std::uint64_t bytes(std::uint64_t rows, std::uint64_t part_rows);

 private:
  void find(runtime::Meter& meter, const ReadFile& keys, std::uint64_t total, std::uint64_t count);

  PageVector<std::uint64_t> first_;             ///< by part; and the end
  std::uint64_t least_ = 0, ties_end_ = ~0ULL;  ///< what is as important as the last one
  std::uint64_t left_out_ = 0;
};

}  // namespace pounce::sorting
