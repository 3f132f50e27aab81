// SPDX-License-Identifier: Apache-2.0
//
// Fields that index pages and directories of every kind of pack share.
#pragma once

#include "core/box.h"
#include "core/bytes.h"
#include "store/pack/pack_layout.h"

namespace pounce::store {

inline void put_chunk(ByteWriter& out, const ChunkRef& chunk) {
  out.put(chunk.offset);
  out.put(chunk.stored_bytes);
  out.put(chunk.raw_bytes);
}

/// A chunk's place is also its name in memory (runtime/block_cache.h), so it is checked
/// here, long before anything is read from it.
inline ChunkRef get_chunk(ByteReader& in) {
  ChunkRef chunk;
  chunk.offset = in.get<std::uint64_t>();
  chunk.stored_bytes = in.get<std::uint32_t>();
  chunk.raw_bytes = in.get<std::uint32_t>();
  if (chunk.offset < kPackHeaderBytes || chunk.offset % kChunkAlignment != 0 ||
      chunk.stored_bytes > kLargestChunkBytes || chunk.raw_bytes > kLargestChunkBytes) {
    in.fail("names a chunk that cannot be");
  }
  return chunk;
}

inline void put_box(ByteWriter& out, const Box3f& box) {
  for (const float v : {box.lo.x, box.lo.y, box.lo.z, box.hi.x, box.hi.y, box.hi.z}) out.put(v);
}

/// A box, or the empty one; never one with NaN in it.
inline Box3f get_box(ByteReader& in) {
  Box3f box;
  for (float* v : {&box.lo.x, &box.lo.y, &box.lo.z, &box.hi.x, &box.hi.y, &box.hi.z})
    *v = in.get<float>();
  if (box.empty() && box != Box3f()) in.fail("has a box that is none");
  return box;
}

}  // namespace pounce::store
