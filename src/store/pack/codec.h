// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "pounce/error.h"
#include "store/pack/pack.h"

namespace pounce::store {

/// zstd level of every store: level 3 is 2-3x slower for 2-4 % (docs/tile-format.md).
inline constexpr int kZstdLevel = 1;
/// zstd level of what is read once and soon: faster, a little larger.
inline constexpr int kFastLevel = -3;

/// How many bytes of scratch a job may still store as they are, all threads together.
using PlainRoom = std::atomic<std::uint64_t>;

/// A reusable compressor with its scratch memory. One per thread; not thread-safe.
class Compressor {
 public:
  Compressor();
  ~Compressor();
  Compressor(Compressor&&) noexcept;
  /// Replaces `stored` by a zstd frame of `raw`. Where there is `room` for it, which is taken, it
  /// is one of blocks that are not compressed. Never larger than ZSTD_compressBound says.
  void compress(std::span<const std::byte> raw, std::vector<std::byte>& stored,
                int level = kZstdLevel, PlainRoom* room = nullptr);
  /// Where there is `room` for `raw`, which is taken, replaces `stored` by a frame of bytes as they
  /// are, for which is_as_is() is true; else returns false.
  static bool keep_as_is(std::span<const std::byte> raw, std::vector<std::byte>& stored,
                         PlainRoom* room);
  /// Fills `raw` exactly; throws Error(damaged_store) if the frame is malformed or of another size.
  /// raw.size() must have been checked by the caller against what it is willing to allocate.
  void decompress(std::span<const std::byte> stored, std::span<std::byte> raw);
  /// Memory both contexts hold, for the budget.
  static std::uint64_t context_bytes();

 private:
  struct Contexts;
  std::unique_ptr<Contexts> contexts_;
};

/// Was the frame made by Compressor::keep_as_is()? What it holds has passed no filter.
bool is_as_is(std::span<const std::byte> frame);

/// About what compression leaves of filtered bytes: their entropy, 1024 by 1024. Integers alone, so
/// that a choice between two encodings is the same with every version of zstd.
std::uint64_t estimated_bytes(std::span<const std::byte> raw);

/// Transposes `count` elements of `element_bytes` into `element_bytes` planes (byte shuffle), and
/// back.
void shuffle(std::span<const std::byte> elements, std::size_t element_bytes,
             std::span<std::byte> planes);
void unshuffle(std::span<const std::byte> planes, std::size_t element_bytes,
               std::span<std::byte> elements);

/// Element-wise difference to the element `stride` before it, modulo 2^bits, in place, and its
/// inverse. Elements are little-endian unsigned of element_bytes (1, 2 or 4); the first `stride`
/// stay as they are.
void delta(std::span<std::byte> elements, std::size_t element_bytes, std::size_t stride);
void undelta(std::span<std::byte> elements, std::size_t element_bytes, std::size_t stride);

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
inline UnsetBytes read_payload(const PackReader& pack, const ChunkRef& chunk, ChunkKind kind,
                               std::uint64_t most_bytes, Compressor& compressor) {
  if (chunk.raw_bytes > most_bytes)
    throw Error(ErrorKind::damaged_store, pack.name() + ": a chunk is larger than it can be");
  const StoredChunk stored = pack.read(chunk, kind);
  UnsetBytes raw(chunk.raw_bytes);
  compressor.decompress(stored.payload(), raw);
  return raw;
}

}  // namespace pounce::store
