// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <exception>
#include <memory>
#include <set>
#include <streambuf>
#include <string>
#include <vector>

#include "core/file.h"

namespace pounce::io {

/// Feeds an OBJ file to tinyobjloader line by line. tinyobjloader reads "nan", "1/x" and missing
/// numbers as 0 without a word, so a line reaches it only after it has been checked; only the lines
/// that matter (v, vt, vn, f, o, g, usemtl, mtllib) do, continued ones ("\" at the end) joined.
/// Holds about 1 MiB of the file.
class ObjLines : public std::streambuf {
 public:
  explicit ObjLines(const std::string& path);

  /// Number of the line now being read, from 1.
  std::uint64_t line() const { return line_; }
  /// What stopped the reading, if anything did: Error(input) with file and line, Error(storage), or
  /// no memory.
  /// An exception cannot pass through std::istream, so look here when tinyobjloader returns.
  std::exception_ptr failure() const { return failure_; }
  [[noreturn]] void fail(const std::string& what) const;

 protected:
  int_type underflow() override;

 private:
  bool next_raw_line(std::string& out);
  bool next_checked_line();
  void check_numbers(std::string_view rest, int needed, int at_most, const char* what) const;
  void check_face(std::string_view rest);
  void quote_material_library(std::string_view rest);

  std::string path_;
  std::unique_ptr<ReadFile> file_;
  std::uint64_t offset_ = 0;
  std::vector<char> piece_;
  std::size_t at_ = 0;
  std::uint64_t line_ = 0;       ///< first line of the statement
  std::uint64_t raw_lines_ = 0;  ///< lines taken from the file
  std::string text_;
  std::exception_ptr failure_;
};

/// How many statements of each kind an OBJ file holds: what bounds the memory it needs.
/// `distinct_corners`, the number of different (v, vt, vn), is estimated from hashes (standard
/// error 0.8 %) and then rounded up by 5 %.
struct ObjCounts {
  std::uint64_t positions = 0, texcoords = 0, normals = 0, faces = 0, corners = 0,
                distinct_corners = 0;
  /// "o" and "g" statements, their bytes, and how many different pairs of them faces have
  /// (estimated like distinct_corners).
  std::uint64_t names = 0, name_bytes = 0, distinct_parts = 0;
  std::uint64_t longest_line_bytes = 0;
  std::uint64_t most_groups = 0;  ///< names in one "o" or "g" statement
  /// "usemtl" statements, and how many different ones faces have (estimated, too).
  std::uint64_t uses = 0, distinct_materials = 0;
  std::set<std::string> libraries;  ///< what "mtllib" statements say, the first thousand
};
ObjCounts count_obj(const std::string& path);

}  // namespace pounce::io
