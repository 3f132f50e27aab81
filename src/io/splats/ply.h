// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>

#include "core/axes.h"
#include "core/file.h"
#include "core/page_pool.h"
#include "io/splats/ply_header.h"
#include "store/blocks/splat_store.h"

namespace pounce::io {

/// Reads the Gaussians of a 3DGS PLY, rows in any order. Const members are thread-safe.
class SplatPly {
 public:
  /// Reads and checks the header. Throws as read_splat_ply_header(), and Error(storage) where the
  /// file cannot be opened.
  explicit SplatPly(const std::string& path, const Axes& axes = {});

  const SplatPlyHeader& header() const { return header_; }
  const ReadFile& file() const { return *file_; }

  /// Appends the Gaussians of `rows` rows from `first_row` that can be used, in order, and counts
  /// the others by reason (all but SplatFilter::far, which needs to know the whole scene). Sigma =
  /// exp(scale_i), alpha = 1 / (1 + exp(-opacity)), colour = 0.5 + C0 f_dc; spherical harmonics of
  /// higher degrees are not read. Throws Error(storage) if the file cannot be read any more.
  /// Needs read_bytes() beside what it appends.
  void read(std::uint64_t first_row, std::uint64_t rows, PageVector<store::Splat>& out,
            store::SplatCounts& filtered) const;
  /// The usable Gaussians of up to kSampleSplats rows, taken evenly from the whole file.
  static constexpr std::uint64_t kSampleSplats = 1 << 16;
  PageVector<store::Splat> sample() const;
  /// What a call of read() takes for itself.
  std::uint64_t read_bytes() const;

 private:
  struct Batch;
  std::uint64_t batch_rows() const;

  std::unique_ptr<ReadFile> file_;
  SplatPlyHeader header_;
  Axes axes_;
  std::array<PlyColumn, 17> columns_;
  bool has_scale_2_ = false, has_normals_ = false;
};

}  // namespace pounce::io
