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

/// An OBJ file statement by statement: lines without the blanks at their ends, continued ones ("\"
/// at the end) joined, without a byte order mark. Whoever reads or counts takes them from here, so
/// that both see the same. Holds about 1 MiB of the file.
class ObjText {
 public:
  explicit ObjText(const std::string& path);

  /// Replaces `out` with the next statement; false at the end. Throws Error(storage), or
  /// Error(input) for a line that is none.
  bool next(std::string& out);
  /// Throws Error(input) that names the line of the statement.
  [[noreturn]] void fail(const std::string& what) const;

 private:
  bool next_raw_line(std::string& out);

  std::string path_;
  std::unique_ptr<ReadFile> file_;
  std::uint64_t offset_ = 0;
  std::vector<char> piece_;
  std::size_t at_ = 0;
  std::uint64_t line_ = 0;       ///< first line of the statement, from 1
  std::uint64_t raw_lines_ = 0;  ///< lines taken from the file
};

/// Feeds an OBJ file to tinyobjloader line by line. tinyobjloader reads "nan", "1/x" and missing
/// numbers as 0 without a word, so a line reaches it only after it has been checked; only the lines
/// that matter (v, vt, vn, f, o, g, usemtl, mtllib) do.
class ObjLines : public std::streambuf {
 public:
  explicit ObjLines(const std::string& path);

  /// What stopped the reading, if anything did: Error(input) with file and line, Error(storage), or
  /// no memory.
  /// An exception cannot pass through std::istream, so look here when tinyobjloader returns.
  std::exception_ptr failure() const { return failure_; }
  [[noreturn]] void fail(const std::string& what) const { file_.fail(what); }

 protected:
  int_type underflow() override;

 private:
  bool next_checked_line();
  void check_numbers(std::string_view rest, int needed, int at_most, const char* what) const;
  void check_face(std::string_view rest);
  void quote_material_library(std::string_view rest);

  std::string path_;
  ObjText file_;
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
  std::uint64_t longest_name_bytes = 0;  ///< of the "o", "g" and "usemtl" statements
  std::uint64_t most_groups = 0;         ///< names in one "g" statement
  std::uint64_t most_corners = 0;        ///< of one face
  /// "usemtl" statements, their bytes, and how many different ones faces have (estimated, too).
  std::uint64_t uses = 0, use_bytes = 0, distinct_materials = 0;
  std::set<std::string> libraries;  ///< every name that "mtllib" statements may mean
};
/// Throws what reading would: Error(storage), or Error(input).
ObjCounts count_obj(const std::string& path);

/// A model that names more material files is refused.
inline constexpr std::size_t kMaxLibraries = 1000;
[[noreturn]] void refuse_libraries(const std::string& path);

}  // namespace pounce::io
