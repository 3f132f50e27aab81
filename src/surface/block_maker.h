// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "mesh/block_bins.h"
#include "store/blocks/geometry_store.h"
#include "store/pack/codec.h"
#include "surface/geometry_request.h"

namespace pounce::surface {

struct EncodedBlock {
  store::BlockEntry entry;
  std::vector<std::byte> stored;
  std::uint32_t raw_bytes = 0;
};

/// One tile, ready to be written, and what it adds to the directory.
struct EncodedTile {
  std::vector<EncodedBlock> blocks;
  std::uint64_t texels = 0, overlapping = 0, slivers = 0, degenerate = 0;
  std::uint32_t page = 0;
};

/// Makes the blocks of one tile and compresses them, or leaves them as they are while there is
/// `room`. `poll` is called for each of them and may throw. Thread-safe: all depends on the
/// arguments alone.
EncodedTile make_tile(const GeometryRequest& request, const mesh::BlockBins& bins,
                      const mesh::TileRange& tile, store::Compressor& compressor,
                      store::PlainRoom* room, const std::function<void()>& poll);

}  // namespace pounce::surface
