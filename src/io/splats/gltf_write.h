// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "io/splats/write.h"

namespace pounce::io {

/// A .glb of one primitive of KHR_gaussian_splatting: floats, a buffer view for each accessor.
class GltfSplatWriter : public SplatWriter {
 public:
  GltfSplatWriter(const std::string& path, const SplatFileFacts& facts,
                  const ScratchFolder& folder);
  void commit(const std::function<void()>& poll) override;

 private:
  void encode_columns(const store::SplatRows& rows, std::span<std::byte* const> columns,
                      SplatTally& tally) const override;
  std::string document() const;
};

}  // namespace pounce::io
