// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <string>

#include "io/read_mesh.h"

namespace pounce::io {

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

/// mesh_cost() for .obj files.
MeshCost obj_cost(const std::string& path, const MeshReading& reading);

}  // namespace pounce::io
