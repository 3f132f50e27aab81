// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

#include "core/job_space.h"
#include "io/splats/scene.h"
#include "io/splats/sh_rotation.h"
#include "store/blocks/splat_block.h"
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

/// A scene whose format gives batches: what is left to a format is where its values are.
class BatchScene : public SplatScene {
 public:
  void prepare(const ScratchFolder&, const std::function<void()>&) override {}
  std::uint64_t prepare_bytes() const override { return 0; }
  std::uint64_t unpacked_bytes() const override { return 0; }
  void read(std::uint64_t first, std::uint64_t count, store::SplatRows& out,
            store::SplatCounts& filtered) const final;
  std::uint64_t read_bytes() const final;

  /// Fills `batch` with the next rows of [first, first + count) and calls take(rows), again and
  /// again. Of the harmonics, `lobes` per channel are asked for; columns beyond the file's degree
  /// are left alone. Throws Error(input), Error(storage).
  using Take = std::function<void(std::size_t rows)>;
  virtual void decode(std::uint64_t first, std::uint64_t count, std::uint32_t lobes,
                      SplatBatch& batch, const Take& take) const = 0;
  /// What decode() takes beside the batch.
  virtual std::uint64_t decode_bytes() const = 0;

 protected:
  explicit BatchScene(const Axes& axes) : intake_(axes) {}
  /// The file itself says how its axes lie: `axes` are those of the constructor after that.
  void set_axes(const Axes& axes) { intake_ = SplatIntake(axes); }

 private:
  SplatIntake intake_;
};

/// Rows that a format reads at once; small enough for a stack of buffers.
inline constexpr std::uint64_t kPieceRows = 4096;

/// Calls f(begin, rows) for [0, count) in steps of a batch.
template <class F>
void for_batches(std::uint64_t count, const F& f) {
  for (std::uint64_t begin = 0; begin < count; begin += SplatBatch::kRows)
    f(begin, static_cast<std::size_t>(std::min<std::uint64_t>(SplatBatch::kRows, count - begin)));
}

}  // namespace pounce::io
