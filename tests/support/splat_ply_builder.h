// SPDX-License-Identifier: Apache-2.0
//
// Splat PLY files made by hand, for tests that want to know every byte.
#pragma once

#include <cstddef>
#include <cstring>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "core/portable_math.h"

namespace pounce::test {

/// Columns as "float x", in order; rows by column name, 0 where a row does not say.
class SplatPlyBuilder {
 public:
  using Row = std::map<std::string, double>;

  static std::vector<std::string> usual_columns(int sh_columns = 0, bool normals = true) {
    std::vector<std::string> columns{"float x", "float y", "float z"};
    if (normals) columns.insert(columns.end(), {"float nx", "float ny", "float nz"});
    for (int c = 0; c < 3; ++c) columns.push_back("float f_dc_" + std::to_string(c));
    for (int c = 0; c < sh_columns; ++c) columns.push_back("float f_rest_" + std::to_string(c));
    columns.push_back("float opacity");
    for (int c = 0; c < 3; ++c) columns.push_back("float scale_" + std::to_string(c));
    for (int c = 0; c < 4; ++c) columns.push_back("float rot_" + std::to_string(c));
    return columns;
  }
  /// A small round one at x: visible, of sigma 0.1.
  static Row usual_row(double x) {
    return {{"x", x},          {"opacity", 2},    {"scale_0", -2.3},
            {"scale_1", -2.3}, {"scale_2", -2.3}, {"rot_0", 1}};
  }

  std::vector<std::string> columns = usual_columns();
  std::vector<Row> rows;
  std::string format = "binary_little_endian 1.0";
  std::string comments;       ///< whole header lines
  std::string before, after;  ///< header lines of other elements
  std::string line_end = "\n";
  std::string bytes_before, bytes_after;

  std::string header() const {
    std::string text = "ply\nformat " + format + "\n" + comments + before + "element vertex " +
                       std::to_string(rows.size()) + "\n";
    for (const std::string& column : columns) text += "property " + column + "\n";
    text += after + "end_header\n";
    if (line_end == "\n") return text;
    std::string other;
    for (const char c : text) other += c == '\n' ? line_end : std::string(1, c);
    return other;
  }
  std::string bytes() const {
    std::string out = header() + bytes_before;
    for (const Row& row : rows) {
      for (const std::string& column : columns) {
        const std::size_t space = column.find(' ');
        const auto found = row.find(column.substr(space + 1));
        append(out, column.substr(0, space), found == row.end() ? 0.0 : found->second);
      }
    }
    return out + bytes_after;
  }
  void write(const std::string& path) const { std::ofstream(path, std::ios::binary) << bytes(); }

 private:
  template <class T>
  static void put(std::string& out, double value) {
    const auto typed = static_cast<T>(value);
    out.append(reinterpret_cast<const char*>(&typed), sizeof typed);
  }
  static void append(std::string& out, const std::string& type, double value) {
    if (type == "float" || type == "float32") return put<float>(out, value);
    if (type == "double" || type == "float64") return put<double>(out, value);
    if (type == "uchar" || type == "uint8") return put<unsigned char>(out, value);
    if (type == "char" || type == "int8") return put<signed char>(out, value);
    if (type == "short" || type == "int16") return put<short>(out, value);
    if (type == "ushort" || type == "uint16") {  // half floats, as splat columns hold them
      return put<unsigned short>(out, float_to_half(static_cast<float>(value)));
    }
    if (type == "int" || type == "int32") return put<int>(out, value);
    put<unsigned>(out, value);
  }
};

}  // namespace pounce::test
