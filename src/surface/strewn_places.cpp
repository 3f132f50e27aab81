// SPDX-License-Identifier: Apache-2.0
//
// Places on a surface without its texels: whether source and target are aligned, and how close
// layers are, is measured there.
//
// Place i is on the triangle in which the running sum of areas, in file order, passes i + 1/2
// shares. So a large triangle gets many places and a dense region of small ones no more than its
// area's worth, unlike vertices or triangle centres. There is no random number in it: the same mesh
// gives the same places, and a report the same figures.
#include "surface/strewn_places.h"

#include <algorithm>
#include <cmath>

namespace pounce::surface {
namespace {

/// A triangle's corner and sides in doubles: areas add up to the same sum everywhere.
struct Triangle {
  Vec3d corner, to_second, to_third, across;
  double area = 0;

  Triangle(const mesh::Mesh& mesh, const std::array<std::uint32_t, 3>& corners)
      : corner(mesh.positions[corners[0]]),
        to_second(Vec3d(mesh.positions[corners[1]]) - corner),
        to_third(Vec3d(mesh.positions[corners[2]]) - corner),
        across(cross(to_second, to_third)),
        area(length(across) / 2) {
    if (!std::isfinite(area)) area = 0;
  }
};

/// The i-th point of a sequence that fills a triangle evenly (Roberts' R2, its square folded).
Vec2d spread_point(std::size_t i) {
  constexpr double kU = 0.7548776662466927, kV = 0.5698402909980532;
  const double n = static_cast<double>(i) + 1;
  double u = n * kU - std::floor(n * kU), v = n * kV - std::floor(n * kV);
  if (u + v > 1) u = 1 - u, v = 1 - v;
  return {u, v};
}

Place place_on(const mesh::Mesh& mesh, const std::array<std::uint32_t, 3>& corners,
               const Triangle& t, Vec2d at) {
  Vec3d shown;
  for (const std::uint32_t c : corners) shown = shown + Vec3d(mesh.normals[c]);
  const double scale = (dot(shown, t.across) < 0 ? -1 : 1) / (2 * t.area);
  return {Vec3f(t.corner + t.to_second * at.x + t.to_third * at.y), Vec3f(t.across * scale)};
}

}  // namespace

double surface_area(const mesh::Mesh& mesh) {
  double area = 0;
  for (const auto& corners : mesh.triangles) area += Triangle(mesh, corners).area;
  return area;
}

std::vector<Place> strew(const mesh::Mesh& mesh, std::size_t count) {
  // A sum that is not finite comes from broken positions; then there are no places to judge by.
  const double all = surface_area(mesh);
  std::vector<Place> places;
  if (!(all > 0) || !std::isfinite(all)) return places;
  places.reserve(count);
  const double share = all / static_cast<double>(count);
  double until = 0;
  for (const auto& corners : mesh.triangles) {
    // The same sum in the same order as in surface_area(): it ends at exactly `all`, so the last
    // place finds its triangle, too.
    const Triangle triangle(mesh, corners);
    until += triangle.area;
    for (std::size_t i = places.size(); i < count && (static_cast<double>(i) + 0.5) * share < until;
         ++i)
      places.push_back(place_on(mesh, corners, triangle, spread_point(i)));
  }
  return places;
}

void make_packets(std::span<const Place> places, float edge, PageVector<TexelPacket>& packets,
                  std::vector<PacketGroup>& groups) {
  // One lane of sixteen is used. Places are far apart, so a packet of several would have a bundle
  // as wide as the mesh and every patch for a candidate.
  packets.reserve(packets.size() + places.size());
  groups.reserve(groups.size() + places.size());
  for (std::size_t i = 0; i < places.size(); ++i) {
    groups.push_back({static_cast<std::uint32_t>(packets.size()), 1});
    TexelPacket& packet = packets.emplace_back();
    const auto& [position, normal] = places[i];
    std::fill_n(packet.px, kLanes, position.x);
    std::fill_n(packet.py, kLanes, position.y);
    std::fill_n(packet.pz, kLanes, position.z);
    std::fill_n(packet.per_texel, kLanes, 1 / edge);
    std::fill_n(packet.texel, kLanes, kNoTexel);
    packet.nx[0] = normal.x;
    packet.ny[0] = normal.y;
    packet.nz[0] = normal.z;
    packet.texel[0] = 0;
    packet.block = static_cast<std::uint32_t>(i);
  }
}

}  // namespace pounce::surface
