// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/file.h"
#include "store/blocks/splat_store.h"

namespace pounce::io {

/// The scalar types of PLY. It has none for half floats: where a splat column is u16, its values
/// are the bits of IEEE binary16.
enum class PlyType : std::uint8_t { i8, u8, i16, u16, i32, u32, f32, f64 };
std::uint32_t ply_type_bytes(PlyType type);

struct PlyColumn {
  std::string name;
  PlyType type = PlyType::f32;
  std::uint32_t offset = 0;  ///< in a row
};

/// What the header of a splat PLY says, checked against the size of the file.
struct SplatPlyHeader {
  std::uint64_t splats = 0;   ///< rows
  std::uint64_t rows_at = 0;  ///< where the first row begins
  std::uint32_t row_bytes = 0;
  std::vector<PlyColumn> columns;  ///< in the file's order, all of them
  std::uint32_t sh_degree = 0;     ///< 0..4, by the number of f_rest columns
  store::SplatModel model = store::SplatModel::standard;

  /// Null where there is no such column.
  const PlyColumn* find(const std::string& name) const;
};

/// Is a column of that name part of a Gaussian? Any other means what its writer likes.
bool is_splat_column(std::string_view name);

/// True if the file begins as a PLY does.
bool is_ply(const ReadFile& file);

/// Does this PLY hold Gaussians, in whatever form? Else it is a mesh, a point cloud, or damaged.
bool holds_splats(const ReadFile& file, const std::string& path);

/// Reads the header of the 3DGS PLY that trainers write: binary little endian, columns in any
/// order, splat columns of any scalar type but i16, other elements beside the Gaussians. Throws
/// Error(input) naming the file, what it holds instead (a mesh, a point cloud, text or big-endian
/// data, fewer bytes than announced) and the cure. Takes no more than 1 MiB whatever the
/// file says.
SplatPlyHeader read_splat_ply_header(const ReadFile& file, const std::string& path);

/// Bounds of a chunk of a compressed PLY: of positions, of logarithms of sigma, of colours; the
/// three lower ends of each, then the three upper ones.
inline constexpr std::size_t kCompressedBounds = 18;

/// What the header of a SuperSplat compressed PLY says, checked against the size of the file.
struct CompressedPlyHeader {
  std::uint64_t splats = 0;
  std::uint64_t chunks_at = 0, rows_at = 0, harmonics_at = 0;
  std::uint32_t chunk_bytes = 0, row_bytes = 0;
  /// Where the bounds are in a chunk; of colours nothing in older files (they are 0 and 1).
  std::array<std::optional<std::uint32_t>, kCompressedBounds> bounds;
  std::array<std::uint32_t, 4> packed{};  ///< position, rotation, scale, colour in a row
  std::uint32_t harmonics = 0;            ///< bytes per Gaussian: 0, 9, 24 or 45
  std::uint32_t sh_degree = 0;
  store::SplatModel model = store::SplatModel::standard;
};

/// Is it a PLY with an element "vertex" that has packed positions?
bool is_compressed_ply(const ReadFile& file, const std::string& path);

/// Throws Error(input) naming file, what is missing or wrong, and the cure.
CompressedPlyHeader read_compressed_ply_header(const ReadFile& file, const std::string& path);

}  // namespace pounce::io
