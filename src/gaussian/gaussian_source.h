// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "core/page_pool.h"
#include "gaussian/splat_keep.h"
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

// --- rows that are kept --------------------------------------------------------------------------

/// What so many rows take as they are read.
inline std::uint64_t rows_bytes(std::uint64_t count, std::uint32_t lobes) {
  return round_to_pages(count * sizeof(store::Splat)) +
         round_to_pages(count * store::lobe_bytes(lobes));
}

/// Leaves the rows of which wanted(splat) is true, in their order.
template <class Wanted>
void leave_rows(store::SplatRows& rows, const Wanted& wanted) {
  const std::size_t halves = std::size_t{3} * rows.lobes;
  std::size_t next = 0;
  for (std::size_t i = 0; i < rows.splats.size(); ++i) {
    if (!wanted(rows.splats[i])) continue;
    rows.splats[next] = rows.splats[i];
    std::copy_n(rows.sh.begin() + static_cast<std::ptrdiff_t>(i * halves), halves,
                rows.sh.begin() + static_cast<std::ptrdiff_t>(next * halves));
    ++next;
  }
  rows.splats.resize(next);
  rows.sh.resize(next * halves);
}

/// Those of Gaussians [first, first + count) that can be used and are wanted; the others are
/// counted by reason. Needs rows_bytes() and the source's read_bytes().
inline store::SplatRows read_kept(const GaussianSource& source, const SplatKeep& keep,
                                  std::uint64_t first, std::uint64_t count,
                                  store::SplatCounts& filtered) {
  store::SplatRows rows{source.lobes(), {}, {}};
  rows.splats.reserve(count);
  rows.sh.reserve(count * 3 * rows.lobes);
  source.read(first, count, rows, filtered);
  leave_rows(rows, [&](const store::Splat& splat) {
    const auto reason = keep.filter(splat);
    if (reason) ++filtered[static_cast<std::size_t>(*reason)];
    return !reason;
  });
  return rows;
}

/// What kept_sample() of so many Gaussians takes while they are read, and then with the means and
/// sizes that a lattice is made from.
inline std::uint64_t kept_sample_bytes(std::uint64_t count, std::uint64_t read_bytes) {
  const std::uint64_t most = std::min(count, GaussianSource::kSampleSplats);
  return round_to_pages(most * sizeof(store::Splat)) +
         std::max(read_bytes, 4 * round_to_pages(most * sizeof(float)));
}

/// What is wanted of a source's sample; all of it where that is too little to say where the source
/// is.
inline PageVector<store::Splat> kept_sample(const GaussianSource& source, const SplatKeep& keep) {
  constexpr std::size_t kLeastSample = 64;
  PageVector<store::Splat> sample = source.sample();
  const auto is_unwanted = [&](const store::Splat& s) { return keep.filter(s).has_value(); };
  const auto unwanted =
      static_cast<std::size_t>(std::count_if(sample.begin(), sample.end(), is_unwanted));
  if (sample.size() - unwanted >= kLeastSample) std::erase_if(sample, is_unwanted);
  return sample;
}

}  // namespace pounce::gaussian
