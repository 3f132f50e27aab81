// SPDX-License-Identifier: Apache-2.0
//
// Surfaces with UVs, of grids, and what is asked of them.
#pragma once

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cstdint>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "meshing/wedges.h"

namespace pounce::meshing {

inline constexpr double kAnyDistance = std::numeric_limits<double>::infinity();
inline constexpr std::uint32_t kEdge = 512;
inline const auto kNothing = [] {};

/// Grids that are added up and joined.
struct Builder {
  std::vector<Vec3f> positions;
  std::vector<Triangle> triangles;
  std::vector<std::array<Vec2f, 3>> uvs;
  std::vector<std::uint32_t> materials;

  /// n x n squares over s, t in 0..1.
  template <class Place, class Uv>
  void grid(std::uint32_t n, std::uint32_t material, const Place& place, const Uv& uv) {
    const auto first = static_cast<std::uint32_t>(positions.size());
    const auto along = [n](std::uint32_t k) {
      return static_cast<float>(k) / static_cast<float>(n);
    };
    std::vector<Vec2f> own;
    for (std::uint32_t r = 0; r <= n; ++r) {
      for (std::uint32_t c = 0; c <= n; ++c) {
        positions.push_back(place(along(c), along(r)));
        own.push_back(uv(along(c), along(r)));
      }
    }
    const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
      triangles.push_back({first + a, first + b, first + c});
      uvs.push_back({own[a], own[b], own[c]});
      materials.push_back(material);
    };
    for (std::uint32_t r = 0; r < n; ++r) {
      for (std::uint32_t c = 0; c < n; ++c) {
        const std::uint32_t a = r * (n + 1) + c, b = a + 1, d = a + n + 1;
        add(a, b, d + 1);
        add(a, d + 1, d);
      }
    }
  }
  WedgeSurface made() const { return joined(positions, triangles, uvs, materials); }
};

/// Area in the texture, of one material; all triangles must lie the same way.
inline double uv_area(const WedgeSurface& s, std::uint32_t material) {
  double sum = 0;
  for (const Triangle& t : s.triangles) {
    CHECK(s.wedges[t[0]].material == s.wedges[t[1]].material);
    CHECK(s.wedges[t[0]].material == s.wedges[t[2]].material);
    if (s.wedges[t[0]].material == material) sum += turn_of(uvs_of(s, t)) / 2;
  }
  return sum;
}

/// Edges between places that not two triangles have.
inline std::size_t open_edges(const WedgeSurface& s) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const Triangle& t : welded(s).triangles) {
    for (std::size_t k = 0; k < 3; ++k) ++edges[std::minmax(t[k], t[(k + 1) % 3])];
  }
  return static_cast<std::size_t>(
      std::count_if(edges.begin(), edges.end(), [](const auto& e) { return e.second != 2; }));
}

}  // namespace pounce::meshing
