// SPDX-License-Identifier: Apache-2.0
//
// One pass over the triangles, whatever their number: the places' segments lie in a lattice of
// cells, and a triangle looks at those whose cells its box touches.
//
// The usual way round, a tree over the triangles that each place asks, would need memory in
// proportion to the mesh. The places are few, so their lattice is small, and the mesh is only read
// through once.
#include "surface/layers.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "core/bounds.h"

namespace pounce::surface {
namespace {

constexpr int kCells = 24;  // along the longest side

/// Segments along places' normals, by cell.
class Segments {
 public:
  Segments(std::span<const Place> places, float most) : places_(places), most_(most) {
    for (const Place& place : places) bounds_.extend(place.position);
    const Vec3f size = bounds_.hi - bounds_.lo;
    // Segments reach beyond the places themselves, by `most` at both ends.
    const float longest = std::max({size.x, size.y, size.z}) + 2 * most;
    per_cell_ = longest > 0 ? kCells / longest : 0;
    cells_.resize(std::size_t{kCells} * kCells * kCells);
    for (std::uint32_t i = 0; i < places.size(); ++i) {
      Box3f box;
      box.extend(places[i].position - places[i].normal * most);
      box.extend(places[i].position + places[i].normal * most);
      for_each_cell(box, [&](std::vector<std::uint32_t>& cell) { cell.push_back(i); });
    }
    seen_.assign(places.size(), 0);
  }

  /// Calls `visit` once with each segment that may meet the box.
  template <class Visit>
  void for_each_near(const Box3f& box, const Visit& visit) {
    // A segment is in all cells that its box touches, and a triangle may look at several of them.
    // The round tells what was visited without anything to clear between triangles.
    ++round_;
    for_each_cell(box, [&](std::vector<std::uint32_t>& cell) {
      for (const std::uint32_t i : cell) {
        if (seen_[i] == round_) continue;
        seen_[i] = round_;
        visit(i);
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
          visit(cells_[static_cast<std::size_t>((z * kCells + y) * kCells + x)]);
      }
    }
  }

  std::span<const Place> places_;
  const float most_;
  Box3f bounds_;
  float per_cell_ = 0;
  std::vector<std::vector<std::uint32_t>> cells_;
  std::vector<std::uint64_t> seen_;  ///< in which round
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
  if (places.empty() || !(most > 0)) return gaps;
  const double own = 1e-6 * double{most};
  Segments segments(places, most);
  for (const auto& corners : mesh.triangles) {
    Box3f box;
    for (const std::uint32_t c : corners) box.extend(mesh.positions[c]);
    const Facet facet(mesh, corners);
    segments.for_each_near(box, [&](std::uint32_t i) {
      const Vec3d normal(places[i].normal);
      if (dot(facet.normal, normal) < double{least_cosine}) return;
      // A line that misses gives no number, and no comparison below is true of that.
      const double gap = std::abs(facet.along(Vec3d(places[i].position), normal));
      if (gap > own && gap <= double{most} && gap < double{gaps[i]})
        gaps[i] = static_cast<float>(gap);
    });
  }
  return gaps;
}

}  // namespace pounce::surface
