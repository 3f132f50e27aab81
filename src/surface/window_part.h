// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "core/vec.h"
#include "mesh/uv_raster.h"

namespace pounce::surface {

/// A corner of a triangle's part in a window, in the window's own coordinates: 0 to 1.
struct Corner {
  Vec2d at;
  double w1, w2;  ///< barycentrics of the triangle's corners 1 and 2
};

/// Triangle and window overlap in a convex polygon of at most 3 + 4 corners; rounding may add some.
class Polygon {
 public:
  Polygon() {}  // corners are left as they are: a block makes thousands
  Polygon(const Polygon& other) { *this = other; }
  Polygon& operator=(const Polygon& other) {  // nor are more copied than there are
    std::copy_n(other.corners_.begin(), other.size_, corners_.begin());
    size_ = other.size_;
    return *this;
  }
  std::size_t size() const { return size_; }
  const Corner& operator[](std::size_t i) const { return corners_[i]; }
  void add(const Corner& corner) {
    if (size_ < corners_.size()) corners_[size_++] = corner;
  }

  /// What lies at sign * (coordinate - limit) >= 0.
  Polygon clipped(double Vec2d::*axis, double limit, double sign) const {
    Polygon kept;
    for (std::size_t i = 0; i < size_; ++i) {
      const Corner &a = corners_[i], &b = corners_[(i + 1) % size_];
      const double da = sign * (a.at.*axis - limit), db = sign * (b.at.*axis - limit);
      if (da >= 0) kept.add(a);
      if ((da < 0) != (db < 0)) kept.add(between(a, b, da / (da - db)));
    }
    return kept;
  }

  static Corner between(const Corner& a, const Corner& b, double k) {
    return {{a.at.x + k * (b.at.x - a.at.x), a.at.y + k * (b.at.y - a.at.y)},
            a.w1 + k * (b.w1 - a.w1),
            a.w2 + k * (b.w2 - a.w2)};
  }

  double area() const {
    double doubled = 0;
    for (std::size_t i = 2; i < size_; ++i)
      doubled += mesh::doubled_area(corners_[0].at, corners_[i - 1].at, corners_[i].at);
    return doubled / 2;
  }

 private:
  // In a union the array is not initialized. Only the first size_ corners are ever read.
  union {
    std::array<Corner, 16> corners_;
  };
  std::size_t size_ = 0;
};

}  // namespace pounce::surface
