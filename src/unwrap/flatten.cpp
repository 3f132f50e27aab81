// SPDX-License-Identifier: Apache-2.0
//
// First as angles want it (Levy et al., "Least Squares Conformal Maps", 2002), which unfolds what
// is steep and stretches what is far from the middle. Then lengths: in turns each triangle finds
// the rotation that brings its own shape nearest to where it lies, and all points move to where
// they fit these best, as far as no triangle comes to lie on its face. Both are sparse linear
// systems.
#include "unwrap/flatten.h"

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include "core/directions.h"

namespace pounce::unwrap {
namespace {

constexpr int kRounds = 12;
/// Of the longest edge, squared: what has less area is a sliver, whose angles mean nothing.
constexpr double kSliver = 1e-4;

double crossed(Vec2d a, Vec2d b) { return a.x * b.y - a.y * b.x; }
double dotted(Vec2d a, Vec2d b) { return a.x * b.x + a.y * b.y; }

/// A triangle's own shape: its corners in its plane, the first at 0, and for each edge (from corner
/// k to the next) the cotangent of the angle opposite to it.
struct Rest {
  std::array<Vec2d, 3> corners{};
  std::array<double, 3> weights{};
};

Rest rest_of(const Patch& patch, const Triangle& t) {
  const Vec3d one = patch.points[t[1]] - patch.points[t[0]],
              two = patch.points[t[2]] - patch.points[t[0]];
  Rest rest;
  const double first = length(one);
  if (!(first > 0)) return rest;
  const double along = dot(two, one) / first;
  const double height = length(cross(one, two)) / first;
  rest.corners = {Vec2d{0, 0}, Vec2d{first, 0}, Vec2d{along, height}};
  double longest = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec2d edge = rest.corners[(k + 1) % 3] - rest.corners[k];
    longest = std::max(longest, dotted(edge, edge));
  }
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec2d apex = rest.corners[(k + 2) % 3];
    const Vec2d a = rest.corners[k] - apex, b = rest.corners[(k + 1) % 3] - apex;
    rest.weights[k] = dotted(a, b) / std::max(std::abs(crossed(a, b)), kSliver * longest);
  }
  return rest;
}

class Layout {
 public:
  Layout(const Patch& patch, Vec3d axis, const std::function<void()>& poll)
      : patch_(patch), poll_(poll) {
    for (const Triangle& t : patch.triangles) rests_.push_back(rest_of(patch, t));
    const Vec3d right =
        unit_vector(cross(std::abs(axis.y) < 0.9 ? Vec3d{0, 1, 0} : Vec3d{1, 0, 0}, axis));
    const Vec3d up = cross(axis, right);
    for (const Vec3d p : patch.points) at_.push_back({dot(p, right), dot(p, up)});
  }

  std::vector<Vec2d> make() {
    const std::vector<Vec2d> seen = at_;
    unfold();
    untangle();
    const std::size_t left = on_faces();
    if (left > 0) {
      std::vector<Vec2d> unfolded = std::move(at_);
      at_ = seen;
      untangle();
      if (on_faces() >= left) at_ = std::move(unfolded);
    }
    relax();
    for (Vec2d& p : at_) p.y = -p.y;
    return std::move(at_);
  }

 private:
  double area_of(std::size_t t, const std::vector<Vec2d>& at) const {
    const Triangle& c = patch_.triangles[t];
    return crossed(at[c[1]] - at[c[0]], at[c[2]] - at[c[0]]);
  }
  double own_area(std::size_t t) const {
    return crossed(rests_[t].corners[1], rests_[t].corners[2]);
  }
  std::size_t on_faces() const {
    std::size_t count = 0;
    for (std::size_t t = 0; t < rests_.size(); ++t) count += is_on_face(t) ? 1 : 0;
    return count;
  }
  bool is_on_face(std::size_t t) const { return own_area(t) > 0 && !(area_of(t, at_) > 0); }

  /// Conformal, as far as it goes, with the two points that are farthest apart where they are.
  void unfold() {
    std::uint32_t one = 0, other = 0;
    const auto from = [&](std::uint32_t v) {
      std::uint32_t best = v;
      double most = -1;
      for (std::uint32_t i = 0; i < at_.size(); ++i) {
        const Vec3d apart = patch_.points[i] - patch_.points[v];
        if (dot(apart, apart) > most) most = dot(apart, apart), best = i;
      }
      return best;
    };
    one = from(0);
    other = from(one);
    if (one == other) return;
    // Numbers of the unknowns: twice the point's, less the pinned ones before it.
    const auto unknown = [&](std::uint32_t v) {
      return 2 * static_cast<int>(v - (v > one ? 1 : 0) - (v > other ? 1 : 0));
    };
    const auto is_pinned = [&](std::uint32_t v) { return v == one || v == other; };
    const auto count = 2 * (static_cast<Eigen::Index>(at_.size()) - 2);
    if (count == 0) return;
    std::vector<Eigen::Triplet<double>> entries;
    Eigen::VectorXd wanted = Eigen::VectorXd::Zero(count);
    double most = 0;
    for (std::size_t t = 0; t < rests_.size(); ++t) {
      const Triangle& c = patch_.triangles[t];
      const auto& q = rests_[t].corners;
      double longest = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        const Vec2d edge = q[(k + 1) % 3] - q[k];
        longest = std::max(longest, dotted(edge, edge));
      }
      if (!(longest > 0)) continue;
      const double weight = 1 / std::max(own_area(t), kSliver * longest);
      // An edge against the corner it faces: the sum of edge times corner, as complex numbers, is 0
      // where angles are kept.
      for (std::size_t i = 0; i < 3; ++i) {
        if (is_pinned(c[i])) continue;
        const Vec2d a = q[(i + 2) % 3] - q[(i + 1) % 3];
        for (std::size_t j = 0; j < 3; ++j) {
          const Vec2d b = q[(j + 2) % 3] - q[(j + 1) % 3];
          const double same = weight * dotted(a, b), turned = weight * crossed(a, b);
          const int row = unknown(c[i]);
          if (is_pinned(c[j])) {
            const Vec2d p = at_[c[j]];
            wanted[row] -= same * p.x - turned * p.y;
            wanted[row + 1] -= turned * p.x + same * p.y;
            continue;
          }
          const int column = unknown(c[j]);
          entries.emplace_back(row, column, same);
          entries.emplace_back(row, column + 1, -turned);
          entries.emplace_back(row + 1, column, turned);
          entries.emplace_back(row + 1, column + 1, same);
          most = std::max(most, std::abs(same));
        }
      }
    }
    const double hold = 1e-9 * most;  // what hangs by one point alone may turn
    for (std::uint32_t v = 0; v < at_.size(); ++v) {
      if (is_pinned(v)) continue;
      const int row = unknown(v);
      entries.emplace_back(row, row, hold);
      entries.emplace_back(row + 1, row + 1, hold);
      wanted[row] += hold * at_[v].x;
      wanted[row + 1] += hold * at_[v].y;
    }
    Eigen::SparseMatrix<double> matrix(count, count);
    matrix.setFromTriplets(entries.begin(), entries.end());
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(matrix);
    if (solver.info() != Eigen::Success) return;
    const Eigen::VectorXd found = solver.solve(wanted);
    if (!found.allFinite()) return;
    for (std::uint32_t v = 0; v < at_.size(); ++v) {
      if (!is_pinned(v)) at_[v] = {found[unknown(v)], found[unknown(v) + 1]};
    }
    // As large as it is.
    double in_space = 0, in_plane = 0;
    for (std::size_t t = 0; t < rests_.size(); ++t) {
      in_space += own_area(t);
      in_plane += std::abs(area_of(t, at_));
    }
    const double scale = in_plane > 0 ? std::sqrt(in_space / in_plane) : 1;
    for (Vec2d& p : at_) p = p * scale;
  }

  void relax() {
    const auto count = static_cast<Eigen::Index>(at_.size());
    std::vector<Eigen::Triplet<double>> entries;
    double most = 0;
    for (std::size_t t = 0; t < rests_.size(); ++t) {
      for (std::size_t k = 0; k < 3; ++k) {
        const int i = static_cast<int>(patch_.triangles[t][k]),
                  j = static_cast<int>(patch_.triangles[t][(k + 1) % 3]);
        const double w = rests_[t].weights[k];
        most = std::max(most, std::abs(w));
        for (const auto& [row, column, value] :
             {std::tuple(i, i, w), std::tuple(j, j, w), std::tuple(i, j, -w), std::tuple(j, i, -w)})
          entries.emplace_back(row, column, value);
      }
    }
    // A patch may lie anywhere: each point is held a little to where it was.
    const double hold = 1e-9 * most;
    for (int i = 0; i < count; ++i) entries.emplace_back(i, i, hold);
    Eigen::SparseMatrix<double> matrix(count, count);
    matrix.setFromTriplets(entries.begin(), entries.end());
    Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(matrix);
    if (solver.info() != Eigen::Success) return;
    Eigen::MatrixX2d wanted(count, 2);
    for (int round = 0; round < kRounds; ++round) {
      poll_();
      for (int i = 0; i < count; ++i) {
        const Vec2d& p = at_[static_cast<std::size_t>(i)];
        wanted.row(i) << hold * p.x, hold * p.y;
      }
      for (std::size_t t = 0; t < rests_.size(); ++t) add_turned(t, wanted);
      const Eigen::MatrixX2d found = solver.solve(wanted);
      if (!found.allFinite()) return;
      std::vector<Vec2d> to;
      for (int i = 0; i < count; ++i) to.push_back({found(i, 0), found(i, 1)});
      go(to);
    }
  }

  /// Points go there; those of triangles that would come to lie on their faces, or nearly, only
  /// part of the way, or none of it.
  void go(const std::vector<Vec2d>& to) {
    constexpr int kHalvings = 10;
    constexpr double kLeast = 0.2;  // of its own area
    std::vector<double> steps(at_.size(), 1);
    std::vector<Vec2d> moved = to;
    for (int round = 0; round <= kHalvings; ++round) {
      std::vector<char> is_blocked(at_.size(), 0);
      bool any = false;
      for (std::size_t t = 0; t < rests_.size(); ++t) {
        const double least = std::min(area_of(t, at_), kLeast * own_area(t));
        if (own_area(t) == 0 || area_of(t, moved) >= least) continue;
        any = true;
        for (const std::uint32_t v : patch_.triangles[t]) is_blocked[v] = 1;
      }
      if (!any) break;
      for (std::size_t v = 0; v < at_.size(); ++v) {
        if (is_blocked[v] == 0) continue;
        steps[v] = round == kHalvings ? 0 : steps[v] / 2;
        moved[v] = at_[v] + (to[v] - at_[v]) * steps[v];
      }
    }
    at_.swap(moved);
  }

  /// The triangle's own edges, turned as it lies now.
  void add_turned(std::size_t t, Eigen::MatrixX2d& wanted) const {
    const Rest& rest = rests_[t];
    const Triangle& corners = patch_.triangles[t];
    double cosine = 0, sine = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec2d own = rest.corners[(k + 1) % 3] - rest.corners[k];
      const Vec2d now = at_[corners[(k + 1) % 3]] - at_[corners[k]];
      cosine += rest.weights[k] * dotted(own, now);
      sine += rest.weights[k] * crossed(own, now);
    }
    const double size = std::sqrt(cosine * cosine + sine * sine);
    if (!(size > 0)) return;
    cosine /= size, sine /= size;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec2d own = rest.corners[(k + 1) % 3] - rest.corners[k];
      const Vec2d turned{cosine * own.x - sine * own.y, sine * own.x + cosine * own.y};
      const auto i = static_cast<Eigen::Index>(corners[k]),
                 j = static_cast<Eigen::Index>(corners[(k + 1) % 3]);
      const double w = rest.weights[k];
      wanted(i, 0) -= w * turned.x, wanted(i, 1) -= w * turned.y;
      wanted(j, 0) += w * turned.x, wanted(j, 1) += w * turned.y;
    }
  }

  /// Points of triangles that lie on their faces, and after a while those around them, go to the
  /// middle of their neighbours.
  void untangle() {
    constexpr int kMost = 40, kWider = 8;
    constexpr double kOnFace = 0.05;  // of its own area
    std::vector<std::vector<std::uint32_t>> rings(at_.size());
    std::vector<int> around(at_.size(), 0);  // edges that are gone along once only end there
    for (const Triangle& t : patch_.triangles) {
      for (std::size_t k = 0; k < 3; ++k) {
        rings[t[k]].push_back(t[(k + 1) % 3]);
        rings[t[(k + 1) % 3]].push_back(t[k]);
      }
    }
    for (std::size_t v = 0; v < rings.size(); ++v) {
      std::sort(rings[v].begin(), rings[v].end());
      for (std::size_t i = 0; i < rings[v].size(); ++i) {
        const bool is_inner = i + 1 < rings[v].size() && rings[v][i] == rings[v][i + 1];
        if (is_inner)
          ++i;
        else
          ++around[v];
      }
      rings[v].erase(std::unique(rings[v].begin(), rings[v].end()), rings[v].end());
    }
    std::vector<char> moves(at_.size());
    std::vector<Vec2d> best = at_;
    poll_();
    std::size_t least = rests_.size() + 1;
    for (int round = 0; round < kMost; ++round) {
      std::fill(moves.begin(), moves.end(), 0);
      std::size_t count = 0;
      for (std::size_t t = 0; t < rests_.size(); ++t) {
        if (area_of(t, at_) > kOnFace * own_area(t) || own_area(t) == 0) continue;
        ++count;
        for (const std::uint32_t v : patch_.triangles[t]) moves[v] = 1;
      }
      if (count < least) least = count, best = at_;
      if (count == 0) return;
      for (int wider = 0; wider < round / kWider; ++wider) {
        const std::vector<char> before = moves;
        for (std::size_t v = 0; v < rings.size(); ++v) {
          if (before[v] == 0) continue;
          for (const std::uint32_t n : rings[v]) moves[n] = 1;
        }
      }
      std::vector<Vec2d> moved = at_;
      for (std::size_t v = 0; v < rings.size(); ++v) {
        if (moves[v] == 0 || around[v] > 0) continue;
        Vec2d sum{};
        for (const std::uint32_t n : rings[v]) sum = sum + at_[n];
        moved[v] = sum * (1.0 / static_cast<double>(rings[v].size()));
      }
      put_borders(moves, around, moved);
      at_.swap(moved);
    }
    at_ = std::move(best);
  }

  /// A point of the border goes where its triangles would have it, given their other two points.
  void put_borders(const std::vector<char>& moves, const std::vector<int>& around,
                   std::vector<Vec2d>& moved) const {
    std::vector<Vec2d> sums(at_.size());
    std::vector<double> counts(at_.size());
    for (std::size_t t = 0; t < rests_.size(); ++t) {
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t v = patch_.triangles[t][k];
        if (moves[v] == 0 || around[v] == 0) continue;
        const auto& q = rests_[t].corners;
        const Vec2d own = q[(k + 2) % 3] - q[(k + 1) % 3], apex = q[k] - q[(k + 1) % 3];
        const double size = dotted(own, own);
        if (!(size > 0)) continue;
        const Vec2d from = at_[patch_.triangles[t][(k + 1) % 3]],
                    edge = at_[patch_.triangles[t][(k + 2) % 3]] - from;
        const double along = dotted(own, apex) / size, aside = crossed(own, apex) / size;
        sums[v] = sums[v] + from +
                  Vec2d{along * edge.x - aside * edge.y, along * edge.y + aside * edge.x};
        counts[v] += 1;
      }
    }
    for (std::size_t v = 0; v < at_.size(); ++v) {
      if (counts[v] > 0) moved[v] = sums[v] * (1 / counts[v]);
    }
  }

  const Patch& patch_;
  const std::function<void()>& poll_;
  std::vector<Rest> rests_;
  std::vector<Vec2d> at_;  ///< v upwards
};

}  // namespace

std::vector<Vec2d> lay_flat(const Patch& patch, Vec3d axis, const std::function<void()>& poll) {
  return Layout(patch, axis, poll).make();
}

double stretch_of(const Patch& patch, std::span<const Vec2d> flat, const Triangle& t) {
  const Rest rest = rest_of(patch, t);
  const Vec2d one = rest.corners[1], two = rest.corners[2];
  if (!(one.x > 0 && two.y > 0)) return 1;
  Vec2d a = flat[t[1]] - flat[t[0]], b = flat[t[2]] - flat[t[0]];
  a.y = -a.y, b.y = -b.y;  // v upwards
  if (!(crossed(a, b) > 0)) return std::numeric_limits<double>::infinity();
  // The map's columns, and its singular values.
  const Vec2d x = a * (1 / one.x), y = (b - x * two.x) * (1 / two.y);
  const double e = dotted(x, x), f = dotted(x, y), g = dotted(y, y);
  const double apart = std::sqrt((e - g) * (e - g) + 4 * f * f);
  const double large = std::sqrt((e + g + apart) / 2);
  const double area = crossed(x, y);
  return std::max(large, large / area);  // the small one is area / large
}

}  // namespace pounce::unwrap
