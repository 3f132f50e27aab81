// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "mesh/mesh.h"

namespace pounce::mesh {

/// Gives corners values that a mesh keeps by vertex (normals, tangents): a vertex whose corners
/// differ is split. Copies are kept apart until their number is known, so that the mesh's arrays
/// grow once.
template <class Value>
class VertexSplitter {
 public:
  /// `values`: the mesh's, by vertex; those that a corner asks for are overwritten.
  explicit VertexSplitter(std::vector<Value>& values)
      : values_(values), known_(values.size(), false), next_copy_(values.size(), kNone) {}

  /// The vertex that has this value: `vertex` itself for the first corner that asks for it, else it
  /// or one of its copies.
  std::uint32_t with(std::uint32_t vertex, const Value& value) {
    if (!known_[vertex]) {
      known_[vertex] = true;
      values_[vertex] = value;
      return vertex;
    }
    // The copies of a vertex form a chain.
    std::uint32_t found = vertex;
    while (of(found) != value && next_copy_[found] != kNone) found = next_copy_[found];
    if (of(found) == value) return found;
    const auto copy = static_cast<std::uint32_t>(next_copy_.size());
    next_copy_[found] = copy;
    next_copy_.push_back(kNone);
    originals_.push_back(vertex);
    of_copies_.push_back(value);
    return copy;
  }
  /// Adds the copies to the mesh that `values` is of; returns how many.
  std::uint64_t split(Mesh& mesh) {
    mesh.append_copies(originals_);
    std::copy(of_copies_.begin(), of_copies_.end(),
              values_.begin() + static_cast<std::ptrdiff_t>(known_.size()));
    return originals_.size();
  }

 private:
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
  const Value& of(std::uint32_t vertex) const {
    return vertex < known_.size() ? values_[vertex] : of_copies_[vertex - known_.size()];
  }

  std::vector<Value>& values_;
  std::vector<bool> known_;               ///< by vertex: has some corner asked for it?
  std::vector<std::uint32_t> next_copy_;  ///< by vertex and copy
  std::vector<std::uint32_t> originals_;  ///< by copy
  std::vector<Value> of_copies_;
};

/// Makes every normal of `mesh` a unit vector. One that is zero or not finite becomes the
/// area-weighted mean of its triangles' normals (zero where they have no area). Returns how many
/// were replaced.
std::uint64_t repair_normals(Mesh& mesh);

/// Makes every tangent a unit vector orthogonal to its normal with w = +1 or -1. One that is zero
/// or not finite is derived: the area-weighted mean direction of growing u in uv set 0 around the
/// vertex; where there are no UVs, or they cancel out, any direction with w = 1. The sign follows
/// glTF's: w * cross(normal, tangent) points to where v falls (up in the image). Needs normals.
/// Notes which were there (Mesh::own_tangents). Returns how many were derived.
std::uint64_t complete_tangents(Mesh& mesh);

/// Normals for a mesh without them: per corner, the area-weighted mean of the triangles around its
/// position whose normals are within `max_angle_deg` of its own triangle's. Vertices whose corners
/// differ are split (the copies come last). `position_of[vertex]` tells which vertices share a
/// position: equal numbers, below `position_count`. Only vertices with `missing[vertex]` are
/// touched.
void smooth_normals(Mesh& mesh, const std::vector<std::uint32_t>& position_of,
                    std::uint32_t position_count, const std::vector<bool>& missing,
                    double max_angle_deg);

}  // namespace pounce::mesh
