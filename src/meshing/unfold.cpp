// SPDX-License-Identifier: Apache-2.0
#include "meshing/unfold.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <numeric>
#include <utility>
#include <vector>

#include "core/directions.h"

namespace pounce::meshing {
namespace {

constexpr int kRounds = 10;

/// The triangles of each vertex, one list after the other.
struct Fans {
  std::vector<std::uint32_t> first, triangles;

  explicit Fans(const Surface& surface) : first(surface.positions.size() + 1) {
    for (const Triangle& t : surface.triangles) {
      for (const std::uint32_t v : t) ++first[v + 1];
    }
    std::partial_sum(first.begin(), first.end(), first.begin());
    triangles.resize(3 * surface.triangles.size());
    std::vector<std::uint32_t> next(first.begin(), first.end() - 1);
    for (std::uint32_t t = 0; t < surface.triangles.size(); ++t) {
      for (const std::uint32_t v : surface.triangles[t]) triangles[next[v]++] = t;
    }
  }
};

class Folds {
 public:
  Folds(Surface& surface, double least) : surface_(surface), folded_(least), fans_(surface) {}

  /// Were there any that could be helped?
  bool round() {
    look_around();
    bool any = false;
    for (std::uint32_t v = 0; v < surface_.positions.size(); ++v) any = help(v) || any;
    return any;
  }

 private:
  /// Which way the surface faces around each triangle: a fan's area as a vector does not depend on
  /// where its middle is, as long as its border stays.
  void look_around() {
    std::vector<Vec3d> fans(surface_.positions.size());
    for (const Triangle& t : surface_.triangles) {
      const Vec3d own = area_vector(surface_.positions, t);
      for (const std::uint32_t v : t) fans[v] = fans[v] + own;
    }
    around_.clear();
    for (const Triangle& t : surface_.triangles) {
      const Vec3d sum = fans[t[0]] + fans[t[1]] + fans[t[2]];
      around_.push_back(length(sum) > 0 ? unit_vector(sum) : Vec3d{});
    }
  }
  /// The least cosine between a triangle of the fan and what is around it.
  double worst(std::uint32_t vertex) const {
    double least = 1;
    for (std::uint32_t i = fans_.first[vertex]; i < fans_.first[vertex + 1]; ++i) {
      const std::uint32_t t = fans_.triangles[i];
      const Vec3d own = area_vector(surface_.positions, surface_.triangles[t]);
      const double area = length(own);
      least = std::min(least, area > 0 ? dot(own, around_[t]) / area : 0);
    }
    return least;
  }
  bool help(std::uint32_t vertex) {
    double least = worst(vertex);
    if (least >= folded_) return false;
    Vec3d sum, facing;
    double weights = 0;
    std::size_t ends = 0, begins = 0;  // sums that differ where the fan is open
    for (std::uint32_t i = fans_.first[vertex]; i < fans_.first[vertex + 1]; ++i) {
      const std::uint32_t t = fans_.triangles[i];
      const Triangle& corners = surface_.triangles[t];
      const auto at = static_cast<std::size_t>(std::find(corners.begin(), corners.end(), vertex) -
                                               corners.begin());
      const std::uint32_t a = corners[(at + 1) % 3], b = corners[(at + 2) % 3];
      sum = sum + Vec3d(surface_.positions[a]) + Vec3d(surface_.positions[b]);
      begins += a;
      ends += b;
      weights += 2;
      facing = facing + around_[t];
    }
    if (begins != ends || !(length(facing) > 0)) return false;
    const Vec3f before = surface_.positions[vertex];
    Vec3f best = before;
    const Vec3d way = sum * (1 / weights) - Vec3d(before), up = unit_vector(facing);
    const Vec3d along = way - up * dot(way, up);
    for (const Vec3d& move : {along, along * 0.5, way, along * 1.5}) {
      surface_.positions[vertex] = Vec3f(Vec3d(before) + move);
      const double now = worst(vertex);
      if (!(now > least)) continue;
      least = now;
      best = surface_.positions[vertex];
    }
    surface_.positions[vertex] = best;
    return !(best == before);
  }

  Surface& surface_;
  const double folded_;
  const Fans fans_;
  std::vector<Vec3d> around_;  ///< by triangle
};

}  // namespace

void unfold(Surface& surface, double least) {
  Folds folds(surface, least);
  for (int round = 0; round < kRounds && folds.round(); ++round) {
  }
}

}  // namespace pounce::meshing
