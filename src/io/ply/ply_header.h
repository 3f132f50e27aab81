// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <initializer_list>
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

/// A column that is a list: its length, then so many items.
struct PlyList {
  std::string name;
  PlyType length = PlyType::u8, item = PlyType::f32;
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;      ///< rows, as announced
  std::uint64_t row_bytes = 0;  ///< without lists
  bool has_list = false;
  std::vector<PlyColumn> columns;  ///< in the file's order
  std::vector<PlyList> lists;      ///< those of the columns without names, in their order
};

/// A header as it stands: nothing is said yet about what the file holds.
struct PlyHeader {
  std::string format;  ///< "ascii", "binary_little_endian", ...
  std::vector<PlyElement> elements;
  std::vector<std::string> textures;  ///< "comment TextureFile NAME", as programs write it
  std::uint64_t bytes = 0;            ///< up to the first row
  std::uint64_t lines = 0;
  /// How a comment says that the Gaussians were trained.
  store::SplatModel model = store::SplatModel::standard;

  /// Null where there is no such element.
  const PlyElement* find(std::string_view name) const;
};

/// The first list of one of these names, or null.
const PlyList* find_list(const PlyElement& element, std::initializer_list<std::string_view> names);
/// The list of an element "face" that names its vertices, or null.
const PlyList* ply_corners(const PlyElement& face);

/// True if the file begins as a PLY does.
bool is_ply(const ReadFile& file);

/// Does a PLY hold a mesh: faces that are lists of vertices? Where its vertices are Gaussians, it
/// is a splat scene all the same. False for a damaged header.
bool is_ply_mesh(const ReadFile& file, const std::string& path);

/// Throws Error(input) naming file, line and cure. Takes no more than 1 MiB whatever the file says.
PlyHeader read_ply_header(const ReadFile& file, const std::string& path);

/// Where the rows of an element begin, once the file is known to have as many bytes as all elements
/// up to and after it announce. Throws Error(input).
std::uint64_t ply_rows_at(const PlyHeader& header, std::uint64_t file_bytes,
                          const std::string& path, std::string_view element = "vertex");

/// For messages: foreign bytes, made short and printable.
std::string shown(std::string_view text);

}  // namespace pounce::io
