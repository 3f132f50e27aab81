// SPDX-License-Identifier: Apache-2.0
#include "meshing/wedges.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <tuple>

namespace pounce::meshing {
namespace {

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

/// The numbers of things by which of them are equal, from 0 in the order of `key`.
template <class Key>
std::vector<std::uint32_t> equal_ones(std::size_t count, const Key& key) {
  std::vector<std::uint32_t> order(count), number(count);
  std::iota(order.begin(), order.end(), 0U);
  std::sort(order.begin(), order.end(),
            [&](std::uint32_t a, std::uint32_t b) { return key(a) < key(b); });
  for (std::size_t i = 1; i < count; ++i)
    number[order[i]] = number[order[i - 1]] + (key(order[i - 1]) < key(order[i]) ? 1 : 0);
  return number;
}

}  // namespace

WedgeSurface joined(std::span<const Vec3f> positions, std::span<const Triangle> triangles,
                    std::span<const std::array<Vec2f, 3>> uvs,
                    std::span<const std::uint32_t> materials) {
  const auto place = equal_ones(positions.size(), [&](std::uint32_t v) {
    return std::tuple(positions[v].x, positions[v].y, positions[v].z);
  });
  const auto wedge = equal_ones(3 * triangles.size(), [&](std::uint32_t corner) {
    const std::uint32_t t = corner / 3, k = corner % 3;
    return std::tuple(place[triangles[t][k]], materials[t], uvs[t][k].x, uvs[t][k].y);
  });
  WedgeSurface made;
  made.places.resize(positions.size());
  for (std::size_t v = 0; v < positions.size(); ++v) made.places[place[v]] = positions[v];
  made.wedges.resize(3 * triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    Triangle own{};
    std::array<std::uint32_t, 3> at{};
    for (std::size_t k = 0; k < 3; ++k) {
      own[k] = wedge[3 * t + k];
      at[k] = place[triangles[t][k]];
      made.wedges[own[k]] = {at[k], materials[t], uvs[t][k]};
    }
    if (at[0] != at[1] && at[1] != at[2] && at[2] != at[0]) made.triangles.push_back(own);
  }
  drop_unused(made);
  return made;
}

Surface welded(const WedgeSurface& surface) {
  Surface made;
  made.positions = surface.places;
  made.triangles.reserve(surface.triangles.size());
  for (const Triangle& t : surface.triangles) {
    made.triangles.push_back(
        {surface.wedges[t[0]].place, surface.wedges[t[1]].place, surface.wedges[t[2]].place});
  }
  return made;
}

void drop_unused(WedgeSurface& surface) {
  std::vector<std::uint32_t> wedge_number(surface.wedges.size(), kNone),
      place_number(surface.places.size(), kNone);
  std::vector<Wedge> wedges;
  std::vector<Vec3f> places;
  for (Triangle& t : surface.triangles) {
    for (std::uint32_t& w : t) {
      if (wedge_number[w] == kNone) {
        Wedge own = surface.wedges[w];
        std::uint32_t& place = place_number[own.place];
        if (place == kNone) {
          place = static_cast<std::uint32_t>(places.size());
          places.push_back(surface.places[own.place]);
        }
        own.place = place;
        wedge_number[w] = static_cast<std::uint32_t>(wedges.size());
        wedges.push_back(own);
      }
      w = wedge_number[w];
    }
  }
  surface.wedges = std::move(wedges);
  surface.places = std::move(places);
}

std::array<Vec2f, 3> uvs_of(const WedgeSurface& surface, const Triangle& t) {
  return {surface.wedges[t[0]].uv, surface.wedges[t[1]].uv, surface.wedges[t[2]].uv};
}

double turn_of(const std::array<Vec2f, 3>& uvs) {
  // Differences of floats are exact enough in double for a sign that means something.
  const Vec2d a{uvs[0].x, uvs[0].y}, b{uvs[1].x, uvs[1].y}, c{uvs[2].x, uvs[2].y};
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

}  // namespace pounce::meshing
