// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "projection/splat_packet.h"
#include "store/blocks/splat_block.h"

namespace pounce::flow {

/// What one block of Gaussians costs a batch: itself prepared, and its share of the candidates.
inline std::uint64_t splat_batch_cost(std::uint64_t splats) {
  return source::SplatSet::most_bytes(splats) + splats * projection::SplatCandidates::kBytes;
}

/// What reading a block takes until it is prepared.
inline std::uint64_t splat_reading_bytes(std::uint64_t splats, std::uint64_t chunk_bytes) {
  return store::SplatBlock::decoded_bytes(splats, true) + 3 * chunk_bytes;
}

}  // namespace pounce::flow
