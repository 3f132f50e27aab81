// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "job/job_context.h"
#include "sorting/block_cutter.h"
#include "store/blocks/splat_block.h"
#include "store/blocks/splat_store.h"

namespace pounce::sorting {

/// A block on its way from the merge to the pack. Keeps its memory for the next. One thread at a
/// time.
struct EncodedBlock {
  BlockCutter::Cut cut;
  store::SplatBlock block;
  std::vector<std::byte> raw, stored;
  store::SplatEntry entry;
  std::vector<float> noise, sizes;  ///< if it is asked; sizes of points' discs

  /// With room for the largest block; `lobes`: of the harmonics of every Gaussian.
  explicit EncodedBlock(std::uint32_t lobes);
  /// Gaussians, columns, encoded and compressed.
  static std::uint64_t most_bytes(std::uint32_t lobes);

  /// What becomes of the Gaussians of a cut before they are stored.
  struct Shaping {
    bool are_points = false;  ///< they become discs
    bool fades = false;       ///< isolated ones
  };
  /// Makes the rest of `cut`.
  void encode(job::JobContext& job, const Shaping& shaping);

 private:
  void store(job::JobContext& job);

  std::uint32_t lobes_;
};

/// Something of a scene, of blocks taken evenly: the noise of its surface, the size of its discs.
/// How many there will be is not known when they pass: every 2^k-th is asked, k grows with their
/// number, and those that were asked too often are forgotten. So the estimate depends on the number
/// of blocks alone.
class BlockEstimate {
 public:
  void add(std::uint64_t ordinal, const std::vector<float>& figures);
  float median(std::uint64_t blocks) const;  ///< of all, once so many have passed

 private:
  std::vector<std::pair<std::uint64_t, std::vector<float>>> asked_;
};

}  // namespace pounce::sorting
