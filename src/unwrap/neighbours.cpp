// SPDX-License-Identifier: Apache-2.0
#include "unwrap/neighbours.h"

#include <algorithm>
#include <cstddef>
#include <tuple>

namespace pounce::unwrap {
namespace {

/// Edges are given by three times the triangle plus which of its edges it is.
void pair(std::vector<std::uint32_t>& along, std::vector<std::uint32_t>& against,
          std::span<const Vec3d> normals, std::vector<std::uint32_t>& neighbours) {
  constexpr std::size_t kMost = 16;  // of what is no surface but a book with many pages
  if (along.size() > kMost || against.size() > kMost) return;
  while (!along.empty() && !against.empty()) {
    std::size_t one = 0, other = 0;
    double best = -2;
    for (std::size_t i = 0; i < along.size(); ++i) {
      for (std::size_t j = 0; j < against.size(); ++j) {
        const double alike = dot(normals[along[i] / 3], normals[against[j] / 3]);
        if (alike > best) best = alike, one = i, other = j;
      }
    }
    neighbours[along[one]] = against[other] / 3;
    neighbours[against[other]] = along[one] / 3;
    along.erase(along.begin() + static_cast<std::ptrdiff_t>(one));
    against.erase(against.begin() + static_cast<std::ptrdiff_t>(other));
  }
}

}  // namespace

std::vector<std::uint32_t> find_neighbours(std::span<const Triangle> triangles,
                                           std::span<const Vec3d> normals) {
  struct Side {
    std::uint32_t low, high, at;  ///< the edge's vertices; three times the triangle plus which
  };
  std::vector<Side> sides;
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    for (std::uint32_t k = 0; k < 3; ++k) {
      const auto [a, b] = std::minmax(triangles[t][k], triangles[t][(k + 1) % 3]);
      sides.push_back({a, b, 3 * t + k});
    }
  }
  const auto key = [](const Side& side) { return std::tuple(side.low, side.high, side.at); };
  std::sort(sides.begin(), sides.end(),
            [&](const Side& a, const Side& b) { return key(a) < key(b); });
  std::vector<std::uint32_t> neighbours(3 * triangles.size(), kNone);
  for (std::size_t first = 0, end = 0; first < sides.size(); first = end) {
    while (end < sides.size() && sides[end].low == sides[first].low &&
           sides[end].high == sides[first].high)
      ++end;
    std::vector<std::uint32_t> along, against;
    for (std::size_t i = first; i < end; ++i) {
      const std::uint32_t at = sides[i].at;
      (triangles[at / 3][at % 3] == sides[i].low ? along : against).push_back(at);
    }
    pair(along, against, normals, neighbours);
  }
  // Two that share two edges, back to back: no plane has room for both around their vertex.
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    for (std::uint32_t k = 0; k < 3; ++k) {
      const std::uint32_t next = neighbours[3 * t + k];
      if (next == kNone || neighbours[3 * t + (k + 1) % 3] != next) continue;
      for (const std::uint32_t one : {t, next}) {
        for (std::uint32_t j = 0; j < 3; ++j) {
          if (neighbours[3 * one + j] == (one == t ? next : t)) neighbours[3 * one + j] = kNone;
        }
      }
    }
  }
  return neighbours;
}

}  // namespace pounce::unwrap
