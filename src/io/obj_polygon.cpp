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

bool is_ear(const std::vector<Vec2d>& flat, const std::vector<std::uint32_t>& ring,
            std::size_t at) {
  const std::size_t n = ring.size();
  const Vec2d a = flat[ring[(at + n - 1) % n]], b = flat[ring[at]], c = flat[ring[(at + 1) % n]];
  if (turn(a, b, c) <= 0) return false;
  for (std::size_t k = 2; k + 1 < n; ++k) {
    const Vec2d p = flat[ring[(at + k) % n]];
    if (p == a || p == b || p == c) continue;
    if (turn(a, b, p) >= 0 && turn(b, c, p) >= 0 && turn(c, a, p) >= 0) return false;
  }
  return true;
}

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
    bool cut = !is_convex(flat);
    while (cut && ring.size() > 3) {
      cut = false;
      for (std::size_t i = 0; i < ring.size() && !cut; ++i) {
        if (!is_ear(flat, ring, i)) continue;
        const std::size_t size = ring.size();
        triangles.push_back({ring[(i + size - 1) % size], ring[i], ring[(i + 1) % size]});
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
