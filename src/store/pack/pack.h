// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/bytes.h"
#include "core/file.h"
#include "core/hash.h"
#include "pounce/error.h"

namespace pounce::store {

/// What a pack file holds; part of its header.
enum class PackKind : std::uint32_t { geometry = 1, colour = 2, results = 3, splats = 4, hits = 5 };

/// What a chunk of a pack holds; part of its header.
enum class ChunkKind : std::uint32_t {
  block = 1,
  index_page = 2,
  directory = 3,
  record = 4,
  encoded = 5
};

/// Where a chunk is and how large: enough to size every buffer before reading.
struct ChunkRef {
  std::uint64_t offset = 0;        ///< of its header
  std::uint32_t stored_bytes = 0;  ///< compressed payload, without header
  std::uint32_t raw_bytes = 0;     ///< after decompression
  bool operator==(const ChunkRef&) const = default;
};

inline constexpr std::uint32_t kFormatVersion = 3;
inline constexpr std::size_t kPackHeaderBytes = 64;
inline constexpr std::size_t kChunkHeaderBytes = 32;
inline constexpr std::size_t kPackFooterBytes = 64;
/// No chunk is larger, raw or stored: sizes are bounded before anything is allocated.
inline constexpr std::uint32_t kLargestChunkBytes = 64u << 20;

/// What the header of a pack says.
struct PackInfo {
  std::uint32_t version = 0;
  PackKind kind = PackKind::geometry;
  Hash128 key;
};
/// Reads and checks the header alone, for programs that do not know what to expect (`pounce
/// inspect`). Throws Error(damaged_store).
PackInfo read_pack_info(const ReadFile& file, const std::string& name);

/// How much of an unfinished pack is sound: so far it may be gone on with.
struct PackScan {
  std::uint64_t size_bytes = 0;  ///< 0: it is no pack of that kind and key
  std::uint64_t chunks = 0;
  std::optional<Error> unread;  ///< why the system could not read on, if it could not
};
/// Reads a pack that may end anywhere, every byte of it, and hands on its chunks in their order,
/// each with how far the pack is sound behind it. Ends at what is no chunk of this pack, where it
/// cannot be read, and where `take` says false. Returns how far it was sound.
PackScan scan_pack(
    const ReadFile& file, PackKind kind, const Hash128& key,
    const std::function<bool(ChunkKind, const ChunkRef&, std::span<const std::byte> stored,
                             const PackScan& behind)>& take);

/// Append-only pack file: header, chunks, footer. Layout: docs/tile-format.md. Not thread-safe.
/// The header carries kind, version and key; the footer (written by finish()) the directory's
/// place, the number of chunks and the file's size. Every byte is under a checksum.
class PackWriter {
 public:
  PackWriter(std::unique_ptr<WriteFile> file, PackKind kind, const Hash128& key);
  /// Goes on with a pack of which the file has exactly this.
  PackWriter(std::unique_ptr<WriteFile> file, PackKind kind, const Hash128& key,
             const PackScan& so_far);
  /// `stored` is the zstd frame of raw_bytes bytes.
  ChunkRef append(ChunkKind kind, std::span<const std::byte> stored, std::uint32_t raw_bytes);
  /// Writes the footer. `directory` is the chunk a reader starts from.
  void finish(const ChunkRef& directory);
  std::uint64_t size_bytes() const { return size_; }
  WriteFile& file() { return *file_; }
  const WriteFile& file() const { return *file_; }
  PackKind kind() const { return kind_; }
  const Hash128& key() const { return key_; }
  bool finished() const { return finished_; }

 private:
  void write(std::span<const std::byte> bytes);

  const std::unique_ptr<WriteFile> file_;
  const PackKind kind_;
  const Hash128 key_;
  std::uint64_t size_ = 0;  ///< what was appended, whatever the file buffers
  std::uint64_t chunks_ = 0;
  bool finished_ = false;
  std::exception_ptr failure_;    ///< of an append: what the file holds is not known any more
  std::vector<std::byte> chunk_;  ///< one chunk as it goes to the file, reused
};

/// What a chunk stores, as it was read.
class StoredChunk {
 public:
  StoredChunk() = default;
  /// `chunk`: with its header, and padding behind.
  StoredChunk(UnsetBytes chunk, std::span<const std::byte> payload)
      : chunk_(std::move(chunk)), payload_(payload) {}
  std::span<const std::byte> payload() const { return payload_; }

 private:
  UnsetBytes chunk_;
  std::span<const std::byte> payload_;
};

/// Reads a finished pack. read() is thread-safe. A wrong magic, version, kind, key, size or
/// checksum throws Error(damaged_store) that names the file, the offset and what did not match.
class PackReader {
 public:
  PackReader(std::unique_ptr<ReadFile> file, std::string name, PackKind kind, const Hash128& key);
  /// Of a pack that is being written: reads what was appended so far. It has no directory.
  PackReader(const PackWriter& writer, std::string name);
  ChunkRef directory() const { return directory_; }
  /// Reads one chunk and checks its header (kind, sizes, its own offset) and checksum. The payload
  /// has exactly ref.stored_bytes. The header is read with it in one pread.
  StoredChunk read(const ChunkRef& ref, ChunkKind kind) const;
  /// Reads and checks every chunk from the header to the footer; returns how many there are.
  std::uint64_t verify() const;
  std::uint64_t size_bytes() const { return is_growing_ ? file_->size_bytes() : size_; }
  std::uint64_t bytes_read() const { return bytes_read_; }  ///< so far
  const std::string& name() const { return name_; }
  const Hash128& key() const { return key_; }

 private:
  void read_raw(std::uint64_t offset, std::span<std::byte> out) const;
  void read_header(PackKind kind);
  void read_footer();
  void check_ref(const ChunkRef& ref) const;
  [[noreturn]] void damaged(std::uint64_t offset, const std::string& what) const;

  const std::unique_ptr<ReadFile> file_;
  const std::string name_;
  const Hash128 key_;
  const bool is_growing_;
  const std::uint64_t size_;
  ChunkRef directory_;
  std::uint64_t chunks_ = 0;
  mutable std::atomic<std::uint64_t> bytes_read_{0};
};

}  // namespace pounce::store
