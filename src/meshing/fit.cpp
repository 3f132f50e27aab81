// SPDX-License-Identifier: Apache-2.0
#include "meshing/fit.h"

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "core/directions.h"
#include "meshing/nearest.h"

namespace pounce::meshing {
namespace {

/// Of the weight of the dense surface that a vertex has on average: how much it is held where it
/// is.
constexpr double kHold = 0.05;

/// Which vertices lie on an edge that does not have one triangle on either side.
std::vector<char> border_of(const Surface& surface) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
  for (const Triangle& t : surface.triangles) {
    for (std::size_t k = 0; k < 3; ++k) edges.push_back(std::minmax(t[k], t[(k + 1) % 3]));
  }
  std::sort(edges.begin(), edges.end());
  std::vector<char> is_border(surface.positions.size(), 0);
  for (std::size_t first = 0, end = 0; first < edges.size(); first = end) {
    while (end < edges.size() && edges[end] == edges[first]) ++end;
    if (end - first != 2) is_border[edges[first].first] = is_border[edges[first].second] = 1;
  }
  return is_border;
}

/// The vertices of the dense surface and the middles of its triangles, with the areas that they
/// stand for.
struct Samples {
  std::vector<Vec3d> places, normals;
  std::vector<double> weights;

  explicit Samples(const Surface& dense) {
    std::vector<Vec3d> sums(dense.positions.size());
    std::vector<double> areas(dense.positions.size());
    for (const Triangle& t : dense.triangles) {
      const Vec3d own = area_vector(dense.positions, t);
      for (const std::uint32_t v : t) {
        sums[v] = sums[v] + own;
        areas[v] += length(own);
      }
    }
    for (std::size_t v = 0; v < sums.size(); ++v) {
      if (!(length(sums[v]) > 0)) continue;
      places.emplace_back(dense.positions[v]);
      normals.push_back(unit_vector(sums[v]));
      weights.push_back(areas[v]);
    }
    for (const Triangle& t : dense.triangles) {
      const Vec3d own = area_vector(dense.positions, t);
      if (!(length(own) > 0)) continue;
      places.push_back((Vec3d(dense.positions[t[0]]) + Vec3d(dense.positions[t[1]]) +
                        Vec3d(dense.positions[t[2]])) *
                       (1.0 / 3));
      normals.push_back(unit_vector(own));
      weights.push_back(3 * length(own));
    }
  }
};

/// One step: where the vertices would be best, the feet of the samples given.
std::vector<Vec3f> best_places(const Surface& surface, const Samples& samples,
                               const std::vector<char>& is_fixed,
                               const std::function<void()>& poll) {
  const Nearest nearest(surface);
  // Of each triangle, over the samples whose feet it has: products of corners' shares, and of
  // shares with places.
  struct Sums {
    std::array<std::array<double, 3>, 3> shares{};
    std::array<Vec3d, 3> places{};
  };
  std::vector<Sums> sums(surface.triangles.size());
  double all = 0;
  for (std::size_t s = 0; s < samples.places.size(); ++s) {
    constexpr std::size_t kOften = 4096;
    if (s % kOften == 0) poll();
    const auto foot = nearest.to(samples.places[s], samples.normals[s]);
    if (!foot) continue;
    const double weight = samples.weights[s];
    Sums& own = sums[foot->triangle];
    all += weight;
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j)
        own.shares[i][j] += weight * foot->shares[i] * foot->shares[j];
      own.places[i] = own.places[i] + samples.places[s] * (weight * foot->shares[i]);
    }
  }
  const auto count = static_cast<Eigen::Index>(surface.positions.size());
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::MatrixX3d wanted = Eigen::MatrixX3d::Zero(count, 3);
  for (std::size_t t = 0; t < sums.size(); ++t) {
    const Triangle& corners = surface.triangles[t];
    for (std::size_t i = 0; i < 3; ++i) {
      if (is_fixed[corners[i]] != 0) continue;
      const auto row = static_cast<int>(corners[i]);
      const Vec3d& p = sums[t].places[i];
      wanted(row, 0) += p.x, wanted(row, 1) += p.y, wanted(row, 2) += p.z;
      for (std::size_t j = 0; j < 3; ++j) {
        const double both = sums[t].shares[i][j];
        if (is_fixed[corners[j]] == 0) {
          entries.emplace_back(row, static_cast<int>(corners[j]), both);
          continue;
        }
        const Vec3f& q = surface.positions[corners[j]];
        wanted(row, 0) -= both * q.x, wanted(row, 1) -= both * q.y, wanted(row, 2) -= both * q.z;
      }
    }
  }
  const double hold = kHold * all / static_cast<double>(count);
  for (int v = 0; v < count; ++v) {
    const Vec3f& p = surface.positions[static_cast<std::size_t>(v)];
    entries.emplace_back(v, v, hold);
    wanted(v, 0) += hold * p.x, wanted(v, 1) += hold * p.y, wanted(v, 2) += hold * p.z;
  }
  Eigen::SparseMatrix<double> matrix(count, count);
  matrix.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(matrix);
  if (!(hold > 0) || solver.info() != Eigen::Success) return surface.positions;
  const Eigen::MatrixX3d found = solver.solve(wanted);
  if (!found.allFinite()) return surface.positions;
  std::vector<Vec3f> places;
  for (int v = 0; v < count; ++v) {
    const Vec3f own = surface.positions[static_cast<std::size_t>(v)];
    places.push_back(is_fixed[static_cast<std::size_t>(v)] != 0
                         ? own
                         : Vec3f(Vec3d{found(v, 0), found(v, 1), found(v, 2)}));
  }
  return places;
}

/// Vertices of triangles that would turn over go back to where they were, until none does.
void keep_faces(const Surface& before, std::vector<Vec3f>& places) {
  for (bool any = true; any;) {
    any = false;
    for (const Triangle& t : before.triangles) {
      const Vec3d was = area_vector(before.positions, t), is = area_vector(places, t);
      constexpr double kTurn = 0.3;  // cosine
      if (dot(was, is) >= kTurn * length(was) * length(is)) continue;
      for (const std::uint32_t v : t) {
        any = any || !(places[v] == before.positions[v]);
        places[v] = before.positions[v];
      }
    }
  }
}

}  // namespace

void fit(Surface& simplified, const Surface& dense, int rounds, const std::function<void()>& poll) {
  if (simplified.triangles.empty()) return;
  const Samples samples(dense);
  const std::vector<char> is_fixed = border_of(simplified);
  for (int round = 0; round < rounds; ++round) {
    std::vector<Vec3f> places = best_places(simplified, samples, is_fixed, poll);
    keep_faces(simplified, places);
    simplified.positions = std::move(places);
  }
}

void simplify_fitted(Surface& surface, std::size_t triangles, const std::function<void()>& poll) {
  constexpr int kOnTheWay = 2, kAtLast = 4;  // rounds
  if (surface.triangles.size() <= triangles) return;
  const Surface dense = surface;
  for (std::size_t before = 0; surface.triangles.size() > triangles;) {
    before = surface.triangles.size();
    simplify(surface, std::max(triangles, before / 2));
    if (surface.triangles.size() == before) break;  // its shape allows no less
    fit(surface, dense, kOnTheWay, poll);
  }
  fit(surface, dense, kAtLast, poll);
}

}  // namespace pounce::meshing
