// SPDX-License-Identifier: Apache-2.0
#include "io/obj_polygon.h"

#include <cmath>

namespace pounce::io {
namespace {

constexpr std::size_t kMaxEars =
    1000;  // cutting ears costs the square of the corner count, or worse

/// Newell's sum: twice the area vector, good for corners that are not quite in one plane.
Vec3d area_vector(std::span<const Vec3f> corners) {
  Vec3d sum;
  const Vec3d origin(corners[0]);
  for (std::size_t i = 1; i + 1 < corners.size(); ++i) {
    sum = sum + cross(Vec3d(corners[i]) - origin, Vec3d(corners[i + 1]) - origin);
  }
  return sum;
}

/// Drops the axis along which the polygon is seen best; the remaining two keep it
/// counter-clockwise.
std::vector<Vec2d> flatten(std::span<const Vec3f> corners, Vec3d normal) {
  const double x = std::abs(normal.x), y = std::abs(normal.y), z = std::abs(normal.z);
  std::vector<Vec2d> flat;
  flat.reserve(corners.size());
  for (const Vec3f& corner : corners) {
    const Vec3d p(corner);
    if (z >= x && z >= y) {
      flat.push_back(normal.z < 0 ? Vec2d{p.y, p.x} : Vec2d{p.x, p.y});
    } else if (y >= x) {
      flat.push_back(normal.y < 0 ? Vec2d{p.x, p.z} : Vec2d{p.z, p.x});
    } else {
      flat.push_back(normal.x < 0 ? Vec2d{p.z, p.y} : Vec2d{p.y, p.z});
    }
  }
  return flat;
}

double turn(Vec2d a, Vec2d b, Vec2d c) {
  return (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
}

bool is_convex(const std::vector<Vec2d>& flat) {
  const std::size_t n = flat.size();
  for (std::size_t i = 0; i < n; ++i) {
    if (turn(flat[i], flat[(i + 1) % n], flat[(i + 2) % n]) < 0) return false;
  }
  return true;
}

/// Which corners of a polygon may be cut off. Remembers for each the corner that it met in its way:
/// while that one is there the answer holds, and the corners before it need not be looked at again.
/// So cutting all ears costs the square of the corner count, not its cube.
class Ears {
 public:
  explicit Ears(const std::vector<Vec2d>& flat)
      : flat_(flat), is_there_(flat.size(), true), looked_(flat.size(), 0) {}

  /// Is corner b, between a and c, an ear of what is left?
  bool is_ear(std::uint32_t corner_a, std::uint32_t corner_b, std::uint32_t corner_c) {
    const Vec2d a = flat_[corner_a], b = flat_[corner_b], c = flat_[corner_c];
    if (turn(a, b, c) <= 0) return false;
    std::uint32_t& at = looked_[corner_b];
    for (; at < flat_.size(); ++at) {
      const Vec2d p = flat_[at];
      if (!is_there_[at] || p == a || p == b || p == c) continue;
      if (turn(a, b, p) >= 0 && turn(b, c, p) >= 0 && turn(c, a, p) >= 0) return false;
    }
    return true;
  }
  /// b was cut off between a and c, whose triangles are others now.
  void cut(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    is_there_[b] = false;
    looked_[a] = looked_[c] = 0;
  }

 private:
  const std::vector<Vec2d>& flat_;
  std::vector<bool> is_there_;
  std::vector<std::uint32_t> looked_;  ///< by corner: those before are not in its way
};

}  // namespace

std::vector<std::array<std::uint32_t, 3>> triangulate(std::span<const Vec3f> corners) {
  std::vector<std::array<std::uint32_t, 3>> triangles;
  const auto n = static_cast<std::uint32_t>(corners.size());
  if (n < 3) return triangles;
  triangles.reserve(n - 2);
  std::vector<std::uint32_t> ring(n);
  for (std::uint32_t i = 0; i < n; ++i) ring[i] = i;
  if (n > 3 && n <= kMaxEars) {
    const std::vector<Vec2d> flat = flatten(corners, area_vector(corners));
    Ears ears(flat);
    bool cut = !is_convex(flat);
    while (cut && ring.size() > 3) {
      cut = false;
      for (std::size_t i = 0; i < ring.size() && !cut; ++i) {
        const std::size_t size = ring.size();
        const std::uint32_t a = ring[(i + size - 1) % size], b = ring[i], c = ring[(i + 1) % size];
        if (!ears.is_ear(a, b, c)) continue;
        triangles.push_back({a, b, c});
        ears.cut(a, b, c);
        ring.erase(ring.begin() + static_cast<std::ptrdiff_t>(i));
        cut = true;
      }
    }
  }
  for (std::size_t i = 1; i + 1 < ring.size(); ++i) {
    triangles.push_back({ring[0], ring[i], ring[i + 1]});
  }
  return triangles;
}

}  // namespace pounce::io
