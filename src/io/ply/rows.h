// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/file.h"
#include "io/files/number_stream.h"
#include "io/ply/ply_header.h"

namespace pounce::io {

/// What a column of a vertex means.
enum class PlyValue : std::uint8_t { x, y, z, nx, ny, nz, u, v, red, green, blue, alpha };
inline constexpr std::size_t kPlyValues = 12;
/// Which value of a vertex a column of that name is; nothing where it is none.
std::optional<PlyValue> ply_value(std::string_view column);

/// By PlyValue; 0 where the file has no such column.
using PlyVertex = std::array<double, kPlyValues>;

struct PlyFace {
  std::vector<std::uint32_t> corners;
  std::vector<float> texcoords;  ///< two for each corner; empty: the face has none
  std::int64_t texture = 0;      ///< which of the header's textures; negative: none
};

/// A face with so many corners is three numbers long at least, whatever it claims.
struct PlyCounts {
  std::uint64_t vertices = 0, faces = 0, corners = 0, triangles = 0, most_corners = 0;
};

/// Of points, which have no faces, one without a place is no damage: grids of scanners have those.
enum class PlyContent : std::uint8_t { mesh, points };

/// The vertices and faces of a PLY, row by row, as text or as binary of either byte order.
class PlyRows {
 public:
  /// Reads and checks the header: nothing it announces is larger than the file. Throws
  /// Error(input).
  explicit PlyRows(const std::string& path, PlyContent content = PlyContent::mesh);

  const PlyHeader& header() const { return header_; }
  bool has(PlyValue value) const { return columns_[static_cast<std::size_t>(value)] >= 0; }
  PlyType type(PlyValue value) const;
  /// Its column in the element "vertex", which has(value).
  std::size_t column(PlyValue value) const {
    return static_cast<std::size_t>(columns_[static_cast<std::size_t>(value)]);
  }
  bool has_face_texcoords() const { return has_texcoords_; }

  /// Passes over the whole file. Throws Error(input) where it is damaged.
  PlyCounts count() const;
  void read(const std::function<void(const PlyVertex&)>& on_vertex,
            const std::function<void(const PlyFace&)>& on_face) const;

 private:
  struct Column {
    bool is_list = false;
    PlyType type = PlyType::f32, length = PlyType::u8;
    int value = -1;  ///< of a vertex: PlyValue; of a face: FaceValue
  };
  class Reader;

  void find_vertex_columns(const PlyElement& vertex);
  void find_face_columns(const PlyElement& face);
  void check_sizes(std::uint64_t file_bytes) const;

  std::string path_;
  PlyContent content_;
  PlyHeader header_;
  std::vector<Column> vertex_, face_;    ///< in the file's order
  std::array<int, kPlyValues> columns_;  ///< by PlyValue: index into the element's; -1: none
  bool has_texcoords_ = false;
};

}  // namespace pounce::io
