// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "io/splats/write.h"

namespace pounce::io {

/// A 3DGS PLY: binary little endian, the column order of its first trainer.
class SplatPlyWriter : public SplatWriter {
 public:
  SplatPlyWriter(const std::string& path, const SplatFileFacts& facts);
  void commit(const std::function<void()>& poll) override;

 private:
  void encode_columns(const store::SplatRows& rows, std::span<std::byte* const> columns,
                      SplatTally& tally) const override;
  void put_header();
};

}  // namespace pounce::io
