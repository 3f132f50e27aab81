// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "io/splats/batch.h"
#include "io/splats/ply_header.h"

namespace pounce::io {

/// SuperSplat's compressed PLY: 16 bytes per Gaussian, quantised between the bounds of its chunk of
/// 256, and a byte per coefficient of the harmonics.
class CompressedPly : public BatchScene {
 public:
  /// Reads and checks the header. Throws as read_compressed_ply_header(), Error(storage).
  CompressedPly(const std::string& path, const Axes& axes);
  void decode(std::uint64_t first, std::uint64_t count, std::uint32_t lobes, SplatBatch& batch,
              const Take& take) const override;
  std::uint64_t decode_bytes() const override;

 private:
  std::unique_ptr<ReadFile> file_;
  CompressedPlyHeader header_;
};

}  // namespace pounce::io
