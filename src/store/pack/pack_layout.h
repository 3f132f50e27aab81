// SPDX-License-Identifier: Apache-2.0
//
// The bytes of a pack file, shared by its writer and its reader. docs/tile-format.md is the
// specification.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

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

inline void put_u32(std::byte* to, std::uint32_t value) {
  for (unsigned i = 0; i < 4; ++i) to[i] = static_cast<std::byte>(value >> (8 * i));
}
inline void put_u64(std::byte* to, std::uint64_t value) {
  for (unsigned i = 0; i < 8; ++i) to[i] = static_cast<std::byte>(value >> (8 * i));
}
inline std::uint32_t get_u32(const std::byte* from) {
  std::uint32_t value = 0;
  for (unsigned i = 0; i < 4; ++i) value |= std::to_integer<std::uint32_t>(from[i]) << (8 * i);
  return value;
}
inline std::uint64_t get_u64(const std::byte* from) {
  std::uint64_t value = 0;
  for (unsigned i = 0; i < 8; ++i) value |= std::to_integer<std::uint64_t>(from[i]) << (8 * i);
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

}  // namespace pounce::store
