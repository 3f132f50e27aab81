// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "io/splats/batch.h"

namespace pounce::io {

/// A .splat: records of 32 bytes and nothing else; 8 bits for colour, opacity and rotation.
class DotSplat : public BatchScene {
 public:
  /// Throws Error(input) unless the file is a whole number of records, Error(storage).
  DotSplat(const std::string& path, const Axes& axes);
  void decode(std::uint64_t first, std::uint64_t count, std::uint32_t lobes, SplatBatch& batch,
              const Take& take) const override;
  std::uint64_t decode_bytes() const override;

 private:
  std::unique_ptr<ReadFile> file_;
};

}  // namespace pounce::io
