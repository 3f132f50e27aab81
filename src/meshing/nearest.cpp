// SPDX-License-Identifier: Apache-2.0
#include "meshing/nearest.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "core/directions.h"

namespace pounce::meshing {
namespace {

constexpr std::uint32_t kLeaf = 4;

double squared_distance(const Box3f& box, Vec3d p) {
  const auto beyond = [](double v, float lo, float hi) {
    return std::max({double{lo} - v, v - double{hi}, 0.0});
  };
  const Vec3d d{beyond(p.x, box.lo.x, box.hi.x), beyond(p.y, box.lo.y, box.hi.y),
                beyond(p.z, box.lo.z, box.hi.z)};
  return dot(d, d);
}

/// The shares of a triangle's corners in its point that is nearest to p (Ericson, "Real-Time
/// Collision Detection", 2005, 5.1.5).
std::array<double, 3> nearest_shares(Vec3d p, Vec3d a, Vec3d b, Vec3d c) {
  const Vec3d ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const double d1 = dot(ab, ap), d2 = dot(ac, ap);
  if (d1 <= 0 && d2 <= 0) return {1, 0, 0};
  const double d3 = dot(ab, bp), d4 = dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return {0, 1, 0};
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    const double v = d1 > d3 ? d1 / (d1 - d3) : 0;
    return {1 - v, v, 0};
  }
  const double d5 = dot(ab, cp), d6 = dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return {0, 0, 1};
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    const double w = d2 > d6 ? d2 / (d2 - d6) : 0;
    return {1 - w, 0, w};
  }
  const double va = d3 * d6 - d5 * d4, along = (d4 - d3) + (d5 - d6);
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const double w = along > 0 ? (d4 - d3) / along : 0;
    return {0, 1 - w, w};
  }
  const double all = va + vb + vc;
  return {va / all, vb / all, vc / all};
}

}  // namespace

Nearest::Nearest(const Surface& surface) : surface_(surface) {
  for (const Triangle& t : surface.triangles) {
    const Vec3d a(surface.positions[t[0]]), b(surface.positions[t[1]]), c(surface.positions[t[2]]);
    normals_.emplace_back(unit_vector(cross(b - a, c - a)));
    middles_.emplace_back((a + b + c) * (1.0 / 3));
  }
  order_.resize(surface.triangles.size());
  std::iota(order_.begin(), order_.end(), 0U);
  if (!order_.empty()) build(0, static_cast<std::uint32_t>(order_.size()));
}

void Nearest::build(std::uint32_t first, std::uint32_t last) {
  const std::size_t own = nodes_.size();
  nodes_.emplace_back();
  Box3f middles;
  for (std::uint32_t i = first; i < last; ++i) {
    for (const std::uint32_t v : surface_.triangles[order_[i]])
      nodes_[own].box.extend(surface_.positions[v]);
    middles.extend(middles_[order_[i]]);
  }
  if (last - first <= kLeaf) {
    nodes_[own].first = first;
    nodes_[own].count = last - first;
    return;
  }
  const Vec3f size = middles.hi - middles.lo;
  const auto along = [&](std::uint32_t t) {
    const Vec3f& m = middles_[t];
    return size.x >= size.y && size.x >= size.z ? m.x : size.y >= size.z ? m.y : m.z;
  };
  const std::uint32_t middle = first + (last - first) / 2;
  std::nth_element(order_.begin() + first, order_.begin() + middle, order_.begin() + last,
                   [&](std::uint32_t a, std::uint32_t b) {
                     return std::pair(along(a), a) < std::pair(along(b), b);
                   });
  build(first, middle);
  nodes_[own].first = static_cast<std::uint32_t>(nodes_.size());
  build(middle, last);
}

std::optional<Foot> Nearest::to(Vec3d point, Vec3d normal) const {
  if (nodes_.empty()) return std::nullopt;
  std::optional<Foot> best;
  double least = std::numeric_limits<double>::infinity();
  // No deeper than the tree, whose halves are equal.
  std::array<std::pair<double, std::uint32_t>, 128> open;
  std::size_t count = 0;
  open[count++] = {squared_distance(nodes_[0].box, point), 0};
  while (count > 0) {
    const auto [distance, at] = open[--count];
    if (distance >= least) continue;
    const Node& node = nodes_[at];
    if (node.count == 0) {
      std::pair<double, std::uint32_t> near{squared_distance(nodes_[at + 1].box, point), at + 1},
          far{squared_distance(nodes_[node.first].box, point), node.first};
      if (far < near) std::swap(near, far);
      open[count++] = far;
      open[count++] = near;
      continue;
    }
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      const std::uint32_t t = order_[i];
      if (!(dot(Vec3d(normals_[t]), normal) > 0)) continue;
      const Triangle& c = surface_.triangles[t];
      const Vec3d p0(surface_.positions[c[0]]), p1(surface_.positions[c[1]]),
          p2(surface_.positions[c[2]]);
      const auto shares = nearest_shares(point, p0, p1, p2);
      const Vec3d apart = p0 * shares[0] + p1 * shares[1] + p2 * shares[2] - point;
      if (dot(apart, apart) >= least) continue;
      least = dot(apart, apart);
      best = Foot{t, shares, std::sqrt(least)};
    }
  }
  return best;
}

}  // namespace pounce::meshing
