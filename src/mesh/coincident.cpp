// SPDX-License-Identifier: Apache-2.0
//
// Places are compared bit by bit: what was copied coincides; what was computed twice hardly does.
#include "mesh/coincident.h"

#include <algorithm>
#include <array>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "core/hash.h"

namespace pounce::mesh {
namespace {

using Corners = std::array<std::uint32_t, 3>;
using Places = std::array<std::array<float, 3>, 3>;

/// The triangle's corners, from the one with the least coordinates on.
Corners from_least(const Mesh& mesh, const Corners& corners) {
  const auto place = [&](std::size_t k) {
    const Vec3f& p = mesh.positions[corners[k]];
    return std::tuple(p.x, p.y, p.z);
  };
  std::size_t least = 0;
  for (const std::size_t k : {1U, 2U}) {
    if (place(k) < place(least)) least = k;
  }
  return {corners[least], corners[(least + 1) % 3], corners[(least + 2) % 3]};
}

Places places_of(const Mesh& mesh, const Corners& corners) {
  Places out;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3f& p = mesh.positions[corners[k]];
    out[k] = {p.x + 0.0F, p.y + 0.0F, p.z + 0.0F};  // -0 is 0
  }
  return out;
}

bool looks_the_same(const Mesh& mesh, std::uint32_t a, std::uint32_t b) {
  if (mesh.triangle_material[a] != mesh.triangle_material[b]) return false;
  const Corners one = from_least(mesh, mesh.triangles[a]),
                other = from_least(mesh, mesh.triangles[b]);
  return std::all_of(mesh.uv_sets.begin(), mesh.uv_sets.end(), [&](const auto& uvs) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec2f p = uvs[one[k]], q = uvs[other[k]];
      if (p.x != q.x || p.y != q.y) return false;
    }
    return true;
  });
}

struct Entry {
  std::uint64_t hash;
  std::uint32_t triangle;
  bool operator<(const Entry& other) const {
    return std::tie(hash, triangle) < std::tie(other.hash, other.triangle);
  }
};

/// Of triangles of one hash, in file order. Nearly always they have the same places.
std::uint64_t count_among(const Mesh& mesh, std::span<const Entry> entries) {
  std::uint64_t count = 0;
  const auto places = [&](const Entry& e) {
    return places_of(mesh, from_least(mesh, mesh.triangles[e.triangle]));
  };
  for (std::size_t i = 1; i < entries.size(); ++i) {
    const Places own = places(entries[i]);
    if (own[0] == own[1] || own[1] == own[2] || own[2] == own[0]) continue;  // no area
    const auto first = std::find_if(entries.begin(), entries.end(),
                                    [&](const Entry& e) { return places(e) == own; });
    if (!looks_the_same(mesh, first->triangle, entries[i].triangle)) ++count;
  }
  return count;
}

}  // namespace

std::uint64_t count_coincident(const Mesh& mesh) {
  constexpr std::size_t kFew = 1 << 15;  // are sorted at once
  const std::size_t passes = mesh.triangles.size() > kFew ? 8 : 1;
  std::uint64_t count = 0;
  std::vector<Entry> entries;
  for (std::size_t pass = 0; pass < passes; ++pass) {
    entries.clear();
    for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
      const Places places = places_of(mesh, from_least(mesh, mesh.triangles[t]));
      const std::uint64_t hash = checksum(std::as_bytes(std::span(places)));
      if (hash % passes == pass) entries.push_back({hash, t});
    }
    std::sort(entries.begin(), entries.end());
    for (auto from = entries.begin(); from != entries.end();) {
      const auto to =
          std::find_if(from, entries.end(), [&](const Entry& e) { return e.hash != from->hash; });
      if (to - from > 1) count += count_among(mesh, std::span(from, to));
      from = to;
    }
  }
  return count;
}

}  // namespace pounce::mesh
