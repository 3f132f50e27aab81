// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "pounce/error.h"
#include "store/pack/codec.h"
#include "store/pack/pack.h"

namespace pounce::store {

/// Compresses `raw` and appends it as a chunk.
inline ChunkRef append_payload(PackWriter& pack, ChunkKind kind, std::span<const std::byte> raw,
                               Compressor& compressor) {
  std::vector<std::byte> stored;
  compressor.compress(raw, stored);
  return pack.append(kind, stored, static_cast<std::uint32_t>(raw.size()));
}

/// Reads a chunk, checks it and decompresses it. Throws Error(damaged_store), as
/// PackReader::read(), and for one that is larger than `most_bytes`: a small file may claim any
/// size, so nothing is allocated before.
inline std::vector<std::byte> read_payload(const PackReader& pack, const ChunkRef& chunk,
                                           ChunkKind kind, std::uint64_t most_bytes,
                                           Compressor& compressor) {
  if (chunk.raw_bytes > most_bytes)
    throw Error(ErrorKind::damaged_store, pack.name() + ": a chunk is larger than it can be");
  std::vector<std::byte> stored;
  pack.read(chunk, kind, stored);
  std::vector<std::byte> raw(chunk.raw_bytes);
  compressor.decompress(stored, raw);
  return raw;
}

}  // namespace pounce::store
