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
#include <cstdint>
#include <limits>
#include <optional>

#include "core/bounds.h"

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

double surface_area(const mesh::Mesh& mesh, std::span<const std::uint32_t> triangles) {
  double area = 0;
  for (const std::uint32_t triangle : triangles)
    area += Triangle(mesh, mesh.triangles[triangle]).area;
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

// --- layers --------------------------------------------------------------------------------------
//
// One pass over the triangles, whatever their number: the places' segments lie in a lattice of
// cells, and a triangle looks at those whose cells its box touches.
//
// The usual way round, a tree over the triangles that each place asks, would need memory in
// proportion to the mesh. The places are few, so their lattice is small, and the mesh is only read
// through once.

namespace {

constexpr int kCells = 24;  // along the longest side

float largest_coordinate(const Box3f& box) {
  return std::max({std::abs(box.lo.x), std::abs(box.lo.y), std::abs(box.lo.z), std::abs(box.hi.x),
                   std::abs(box.hi.y), std::abs(box.hi.z)});
}

/// Segments along places' normals, by cell.
class Segments {
 public:
  Segments(std::span<const Place> places, float most) : most_(most) {
    for (const Place& place : places) bounds_.extend(place.position);
    const Vec3f size = bounds_.hi - bounds_.lo;
    // Segments reach beyond the places themselves, by `most` at both ends.
    const float longest = std::max({size.x, size.y, size.z}) + 2 * most;
    per_cell_ = longest > 0 ? kCells / longest : 0;
    boxes_.reserve(places.size());
    for (const Place& place : places) {
      Box3f& box = boxes_.emplace_back();
      box.extend(place.position - place.normal * most);
      box.extend(place.position + place.normal * most);
    }
    // First how many each cell has, then what: places of a cell lie side by side.
    first_.resize(std::size_t{kCells} * kCells * kCells + 1);
    for (const Box3f& box : boxes_) for_each_cell(box, [&](std::size_t c) { ++first_[c + 1]; });
    for (std::size_t c = 1; c < first_.size(); ++c) first_[c] += first_[c - 1];
    in_cell_.resize(first_.back());
    std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
    for (std::uint32_t i = 0; i < boxes_.size(); ++i)
      for_each_cell(boxes_[i], [&](std::size_t c) { in_cell_[next[c]++] = i; });
    // What meets a triangle lies in its box and in the segment's, within rounding.
    const float rounding = kRounding * (most + largest_coordinate(bounds_));
    for (Box3f& box : boxes_) box = box.grown(rounding);
    seen_.assign(places.size(), 0);
  }

  /// Calls `visit` once with each segment that may meet what is in the box.
  template <class Visit>
  void for_each_near(const Box3f& box, const Visit& visit) {
    // A segment is in all cells that its box touches, and a triangle may look at several of them.
    // The round tells what was visited without anything to clear between triangles.
    ++round_;
    for_each_cell(box, [&](std::size_t cell) {
      for (std::uint32_t k = first_[cell]; k < first_[cell + 1]; ++k) {
        const std::uint32_t i = in_cell_[k];
        if (seen_[i] == round_) continue;
        seen_[i] = round_;
        if (boxes_[i].overlaps(box)) visit(i);
      }
    });
  }

 private:
  int cell_of(float at, float least) const {
    return static_cast<int>(std::clamp((at - least + most_) * per_cell_, 0.0F, kCells - 1.0F));
  }
  bool is_outside(const Box3f& box) const {
    return box.lo.x > bounds_.hi.x + most_ || box.hi.x < bounds_.lo.x - most_ ||
           box.lo.y > bounds_.hi.y + most_ || box.hi.y < bounds_.lo.y - most_ ||
           box.lo.z > bounds_.hi.z + most_ || box.hi.z < bounds_.lo.z - most_;
  }
  template <class Visit>
  void for_each_cell(const Box3f& box, const Visit& visit) {
    if (is_outside(box)) return;
    const int x0 = cell_of(box.lo.x, bounds_.lo.x), x1 = cell_of(box.hi.x, bounds_.lo.x);
    const int y0 = cell_of(box.lo.y, bounds_.lo.y), y1 = cell_of(box.hi.y, bounds_.lo.y);
    const int z0 = cell_of(box.lo.z, bounds_.lo.z), z1 = cell_of(box.hi.z, bounds_.lo.z);
    for (int z = z0; z <= z1; ++z) {
      for (int y = y0; y <= y1; ++y) {
        for (int x = x0; x <= x1; ++x)
          visit(static_cast<std::size_t>((z * kCells + y) * kCells + x));
      }
    }
  }

  static constexpr float kRounding = 1e-6F;  ///< as a share: several roundings of a float

  const float most_;
  Box3f bounds_;
  float per_cell_ = 0;
  std::vector<Box3f> boxes_;            ///< of segments
  std::vector<std::uint32_t> first_;    ///< by cell: of in_cell_; one more than cells
  std::vector<std::uint32_t> in_cell_;  ///< segments
  std::vector<std::uint64_t> seen_;     ///< in which round
  std::uint64_t round_ = 0;
};

struct Facet {
  Vec3d corner, to_second, to_third;
  Vec3d normal;  ///< of unit length, on the side that the vertices' normals show

  Facet(const mesh::Mesh& mesh, const std::array<std::uint32_t, 3>& corners)
      : corner(mesh.positions[corners[0]]),
        to_second(Vec3d(mesh.positions[corners[1]]) - corner),
        to_third(Vec3d(mesh.positions[corners[2]]) - corner),
        normal(cross(to_second, to_third)) {
    Vec3d shown;
    for (const std::uint32_t c : corners) shown = shown + Vec3d(mesh.normals[c]);
    const double size = length(normal);
    normal = size > 0 ? normal * ((dot(shown, normal) < 0 ? -1 : 1) / size) : Vec3d{};
  }

  /// How far along the direction the line meets it (Möller and Trumbore); no number if it does not.
  double along(Vec3d from, Vec3d direction) const {
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    const Vec3d p = cross(direction, to_third);
    const double determinant = dot(to_second, p);
    if (determinant == 0) return kNone;
    const Vec3d s = from - corner, q = cross(s, to_second);
    const double u = dot(s, p) / determinant, v = dot(direction, q) / determinant;
    return u >= 0 && v >= 0 && u + v <= 1 ? dot(to_third, q) / determinant : kNone;
  }
};

}  // namespace

std::vector<float> layer_gaps(const mesh::Mesh& mesh, std::span<const Place> places,
                              float least_cosine, float most) {
  std::vector<float> gaps(places.size(), std::numeric_limits<float>::infinity());
  if (places.empty() || !(most > 0) || !std::isfinite(most)) return gaps;
  const double own = 1e-6 * double{most};
  Segments segments(places, most);
  for (const auto& corners : mesh.triangles) {
    Box3f box;
    for (const std::uint32_t c : corners) box.extend(mesh.positions[c]);
    std::optional<Facet> facet;  // of the few that are near a segment
    segments.for_each_near(box, [&](std::uint32_t i) {
      if (!facet) facet.emplace(mesh, corners);
      const Vec3d normal(places[i].normal);
      if (dot(facet->normal, normal) < double{least_cosine}) return;
      // A line that misses gives no number, and no comparison below is true of that.
      const double gap = std::abs(facet->along(Vec3d(places[i].position), normal));
      if (gap > own && gap <= double{most} && gap < double{gaps[i]})
        gaps[i] = static_cast<float>(gap);
    });
  }
  return gaps;
}

}  // namespace pounce::surface
