// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>

#include "core/axes.h"
#include "io/splats/sh_rotation.h"
#include "store/blocks/splat_rows.h"
#include "store/blocks/splat_store.h"

namespace pounce::io {

/// Gaussians as the decoder of a format leaves them, a column per value: linear, in the file's
/// axes, of any value that the file can hold. About 60 KiB, to be kept on the heap.
struct SplatBatch {
  static constexpr std::size_t kRows = 256;  // 17 columns of them stay in the first-level cache
  using Column = std::array<float, kRows>;

  std::array<Column, 3> mean{}, sigma{}, colour{};
  std::array<Column, 4> rotation{};  ///< w, x, y, z, of any length
  Column alpha{};
  std::array<Column, 3> normal{};                  ///< of any length; zeros = none
  std::array<Column, 3 * store::kMostLobes> sh{};  ///< 3 k + channel, coefficient k from 0
};

/// What most formats store: logarithms of sigma, logits of alpha, the harmonic of degree 0 in place
/// of the colour. In place, for the first `rows`.
void exponential(SplatBatch::Column& column, std::size_t rows);
void logistic(SplatBatch::Column& column, std::size_t rows);
void colour_of_dc(SplatBatch::Column& column, std::size_t rows);

/// Makes Gaussians of batches, or says why there is none: the same rules for every format.
/// Thread-safe.
class SplatIntake {
 public:
  explicit SplatIntake(const Axes& axes);

  /// Appends the Gaussians of the first `rows` rows that can be used, with `out.lobes` coefficients
  /// each, and counts the others by reason. What is read of the batch need not be finite: a
  /// coefficient that is no number is a reason, too.
  void take(const SplatBatch& batch, std::size_t rows, store::SplatRows& out,
            store::SplatCounts& filtered) const;

 private:
  void append_harmonics(const SplatBatch& batch, std::size_t row, store::SplatRows& out) const;

  Axes axes_;
  ShRotation harmonics_;
};

}  // namespace pounce::io
