// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "io/splats/write.h"

namespace pounce::io {

/// An SPZ of version 2, in gzip without a time: 24 bits per coordinate with as many of them behind
/// the point as the scene's extent leaves (20 at most), a byte for everything else.
class SpzWriter : public SplatWriter {
 public:
  SpzWriter(const std::string& path, const SplatFileFacts& facts, const ScratchFolder& folder);
  void commit(const std::function<void()>& poll) override;

 private:
  void encode_columns(const store::SplatRows& rows, std::span<std::byte* const> columns,
                      SplatTally& tally) const override;
  int fraction_bits() const;
  void check_places(int bits);
  void check_sizes();
  std::array<std::byte, 16> header(int bits) const;
};

}  // namespace pounce::io
