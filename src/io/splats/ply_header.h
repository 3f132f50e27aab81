// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/file.h"
#include "store/blocks/splat_store.h"

namespace pounce::io {

/// The scalar types of PLY. It has none for half floats: where a splat column is u16, its values
/// are the bits of IEEE binary16.
enum class PlyType : std::uint8_t { i8, u8, i16, u16, i32, u32, f32, f64 };

struct PlyColumn {
  std::string name;  ///< empty: a list, which has no place
  PlyType type = PlyType::f32;
  std::uint32_t offset = 0;  ///< in a row
};

/// Null where there is no such column.
const PlyColumn* find_column(const std::vector<PlyColumn>& columns, std::string_view name);

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;      ///< rows, as announced
  std::uint64_t row_bytes = 0;  ///< without lists
  bool has_list = false;
  std::vector<PlyColumn> columns;  ///< in the file's order
};

/// A header as it stands: nothing is said yet about what the file holds.
struct PlyHeader {
  std::string format;  ///< "ascii", "binary_little_endian", ...
  std::vector<PlyElement> elements;
  std::uint64_t bytes = 0;  ///< up to the first row
  /// How a comment says that the Gaussians were trained.
  store::SplatModel model = store::SplatModel::standard;

  /// Null where there is no such element.
  const PlyElement* find(std::string_view name) const;
};

/// True if the file begins as a PLY does.
bool is_ply(const ReadFile& file);

/// Throws Error(input) naming file, line and cure. Takes no more than 1 MiB whatever the file says.
PlyHeader read_ply_header(const ReadFile& file, const std::string& path);

/// Where the rows of an element begin, once the file is known to have as many bytes as all elements
/// up to and after it announce. Throws Error(input).
std::uint64_t ply_rows_at(const PlyHeader& header, std::uint64_t file_bytes,
                          const std::string& path, std::string_view element = "vertex");

/// For messages: foreign bytes, made short and printable.
std::string shown(std::string_view text);

}  // namespace pounce::io
