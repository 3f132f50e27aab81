// SPDX-License-Identifier: Apache-2.0
//
// Files come without normals, with normals of length 0, with tangents of another handedness than
// their UVs. Everything after reading relies on unit normals and on tangents at right angles to
// them, so what is missing is made here, and what is there is only normalised.
//
// A normal at a crease belongs to a corner and not to a vertex: the faces on its two sides want
// different ones. smooth_normals() looks around each corner's position for triangles that lean
// little from the corner's own, and splits a vertex whose corners end up with different normals.
//
// What is made here for missing tangents only has to be sound. Where a normal map is written, what
// the file lacks is made again in the way that renderers agree on (tangent_space.cpp); that takes
// longer, and other jobs have no use for tangents.
#include "mesh/vertex_frames.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

namespace pounce::mesh {
namespace {

constexpr double kPi = 3.14159265358979323846;
// Comparing every pair of triangles around a position costs the square of their number; beyond this
// many (poles of fans) they are all averaged instead.
constexpr std::size_t kMaxCompared = 512;

Vec3d area_normal(const Mesh& mesh, const std::array<std::uint32_t, 3>& t) {
  const Vec3d a(mesh.positions[t[0]]), b(mesh.positions[t[1]]), c(mesh.positions[t[2]]);
  return cross(b - a, c - a);
}

/// The unit vector along v; zero for zero, NaN and infinity.
Vec3d unit(Vec3d v) {
  const double size = length(v);
  return size > 0 && std::isfinite(size) ? v * (1 / size) : Vec3d{};
}

bool is_zero(Vec3d v) { return v == Vec3d{}; }

/// Some unit vector orthogonal to n; (1, 0, 0) for a zero n.
Vec3d any_orthogonal(Vec3d n) {
  const Vec3d axis = std::abs(n.x) < 0.9 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  return unit(axis - n * dot(axis, n));
}

void store_tangent(Vec4f& out, Vec3d direction, float sign) {
  out = {static_cast<float>(direction.x), static_cast<float>(direction.y),
         static_cast<float>(direction.z), sign};
}

/// Where one triangle's u grows on the surface, as a vector as long as its area, and which way its
/// UVs turn.
struct TriangleTangent {
  Vec3d direction;
  double orientation = 0;  // signed area, positive where v * cross(normal, tangent) falls
};

TriangleTangent triangle_tangent(const Mesh& mesh, const std::array<std::uint32_t, 3>& t) {
  const Vec3d a(mesh.positions[t[0]]), b(mesh.positions[t[1]]), c(mesh.positions[t[2]]);
  const auto uv = [&](std::size_t i) {
    const Vec2f p = mesh.uv_sets[0][t[i]];
    return Vec2d{p.x, p.y};
  };
  const Vec2d d1 = uv(1) - uv(0), d2 = uv(2) - uv(0);
  const double det = d1.x * d2.y - d2.x * d1.y;
  if (det == 0) return {};
  // Solves e1 = d1.x T + d1.y B, e2 = d2.x T + d2.y B for T; its length says nothing of interest.
  const double area = length(cross(b - a, c - a));
  const double sign = det < 0 ? -1 : 1;
  const Vec3d along = unit(((b - a) * d2.y - (c - a) * d1.y) * sign);
  return {along * area, -sign * area};  // v counts down the image
}

}  // namespace

std::uint64_t repair_normals(Mesh& mesh) {
  std::vector<std::uint32_t> broken;
  for (std::size_t i = 0; i < mesh.normals.size(); ++i) {
    const Vec3d n = unit(Vec3d(mesh.normals[i]));
    mesh.normals[i] = Vec3f(n);
    if (is_zero(n)) broken.push_back(static_cast<std::uint32_t>(i));
  }
  if (broken.empty()) return 0;
  std::vector<bool> wanted(mesh.normals.size(), false);
  for (const std::uint32_t vertex : broken) wanted[vertex] = true;
  // Only around broken ones: mostly a few vertices of a large mesh.
  // Unnormalized normals weigh triangles by their area.
  for (const auto& t : mesh.triangles) {
    if (!wanted[t[0]] && !wanted[t[1]] && !wanted[t[2]]) continue;
    const Vec3d normal = area_normal(mesh, t);
    for (const std::uint32_t vertex : t) {
      if (wanted[vertex]) mesh.normals[vertex] = mesh.normals[vertex] + Vec3f(normal);
    }
  }
  for (const std::uint32_t vertex : broken) {
    mesh.normals[vertex] = Vec3f(unit(Vec3d(mesh.normals[vertex])));
  }
  return broken.size();
}

std::uint64_t complete_tangents(Mesh& mesh) {
  std::vector<bool> missing(mesh.tangents.size(), false);
  std::uint64_t count = 0;
  for (std::size_t i = 0; i < mesh.tangents.size(); ++i) {
    Vec4f& t = mesh.tangents[i];
    const Vec3d given = unit(Vec3d{t.x, t.y, t.z});
    Vec3d direction;
    if (!is_zero(given)) {
      const Vec3d n = unit(Vec3d(mesh.normals[i]));  // to double precision
      direction = unit(given - n * dot(given, n));
    }
    missing[i] = is_zero(direction) || !std::isfinite(t.w);
    if (missing[i]) {
      t = {};
      ++count;
    } else {
      store_tangent(t, direction, t.w < 0 ? -1.0F : 1.0F);
    }
  }
  // From here on a tangent is either one of the file's, normalised, or a sum that begins at zero.
  if (count < missing.size()) {
    mesh.own_tangents = missing;
    mesh.own_tangents.flip();
  }
  if (count == 0) return 0;
  // Sums over all triangles of a vertex, weighted by area: slivers, whose direction is mostly
  // rounding, count for little. The sign is that of the larger area.
  if (!mesh.uv_sets.empty()) {
    for (const auto& t : mesh.triangles) {
      if (!missing[t[0]] && !missing[t[1]] && !missing[t[2]]) continue;
      if (!mesh.has_uv(0, t[0]) || !mesh.has_uv(0, t[1]) || !mesh.has_uv(0, t[2])) continue;
      const TriangleTangent add = triangle_tangent(mesh, t);
      for (const std::uint32_t vertex : t) {
        if (!missing[vertex]) continue;
        Vec4f& sum = mesh.tangents[vertex];
        sum.x += static_cast<float>(add.direction.x);
        sum.y += static_cast<float>(add.direction.y);
        sum.z += static_cast<float>(add.direction.z);
        sum.w += static_cast<float>(add.orientation);
      }
    }
  }
  for (std::size_t i = 0; i < mesh.tangents.size(); ++i) {
    if (!missing[i]) continue;
    Vec4f& t = mesh.tangents[i];
    const Vec3d n = unit(Vec3d(mesh.normals[i]));  // to double precision
    const Vec3d sum = unit(Vec3d{t.x, t.y, t.z});
    const Vec3d direction = unit(sum - n * dot(sum, n));
    // No UVs, or UVs that cancel out: any direction will do, as long as the frame is one.
    if (is_zero(direction)) {
      store_tangent(t, any_orthogonal(n), t.w < 0 ? -1.0F : 1.0F);
    } else {
      store_tangent(t, direction, t.w < 0 ? -1.0F : 1.0F);
    }
  }
  return count;
}

namespace {

/// Triangles around each position: those of position p are items[starts[p] .. starts[p + 1]).
struct Incidence {
  std::vector<std::uint32_t> starts;
  std::vector<std::uint32_t> items;
};

Incidence triangles_around(const Mesh& mesh, const std::vector<std::uint32_t>& position_of,
                           std::uint32_t position_count) {
  Incidence out;
  out.starts.assign(std::size_t{position_count} + 1, 0);
  for (const auto& t : mesh.triangles) {
    for (const std::uint32_t vertex : t) ++out.starts[position_of[vertex] + 1];
  }
  for (std::size_t p = 0; p < position_count; ++p) out.starts[p + 1] += out.starts[p];
  out.items.resize(mesh.triangles.size() * 3);
  std::vector<std::uint32_t> next(out.starts.begin(), out.starts.end() - 1);
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    for (const std::uint32_t vertex : mesh.triangles[i]) {
      out.items[next[position_of[vertex]]++] = i;
    }
  }
  return out;
}

/// Normals of triangles' corners, smoothed over what lies around their position.
class CornerNormals {
 public:
  CornerNormals(const Mesh& mesh, const Incidence& around, double min_cosine)
      : mesh_(mesh), around_(around), min_cosine_(min_cosine) {}

  Vec3f at(std::uint32_t triangle, std::uint32_t position) {
    const std::uint32_t count = around_.starts[position + 1] - around_.starts[position];
    if (count <= kMaxCompared) {
      return smoothed(position, unit(area_normal(mesh_, mesh_.triangles[triangle])));
    }
    // All triangles there have the same: found once, or a fan would cost the square of its size.
    const auto [known, is_new] = crowded_.try_emplace(position);
    if (is_new) known->second = smoothed(position, {});
    return known->second;
  }

 private:
  /// The mean of those that lean little from `own`; of all if that is zero.
  Vec3f smoothed(std::uint32_t position, Vec3d own) const {
    Vec3d sum;
    for (std::uint32_t k = around_.starts[position]; k < around_.starts[position + 1]; ++k) {
      const Vec3d other = area_normal(mesh_, mesh_.triangles[around_.items[k]]);
      if (is_zero(own) || dot(own, other) >= min_cosine_ * length(other)) sum = sum + other;
    }
    return Vec3f(unit(sum));
  }

  const Mesh& mesh_;
  const Incidence& around_;
  const double min_cosine_;
  std::unordered_map<std::uint32_t, Vec3f> crowded_;
};

}  // namespace

void smooth_normals(Mesh& mesh, const std::vector<std::uint32_t>& position_of,
                    std::uint32_t position_count, const std::vector<bool>& missing,
                    double max_angle_deg) {
  // Slightly wider than asked for, so that surfaces built of exactly that angle do not depend on
  // rounding.
  const double min_cosine = std::cos(max_angle_deg * kPi / 180) - 1e-6;
  const Incidence around = triangles_around(mesh, position_of, position_count);
  CornerNormals normals(mesh, around, min_cosine);
  VertexSplitter<Vec3f> vertices(mesh.normals);
  // Normals are found by corner, from positions alone, and stored by vertex: a mesh has one index
  // per corner, for all attributes.
  auto renumbered = mesh.triangles;  // the old numbers are needed until the last corner is done
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    for (std::uint32_t& corner : renumbered[i]) {
      if (missing[corner]) corner = vertices.with(corner, normals.at(i, position_of[corner]));
    }
  }
  mesh.triangles = std::move(renumbered);
  vertices.split(mesh);
}

}  // namespace pounce::mesh
