// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/file.h"

namespace pounce::io {

/// A string of so many bytes costs its copies; a shorter one what a value costs, too.
inline constexpr std::uint64_t kLongStringBytes = 1024;

/// What a JSON text holds, found in one pass that keeps nothing of it: what bounds the memory that
/// parsing it needs. Of text that is no JSON, anything.
struct JsonSize {
  std::uint64_t text_bytes = 0;  ///< without data URIs
  /// Of strings of more than kLongStringBytes that no escape could make data URIs: a part of
  /// text_bytes.
  std::uint64_t long_bytes = 0;
  std::uint64_t data_bytes = 0;  ///< of strings that begin with "data:"
  int depth = 0;                 ///< how deep brackets nest outside of strings
  /// Objects in the root's "nodes", "accessors" and the like; in "meshes" those within them, too.
  std::uint64_t entries = 0;
  std::uint64_t extension_values = 0;  ///< values inside of "extensions", at least
  std::uint64_t materials = 0;         ///< objects of the root's "materials"
};

/// Looks at `size` bytes of a file from `offset`.
JsonSize json_size(const ReadFile& file, std::uint64_t offset, std::uint64_t size);

}  // namespace pounce::io
