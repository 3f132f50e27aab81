// SPDX-License-Identifier: Apache-2.0
//
// Points of a cloud as discs.
//
// Neighbours are sought within a block alone, as for statistics (gaussian/splat_statistics.cpp): no
// search structure over the cloud is needed, so a cloud of any size passes through block by block.
// What that costs at a block's border is a neighbour on its other side. The plane is hardly another
// one without it, and the spacing is corrected: of points that fill half of a disc around one, the
// mean lies 4 r / (3 pi) from it.
//
// The search is a k-d tree in an array, split at the median of the longest side. All is plain
// arithmetic in a fixed order, so a disc depends on its block alone.
#include "gaussian/point_discs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "core/bounds.h"
#include "core/directions.h"
#include "core/vec.h"
#include "gaussian/splat_statistics.h"

namespace pounce::gaussian {
namespace {

constexpr std::size_t kNeighbours = 12;
constexpr std::size_t kLeaf = 12;
constexpr float kLargestOverMedian = 4;

struct Neighbour {
  float squared = std::numeric_limits<float>::infinity();
  std::uint32_t index = std::numeric_limits<std::uint32_t>::max();
  bool operator<(const Neighbour& other) const {
    return squared < other.squared || (squared == other.squared && index < other.index);
  }
};

/// The nearest of the points, in order of distance.
struct Nearest {
  std::array<Neighbour, kNeighbours> found;
  std::size_t count = 0;

  void add(const Neighbour& next) {
    if (count == kNeighbours && !(next < found.back())) return;
    std::size_t at = count < kNeighbours ? count++ : kNeighbours - 1;
    for (; at > 0 && next < found[at - 1]; --at) found[at] = found[at - 1];
    found[at] = next;
  }
  float farthest() const {
    return count < kNeighbours ? std::numeric_limits<float>::infinity() : found.back().squared;
  }
  std::span<const Neighbour> all() const { return std::span(found).first(count); }
};

class PointTree {
 public:
  explicit PointTree(std::span<const store::Splat> block) {
    points_.reserve(block.size());
    for (std::size_t i = 0; i < block.size(); ++i)
      points_.push_back({block[i].mean, static_cast<std::uint32_t>(i)});
    axes_.resize(points_.size());
    split(0, points_.size());
  }
  /// Of the point of that number, but for itself.
  Nearest nearest(Vec3f at, std::uint32_t self) const {
    Nearest found;
    search(0, points_.size(), at, self, found);
    return found;
  }

 private:
  struct Point {
    Vec3f at;
    std::uint32_t index;
  };
  static float along(Vec3f v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

  void split(std::size_t begin, std::size_t end) {
    if (end - begin <= kLeaf) return;
    Box3f box;
    for (std::size_t i = begin; i < end; ++i) box.extend(points_[i].at);
    const Vec3f size = box.hi - box.lo;
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const std::size_t middle = begin + (end - begin) / 2;
    const auto place = [&](std::size_t i) {
      return points_.begin() + static_cast<std::ptrdiff_t>(i);
    };
    std::nth_element(place(begin), place(middle), place(end),
                     [axis](const Point& a, const Point& b) {
                       const float one = along(a.at, axis), other = along(b.at, axis);
                       return one < other || (one == other && a.index < b.index);
                     });
    axes_[middle] = static_cast<std::int8_t>(axis);
    split(begin, middle);
    split(middle + 1, end);
  }

  void search(std::size_t begin, std::size_t end, Vec3f at, std::uint32_t self,
              Nearest& found) const {
    if (found.farthest() == 0) return;  // a dozen in one place: no other can be nearer
    const auto visit = [&](const Point& p) {
      const Vec3f d = p.at - at;
      if (p.index != self) found.add({dot(d, d), p.index});
    };
    if (end - begin <= kLeaf) {
      for (std::size_t i = begin; i < end; ++i) visit(points_[i]);
      return;
    }
    const std::size_t middle = begin + (end - begin) / 2;
    const int axis = axes_[middle];
    const float beyond = along(at, axis) - along(points_[middle].at, axis);
    const auto low = std::pair(begin, middle), high = std::pair(middle + 1, end);
    const auto& [own, other] = beyond < 0 ? std::pair(low, high) : std::pair(high, low);
    search(own.first, own.second, at, self, found);
    visit(points_[middle]);
    // One that is as far as the farthest may still have a lower number.
    if (beyond * beyond <= found.farthest()) search(other.first, other.second, at, self, found);
  }

  std::vector<Point> points_;  ///< in the order of the tree
  std::vector<std::int8_t> axes_;
};

/// The direction in which these points spread least, by Jacobi rotations of their covariance; of
/// directions that are equal one of them.
Vec3d thinnest(std::span<const Neighbour> neighbours, std::span<const store::Splat> block,
               Vec3f own) {
  std::array<Vec3d, kNeighbours + 1> points{};
  Vec3d mean{};
  for (std::size_t i = 0; i < neighbours.size(); ++i) {
    points[i] = Vec3d(block[neighbours[i].index].mean - own);
    mean = mean + points[i];
  }
  const std::size_t count = neighbours.size() + 1;  // and itself, at 0
  mean = mean * (1.0 / static_cast<double>(count));
  double m[3][3] = {};
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3d d = points[i] - mean;
    const double v[3] = {d.x, d.y, d.z};
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) m[r][c] += v[r] * v[c];
    }
  }
  double axes[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};  // columns
  constexpr int kSweeps = 8;                              // quadratic: 4 or 5 are usual
  constexpr std::array<std::pair<int, int>, 3> kPairs{{{0, 1}, {0, 2}, {1, 2}}};
  constexpr double kSmall = 1e-7;  // of what is beside the diagonal: the error of the angle
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    const double rest = std::abs(m[0][1]) + std::abs(m[0][2]) + std::abs(m[1][2]);
    if (rest <= kSmall * (m[0][0] + m[1][1] + m[2][2])) break;
    for (const auto& [p, q] : kPairs) {
      if (m[p][q] == 0) continue;
      const double zeta = (m[q][q] - m[p][p]) / (2 * m[p][q]);
      const double t = (zeta < 0 ? -1.0 : 1.0) / (std::abs(zeta) + std::sqrt(1 + zeta * zeta));
      const double c = 1 / std::sqrt(1 + t * t), s = c * t;
      for (int k = 0; k < 3; ++k) {  // columns, then rows
        const double at_p = m[k][p], at_q = m[k][q];
        m[k][p] = c * at_p - s * at_q;
        m[k][q] = s * at_p + c * at_q;
      }
      for (int k = 0; k < 3; ++k) {
        const double at_p = m[p][k], at_q = m[q][k];
        m[p][k] = c * at_p - s * at_q;
        m[q][k] = s * at_p + c * at_q;
        const double of_p = axes[k][p], of_q = axes[k][q];
        axes[k][p] = c * of_p - s * of_q;
        axes[k][q] = s * of_p + c * of_q;
      }
    }
  }
  const int least = m[0][0] <= m[1][1] && m[0][0] <= m[2][2] ? 0 : m[1][1] <= m[2][2] ? 1 : 2;
  return {axes[0][least], axes[1][least], axes[2][least]};
}

/// A rotation whose third axis that is.
std::array<float, 4> across(Vec3d normal) {
  const Vec3d third = unit_vector(normal);
  const Vec3d other = std::abs(third.x) < 0.6 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  const Vec3d first = unit_vector(cross(other, third));
  const auto q = quaternion_of({first, cross(third, first), third});
  return {static_cast<float>(q[0]), static_cast<float>(q[1]), static_cast<float>(q[2]),
          static_cast<float>(q[3])};
}

/// Of points on a plane around one, the farthest of which is `radius` away.
float spacing(std::span<const Neighbour> neighbours, std::span<const store::Splat> block,
              Vec3f own) {
  const float radius = std::sqrt(neighbours.back().squared);
  if (radius == 0) return 0;
  Vec3f mean{};
  for (const Neighbour& n : neighbours) mean = mean + (block[n.index].mean - own);
  const auto count = static_cast<float>(neighbours.size());
  const float aside = std::sqrt(dot(mean, mean)) / (count * radius);
  // All of the disc where the mean is about its middle, half of it where it is that of a half.
  constexpr float kChance = 0.2F, kOfHalf = 4 / (3 * std::numbers::pi_v<float>);
  const float part = std::clamp(1 - 0.5F * (aside - kChance) / (kOfHalf - kChance), 0.25F, 1.0F);
  return radius * std::sqrt(std::numbers::pi_v<float> * part / count);
}

}  // namespace

void make_discs(std::span<store::Splat> block) {
  constexpr std::size_t kLeast = 3;
  if (block.size() < kLeast) return;
  const PointTree tree(block);
  std::vector<float> spacings(block.size());
  for (std::size_t i = 0; i < block.size(); ++i) {
    store::Splat& point = block[i];
    const Nearest nearest = tree.nearest(point.mean, static_cast<std::uint32_t>(i));
    spacings[i] = spacing(nearest.all(), block, point.mean);
    point.rotation = across(point.normal != Vec3f{} ? Vec3d(point.normal)
                                                    : thinnest(nearest.all(), block, point.mean));
  }
  std::vector<float> ordered = spacings;
  const float usual = median(ordered);
  if (usual == 0) return;
  for (std::size_t i = 0; i < block.size(); ++i) {
    // Where a dozen points coincide the one has the size of the others.
    const float own = spacings[i] > 0 ? std::min(spacings[i], kLargestOverMedian * usual) : usual;
    const float sigma = own * kDiscOverSpacing;
    block[i].sigma = {sigma, sigma, 0};
    store::round_for_store(block[i]);
  }
}

}  // namespace pounce::gaussian
