// SPDX-License-Identifier: Apache-2.0
#include "meshing/surface.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "core/directions.h"

namespace pounce::meshing {
namespace {

/// Neighbours of each vertex, one list after the other; and which vertices lie on a border.
struct Rings {
  std::vector<std::uint32_t> first, neighbours;
  std::vector<char> is_border;

  explicit Rings(const Surface& surface) : first(surface.positions.size() + 1) {
    std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
    for (const Triangle& t : surface.triangles) {
      for (std::size_t k = 0; k < 3; ++k) edges.emplace_back(t[k], t[(k + 1) % 3]);
    }
    std::sort(edges.begin(), edges.end());
    is_border.assign(surface.positions.size(), 0);
    for (const auto& [a, b] : edges) {
      // An inner edge is gone along once each way.
      if (!std::binary_search(edges.begin(), edges.end(), std::pair(b, a)))
        is_border[a] = is_border[b] = 1;
    }
    std::vector<std::pair<std::uint32_t, std::uint32_t>> both = edges;
    for (const auto& [a, b] : edges) both.emplace_back(b, a);
    std::sort(both.begin(), both.end());
    both.erase(std::unique(both.begin(), both.end()), both.end());
    for (const auto& [a, b] : both) {
      ++first[a + 1];
      neighbours.push_back(b);
    }
    std::partial_sum(first.begin(), first.end(), first.begin());
  }
};

/// The first of both limits that is met ends it.
void simplify(Surface& surface, std::size_t triangles, float error) {
  static_assert(sizeof(Triangle) == 3 * sizeof(unsigned) && sizeof(Vec3f) == 3 * sizeof(float));
  std::vector<Triangle> kept(surface.triangles.size());
  const std::size_t indices =
      meshopt_simplify(kept.front().data(), surface.triangles.front().data(),
                       3 * surface.triangles.size(), &surface.positions.front().x,
                       surface.positions.size(), sizeof(Vec3f), 3 * triangles, error, 0, nullptr);
  kept.resize(indices / 3);
  surface.triangles = std::move(kept);
  drop_unused(surface);
}

}  // namespace

Vec3d area_vector(const std::vector<Vec3f>& positions, const Triangle& t) {
  const Vec3d a(positions[t[0]]), b(positions[t[1]]), c(positions[t[2]]);
  return cross(b - a, c - a) * 0.5;
}

void drop_unused(Surface& surface) {
  constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> number(surface.positions.size(), kNone);
  std::vector<Vec3f> used;
  for (Triangle& t : surface.triangles) {
    for (std::uint32_t& v : t) {
      if (number[v] == kNone) {
        number[v] = static_cast<std::uint32_t>(used.size());
        used.push_back(surface.positions[v]);
      }
      v = number[v];
    }
  }
  surface.positions = std::move(used);
}

void keep_large_parts(Surface& surface, double share) {
  std::vector<std::uint32_t> part(surface.positions.size());
  std::iota(part.begin(), part.end(), 0U);
  const auto root = [&](std::uint32_t v) {
    while (part[v] != v) v = part[v] = part[part[v]];
    return v;
  };
  for (const Triangle& t : surface.triangles) {
    for (std::size_t k = 1; k < 3; ++k) {
      const std::uint32_t a = root(t[0]), b = root(t[k]);
      part[std::max(a, b)] = std::min(a, b);
    }
  }
  std::vector<double> area(surface.positions.size());
  for (const Triangle& t : surface.triangles)
    area[root(t[0])] += length(area_vector(surface.positions, t));
  const double largest = area.empty() ? 0 : *std::max_element(area.begin(), area.end());
  std::erase_if(surface.triangles,
                [&](const Triangle& t) { return area[root(t[0])] < share * largest; });
  drop_unused(surface);
}

void smooth(Surface& surface, int rounds) {
  constexpr float kForth = 0.5F, kBack = -0.53F;
  const Rings rings(surface);
  std::vector<Vec3f> moved(surface.positions.size());
  for (int round = 0; round < 2 * rounds; ++round) {
    const float step = round % 2 == 0 ? kForth : kBack;
    for (std::size_t v = 0; v < moved.size(); ++v) {
      const std::uint32_t first = rings.first[v], last = rings.first[v + 1];
      moved[v] = surface.positions[v];
      if (rings.is_border[v] != 0 || first == last) continue;
      Vec3f sum{};
      for (std::uint32_t n = first; n < last; ++n)
        sum = sum + surface.positions[rings.neighbours[n]];
      moved[v] = moved[v] + (sum * (1 / static_cast<float>(last - first)) - moved[v]) * step;
    }
    surface.positions.swap(moved);
  }
}

void simplify(Surface& surface, std::size_t triangles) {
  const float any_error = 1;  // of the surface's size: the number decides
  if (surface.triangles.size() > triangles) simplify(surface, triangles, any_error);
}

void simplify_within(Surface& surface, double distance) {
  const Vec3f size = box_of(surface).hi - box_of(surface).lo;
  const double longest = std::max({size.x, size.y, size.z});  // what errors are counted in
  if (!(longest > 0)) return;
  simplify(surface, 0, static_cast<float>(std::min(distance / longest, 1.0)));
}

Box3f box_of(const Surface& surface) {
  Box3f box;
  for (const Vec3f& p : surface.positions) box.extend(p);
  return box;
}

std::vector<Vec3f> normals_of(const Surface& surface) {
  std::vector<Vec3d> sums(surface.positions.size());
  for (const Triangle& t : surface.triangles) {
    const Vec3d own = area_vector(surface.positions, t);
    for (const std::uint32_t v : t) sums[v] = sums[v] + own;
  }
  std::vector<Vec3f> normals;
  normals.reserve(sums.size());
  for (const Vec3d& sum : sums)
    normals.push_back(length(sum) > 0 ? Vec3f(unit_vector(sum)) : Vec3f{0, 0, 1});
  return normals;
}

}  // namespace pounce::meshing
