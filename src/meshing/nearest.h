// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/bounds.h"
#include "core/vec.h"
#include "meshing/surface.h"

namespace pounce::meshing {

/// A point of a surface.
struct Foot {
  std::uint32_t triangle = 0;
  std::array<double, 3> shares{};  ///< of the triangle's corners, which sum to 1
  double distance = 0;             ///< from what it is the foot of
};

/// Finds the nearest point of a surface, by a tree of boxes. The surface must outlive it and stay
/// as it is. Reading is thread-safe.
class Nearest {
 public:
  explicit Nearest(const Surface& surface);
  /// Of the triangles that face within 90 degrees of `normal`; nothing: there is none.
  std::optional<Foot> to(Vec3d point, Vec3d normal) const;

 private:
  struct Node {
    Box3f box;
    std::uint32_t first = 0, count = 0;  ///< of order_; count 0: children are here + 1 and `first`
  };
  void build(std::uint32_t first, std::uint32_t last);

  const Surface& surface_;
  std::vector<Vec3f> normals_, middles_;
  std::vector<std::uint32_t> order_;
  std::vector<Node> nodes_;
};

}  // namespace pounce::meshing
