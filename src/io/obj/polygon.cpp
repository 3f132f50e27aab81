// SPDX-License-Identifier: Apache-2.0
//
// Faces of an OBJ have any number of corners, and may be neither flat nor convex.
//
// Convex ones become a fan, which is also what is left to do where nothing better is known. Of the
// others ears are cut off: a corner whose triangle turns the right way and holds no other corner
// can go without changing the rest. The polygon is looked at along its mean normal, by dropping one
// coordinate, so an ear is judged in the plane in doubles. One that crosses itself runs out of ears
// at some point; the fan of what is left has the right number of triangles at least.
//
// n - 2 triangles come of n corners whatever their places: mesh_cost() counts on it.
//
// A triangulation must not depend on where the polygon lies or on the machine: the plane is found
// in doubles from all corners, and of several ears the first in the file's order goes.
#include "io/obj/polygon.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace pounce::io {
namespace {

constexpr std::size_t kMaxEars = 1000;  // cutting ears costs the square of the corner count

/// Newell's sum: twice the area vector, good for corners that are not quite in one plane.
Vec3d area_vector(std::span<const Vec3f> corners) {
  Vec3d sum;
  // Relative to a corner: at map coordinates, products of positions would leave no digits for the
  // area.
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
      // Two coordinates are swapped where the normal points away, or all turns would have the other
      // sign.
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

/// Straight corners count as convex: a fan has triangles without area there, as it must.
bool is_convex(const std::vector<Vec2d>& flat) {
  const std::size_t n = flat.size();
  for (std::size_t i = 0; i < n; ++i) {
    if (turn(flat[i], flat[(i + 1) % n], flat[(i + 2) % n]) < 0) return false;
  }
  return true;
}

/// Cuts corners off a polygon, the first one that is an ear each time. A corner that is none stays
/// none until one of its neighbours goes, or the corner that was met in its way: only then is it
/// looked at again, and what lies before that corner is not. So all ears together cost the square
/// of the corner count at most, and far less where ears are small.
class Ears {
 public:
  explicit Ears(const std::vector<Vec2d>& flat)
      : flat_(flat),
        by_x_(flat.size()),
        corners_(flat.size()),
        blocked_(flat.size()),
        open_(flat.size(), true),
        first_open_(0) {
    const auto n = static_cast<std::uint32_t>(flat.size());
    for (std::uint32_t i = 0; i < n; ++i) {
      corners_[i].before = i == 0 ? n - 1 : i - 1;
      corners_[i].after = i + 1 == n ? 0 : i + 1;
      by_x_[i] = i;
    }
    std::sort(by_x_.begin(), by_x_.end(), [&](std::uint32_t i, std::uint32_t k) {
      return flat[i].x != flat[k].x ? flat[i].x < flat[k].x : i < k;
    });
  }

  /// Cuts the first ear off and returns it between its neighbours; nothing if there is none.
  std::optional<std::array<std::uint32_t, 3>> cut() {
    for (; first_open_ < open_.size(); ++first_open_) {
      const std::uint32_t b = first_open_;
      if (!open_[b]) continue;
      open_[b] = false;
      const std::uint32_t a = corners_[b].before, c = corners_[b].after;
      if (!is_ear(a, b, c)) continue;
      corners_[b].is_there = false;
      corners_[a].after = c;
      corners_[c].before = a;
      for (const std::uint32_t neighbour : {a, c}) {
        corners_[neighbour].looked = 0;
        reopen(neighbour);
      }
      for (const std::uint32_t corner : blocked_[b]) reopen(corner);
      return std::array{a, b, c};
    }
    return std::nullopt;
  }
  bool is_there(std::uint32_t corner) const { return corners_[corner].is_there; }

 private:
  struct Corner {
    std::uint32_t before = 0, after = 0;
    std::uint32_t looked = 0;  ///< of by_x_: those before are not in its way; 0 = not looked yet
    bool is_there = true;
  };

  void reopen(std::uint32_t corner) {
    if (!corners_[corner].is_there) return;
    open_[corner] = true;
    first_open_ = std::min(first_open_, corner);
  }
  /// Is corner b, between a and c, an ear of what is left?
  bool is_ear(std::uint32_t corner_a, std::uint32_t corner_b, std::uint32_t corner_c) {
    const Vec2d a = flat_[corner_a], b = flat_[corner_b], c = flat_[corner_c];
    if (turn(a, b, c) <= 0) return false;
    const double left = std::min({a.x, b.x, c.x}), right = std::max({a.x, b.x, c.x});
    const double low = std::min({a.y, b.y, c.y}), high = std::max({a.y, b.y, c.y});
    // Only corners between the triangle's left and right can be inside it: the walk begins at the
    // first of these.
    std::uint32_t& at = corners_[corner_b].looked;
    if (at == 0) {
      const auto is_left = [&](std::uint32_t corner, double x) { return flat_[corner].x < x; };
      const auto first = std::lower_bound(by_x_.begin(), by_x_.end(), left, is_left);
      at = static_cast<std::uint32_t>(first - by_x_.begin());
    }
    for (; at < by_x_.size(); ++at) {
      const Vec2d p = flat_[by_x_[at]];
      if (p.x > right) break;
      if (p.y < low || p.y > high) continue;
      if (!corners_[by_x_[at]].is_there || p == a || p == b || p == c) continue;
      if (turn(a, b, p) >= 0 && turn(b, c, p) >= 0 && turn(c, a, p) >= 0) {
        blocked_[by_x_[at]].push_back(corner_b);
        return false;
      }
    }
    return true;
  }

  const std::vector<Vec2d>& flat_;
  std::vector<std::uint32_t> by_x_;  ///< corners from left to right
  std::vector<Corner> corners_;
  std::vector<std::vector<std::uint32_t>> blocked_;  ///< by corner: those that it was in the way of
  std::vector<bool> open_;                           ///< by corner: is it worth a look?
  std::uint32_t first_open_;                         ///< none before it is
};

}  // namespace

std::vector<std::array<std::uint32_t, 3>> triangulate(std::span<const Vec3f> corners) {
  std::vector<std::array<std::uint32_t, 3>> triangles;
  const auto n = static_cast<std::uint32_t>(corners.size());
  if (n < 3) return triangles;
  triangles.reserve(n - 2);
  std::vector<std::uint32_t> ring(n);
  for (std::uint32_t i = 0; i < n; ++i) ring[i] = i;
  // Three corners are a triangle, and many more would take the square of their number.
  if (n > 3 && n <= kMaxEars) {
    const std::vector<Vec2d> flat = flatten(corners, area_vector(corners));
    if (!is_convex(flat)) {
      Ears ears(flat);
      while (triangles.size() + 3 < n) {
        const auto ear = ears.cut();
        if (!ear) break;
        triangles.push_back(*ear);
      }
      std::erase_if(ring, [&](std::uint32_t corner) { return !ears.is_there(corner); });
    }
  }
  // What no ear took off becomes a fan, so the number of triangles is right in any case.
  for (std::size_t i = 1; i + 1 < ring.size(); ++i) {
    triangles.push_back({ring[0], ring[i], ring[i + 1]});
  }
  return triangles;
}

}  // namespace pounce::io
