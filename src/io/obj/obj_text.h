// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "core/bytes.h"
#include "core/file.h"

namespace pounce::io {

/// An OBJ or MTL file statement by statement: lines, which end with LF, CR LF or CR, without the
/// blanks at their ends, without a byte order mark. Whoever reads or counts takes them from here,
/// so that both see the same. Holds 256 KiB of the file, and the statement.
class ObjText {
 public:
  enum class Kind {
    obj,  ///< "\" at the end of a line joins the next, but not of a comment; up to 16 MiB
    mtl,  ///< lines are never joined; up to 1 MiB
  };
  ObjText(const std::string& path, Kind kind);

  /// Replaces `out` with the next statement, which is there until the next is asked for; false at
  /// the end. Throws Error(storage), or Error(input) for a line that is none.
  bool next(std::string_view& out);
  /// Throws Error(input) that names the line of the statement.
  [[noreturn]] void fail(const std::string& what) const;
  /// Of all statements so far, blanks at their ends included.
  std::uint64_t longest_bytes() const { return longest_bytes_; }

 private:
  bool next_piece();
  bool take_line(std::string_view& out);
  bool append_line();

  std::string path_;
  Kind kind_;
  std::unique_ptr<ReadFile> file_;
  std::uint64_t offset_ = 0;
  UnsetBytes room_;
  std::string_view piece_;            ///< of the file, in `room_`
  std::string statement_;             ///< of several lines or pieces
  std::size_t at_ = 0, next_lf_ = 0;  ///< in the piece
  std::uint64_t line_ = 0;            ///< first line of the statement, from 1
  std::uint64_t lines_ended_ = 0;     ///< so far
  bool has_cr_ = false;               ///< somewhere in the piece
  bool after_cr_ = false;             ///< a LF now is of the same end
  std::uint64_t longest_bytes_ = 0;
};

inline bool is_blank(char c) { return c == ' ' || c == '\t'; }

/// Takes the next word off the front of `rest`; empty at the end.
inline std::string_view next_word(std::string_view& rest) {
  const char* at = rest.data();
  const char* const end = at + rest.size();
  while (at != end && is_blank(*at)) ++at;
  const char* const first = at;
  while (at != end && !is_blank(*at)) ++at;
  rest = {at, static_cast<std::size_t>(end - at)};
  return {first, static_cast<std::size_t>(at - first)};
}

/// How many words there are in it.
std::size_t word_count(std::string_view rest);

/// The name that follows the word of a statement: all behind one blank, further blanks included.
/// A zero byte ends it.
std::string name_in(std::string_view rest);
inline constexpr std::size_t kMaxNameBytes = 4096;  ///< longer ones of an OBJ are refused

/// How many statements of each kind an OBJ file holds: what bounds the memory it needs.
/// `distinct_corners`, the number of different (v, vt, vn), is estimated from hashes (standard
/// error 0.8 %) and then rounded up by 5 %.
struct ObjCounts {
  std::uint64_t positions = 0, texcoords = 0, normals = 0, faces = 0, corners = 0,
                distinct_corners = 0, triangles = 0;
  bool lacks_normals = false;  ///< some corner has none
  bool has_colours = false;    ///< some vertex has one
  /// "o" and "g" statements, their bytes, and how many different pairs of them faces have
  /// (estimated like distinct_corners).
  std::uint64_t names = 0, name_bytes = 0, distinct_parts = 0;
  std::uint64_t longest_line_bytes = 0;  ///< with the blanks at its ends
  std::uint64_t longest_name_bytes = 0;  ///< of the "o", "g" and "usemtl" statements
  std::uint64_t most_groups = 0;         ///< names in one "g" statement
  std::uint64_t most_corners = 0;        ///< of one face
  /// "usemtl" statements, their bytes, and how many different ones faces have (estimated, too).
  std::uint64_t uses = 0, use_bytes = 0, distinct_materials = 0;
  std::set<std::string> libraries;  ///< every name that "mtllib" statements may mean
};
/// Throws what reading would: Error(storage), or Error(input).
ObjCounts count_obj(const std::string& path);

/// A face can be selected by so many groups, the first of its "g".
inline constexpr std::size_t kMaxGroups = 64;

/// "v x y z r g b": so many numbers follow a "v" that has a colour. A weight is one number alone.
inline constexpr std::size_t kColouredVertexWords = 6;

}  // namespace pounce::io
