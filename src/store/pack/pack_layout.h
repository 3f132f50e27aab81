// SPDX-License-Identifier: Apache-2.0
//
// The bytes of a pack file, shared by its writer and its reader, and the fields that index pages
// and directories of every kind of pack have. docs/tile-format.md is the specification; stores are
// little endian, as is every machine that they are written on (core/bytes.h asserts it).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "core/bounds.h"
#include "core/bytes.h"
#include "core/hash.h"
#include "store/pack/pack.h"

namespace pounce::store {

inline constexpr std::array<char, 8> kPackMagic = {'P', 'O', 'U', 'N', 'C', 'E', 'P', 'K'};
inline constexpr std::array<char, 8> kFooterMagic = {'P', 'O', 'U', 'N', 'C', 'E', 'F', 'T'};
inline constexpr std::uint32_t kChunkMagic = 0x4b4e4843;  // "CHNK" as bytes in the file
inline constexpr std::size_t kChunkAlignment = 8;
/// Header and footer end with the XXH3-64 of the bytes before it.
inline constexpr std::size_t kEndChecksumOffset = 56;
/// Where a chunk header holds its checksum. While it is computed, the chunk's own offset stands
/// there: the same bytes at another place do not match.
inline constexpr std::size_t kChunkChecksumOffset = 16;

inline void put_u32(std::byte* to, std::uint32_t value) { std::memcpy(to, &value, sizeof value); }
inline void put_u64(std::byte* to, std::uint64_t value) { std::memcpy(to, &value, sizeof value); }
inline std::uint32_t get_u32(const std::byte* from) {
  std::uint32_t value;
  std::memcpy(&value, from, sizeof value);
  return value;
}
inline std::uint64_t get_u64(const std::byte* from) {
  std::uint64_t value;
  std::memcpy(&value, from, sizeof value);
  return value;
}

/// Bytes a chunk takes in the file: header, payload, zeros up to the next multiple of 8.
constexpr std::uint64_t chunk_file_bytes(std::uint32_t stored_bytes) {
  const std::uint64_t payload = stored_bytes;
  return kChunkHeaderBytes + (payload + kChunkAlignment - 1) / kChunkAlignment * kChunkAlignment;
}

/// The checksum of a whole chunk (header, payload, padding) that lies at `offset`. Puts the offset
/// into the checksum's place for that; the caller puts back what belongs there.
inline std::uint64_t chunk_checksum(std::span<std::byte> chunk, std::uint64_t offset) {
  put_u64(chunk.data() + kChunkChecksumOffset, offset);
  return checksum(chunk);
}

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
    in.fail("refers to an impossible chunk");
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
  if (box.empty() && box != Box3f()) in.fail("has an invalid box");
  return box;
}

}  // namespace pounce::store
