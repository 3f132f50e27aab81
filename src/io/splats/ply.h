// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "io/splats/batch.h"
#include "io/splats/ply_header.h"

namespace pounce::io {

/// A 3DGS PLY as trainers write it. Sigma = exp(scale_i), alpha = 1 / (1 + exp(-opacity)), colour =
/// 0.5 + C0 f_dc; of f_rest, which is channel by channel in the file, degrees 1 to 3.
class SplatPly : public BatchScene {
 public:
  /// Reads and checks the header. Throws as read_splat_ply_header(), and Error(storage) where the
  /// file cannot be opened.
  explicit SplatPly(const std::string& path, const Axes& axes = {});

  const SplatPlyHeader& header() const { return header_; }

  void decode(std::uint64_t first, std::uint64_t count, std::uint32_t lobes, SplatBatch& batch,
              const Take& take) const override;
  std::uint64_t decode_bytes() const override;

 private:
  std::uint64_t piece_rows() const;
  void find_columns(const std::string& path);

  std::unique_ptr<ReadFile> file_;
  SplatPlyHeader header_;
  std::array<PlyColumn, 17> columns_;  ///< of what a Gaussian has; without a name: not in the file
  std::vector<PlyColumn> harmonics_;   ///< as SplatBatch::sh
};

}  // namespace pounce::io
