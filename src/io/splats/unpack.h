// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/file.h"
#include "core/page_pool.h"

namespace pounce::io {

/// Compressed bytes of a file, decoded from their beginning, in constant memory. Both throw
/// Error(input) beginning with `name` where the bytes are damaged or end too early.

/// One gzip member, from the start of the file.
class GzipReader {
 public:
  GzipReader(const ReadFile& file, const std::string& name);
  ~GzipReader();
  GzipReader(const GzipReader&) = delete;
  GzipReader& operator=(const GzipReader&) = delete;
  /// Fills `out` as far as there is something; fewer bytes only at the end, which is then known to
  /// be as it was written (its checksum was compared).
  std::size_t read(std::span<std::byte> out);
  static constexpr std::uint64_t kBytes = 128 << 10;  ///< what it takes, zlib's window included

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// One Zstandard frame that takes bytes [offset, offset + size) of the file.
class ZstdReader {
 public:
  ZstdReader(const ReadFile& file, std::uint64_t offset, std::uint64_t size,
             const std::string& name);
  ~ZstdReader();
  ZstdReader(const ZstdReader&) = delete;
  ZstdReader& operator=(const ZstdReader&) = delete;
  /// As above.
  std::size_t read(std::span<std::byte> out);
  /// What it takes for the frame that begins here: its window above all, of 128 MiB at most.
  static std::uint64_t bytes(const ReadFile& file, std::uint64_t offset, std::uint64_t size);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// A file in a ZIP archive, stored as it is.
struct StoredEntry {
  std::string name;
  std::uint64_t at = 0;  ///< its first byte, in the archive
  std::uint64_t bytes = 0;
};

/// True if the file begins as a ZIP archive does, be it an empty one.
bool is_zip(const ReadFile& file);

/// The files in a ZIP archive, in the order of its directory; folders are left out. Throws
/// Error(input) naming file, entry and cure where an entry is compressed or encrypted, lies outside
/// the archive or over another, or is named twice, and for ZIP64, archives of several parts, more
/// than 4096 entries or a directory of more than 1 MiB; Error(storage). Takes no more than 4 MiB.
std::vector<StoredEntry> read_stored_zip(const ReadFile& file, const std::string& path);

}  // namespace pounce::io
