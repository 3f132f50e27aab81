// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/page_pool.h"
#include "store/blocks/splat_block.h"
#include "store/blocks/splat_store.h"

namespace pounce::gaussian {

/// Gaussians in an order of their own, of which any range can be read: what a store is sorted from
/// (flow/stores/gaussian_store.h). Rows of a scene's file, texels of a textured mesh. Const members
/// are thread-safe.
class GaussianSource {
 public:
  virtual ~GaussianSource() = default;

  virtual std::uint64_t count() const = 0;
  /// Coefficients of harmonics per Gaussian and channel, one of kLobesOfDegree.
  virtual std::uint32_t lobes() const = 0;
  /// Appends those of Gaussians [first, first + count) that can be used, in order, and counts the
  /// others by reason; what has no colour at all is left out uncounted. `out.lobes` is lobes().
  /// Needs read_bytes() beside what it appends.
  virtual void read(std::uint64_t first, std::uint64_t count, store::SplatRows& out,
                    store::SplatCounts& filtered) const = 0;
  virtual std::uint64_t read_bytes() const = 0;
  /// Usable Gaussians from everywhere, at most kSampleSplats: where they are and how large. Needs
  /// read_bytes(), too.
  static constexpr std::uint64_t kSampleSplats = 1 << 16;
  virtual PageVector<store::Splat> sample() const = 0;
};

}  // namespace pounce::gaussian
