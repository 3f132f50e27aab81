// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/file.h"

namespace pounce::io {

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
/// than 4096 entries or a directory of more than 1 MiB; Error(storage). takes no more than 4 MiB.
std::vector<StoredEntry> read_stored_zip(const ReadFile& file, const std::string& path);

}  // namespace pounce::io
