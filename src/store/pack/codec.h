// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace pounce::store {

/// zstd level of every store: level 3 is 2-3x slower for 2-4 % (docs/tile-format.md).
inline constexpr int kZstdLevel = 1;
/// zstd level of scratch data that is read once and soon: faster, a little larger.
inline constexpr int kScratchLevel = -3;

/// A reusable compressor with its scratch memory. One per thread; not thread-safe.
class Compressor {
 public:
  Compressor();
  ~Compressor();
  Compressor(Compressor&&) noexcept;
  /// Replaces `stored` by the zstd frame of `raw`.
  void compress(std::span<const std::byte> raw, std::vector<std::byte>& stored,
                int level = kZstdLevel);
  /// Fills `raw` exactly; throws Error(damaged_store) if the frame is malformed or of another size.
  /// raw.size() must have been checked by the caller against what it is willing to allocate.
  void decompress(std::span<const std::byte> stored, std::span<std::byte> raw);
  /// Memory both contexts hold, for the budget.
  static std::uint64_t context_bytes();

 private:
  struct Contexts;
  std::unique_ptr<Contexts> contexts_;
};

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

}  // namespace pounce::store
