// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "io/codec/row_encoder.h"
#include "job/step_pack.h"

namespace pounce::job {

/// Blocks of rows that an earlier run has encoded, by image and number.
struct KeptBlock {
  store::ChunkRef chunk;
  Hash128 rows;
};
using KeptBlocks = std::map<std::pair<std::uint32_t, std::uint32_t>, KeptBlock>;
/// Memory of one, with what the map and the allocator add.
inline constexpr std::uint64_t kKeptBlockBytes = 128;

/// Encoded rows of one image in the pack of its step. `pack` and `blocks` must outlive it.
class KeptEncodings final : public io::EncodedBlocks {
 public:
  KeptEncodings(StepPack& pack, const KeptBlocks& blocks, std::uint32_t image)
      : pack_(pack), reader_(pack.reader()), blocks_(blocks), image_(image) {}

  /// Memory that these take for blocks of at most so many bytes, encoded: copies of one, as a
  /// chunk and as what is written of it.
  static std::uint64_t memory_bytes(std::uint64_t block_bytes) {
    return block_bytes == 0 ? 0 : 2 * (block_bytes + (4 << 10));
  }

  bool find(std::uint32_t block, const Hash128& rows, std::vector<std::byte>& encoded) override;
  void put(std::uint32_t block, const Hash128& rows, std::span<const std::byte> encoded) override;

 private:
  StepPack& pack_;
  const std::unique_ptr<store::PackReader> reader_;
  const KeptBlocks& blocks_;
  const std::uint32_t image_;
  bool is_full_ = false;
  std::vector<std::byte> chunk_;
};

}  // namespace pounce::job
