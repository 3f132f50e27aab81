// SPDX-License-Identifier: Apache-2.0
//
// MikkTSpace (Morten Mikkelsen, "Simulation of Wrinkled Surfaces Revisited", 2008), of triangles.
//
// A normal map only means something together with the frames it was made in. Renderers and bakers
// that make frames from the mesh agree on this way, down to where frames are shared:
//
//   1. corners of equal position, normal and UV are one point;
//   2. triangles are neighbours where both have an edge, in opposite directions, and no third
//      triangle came first;
//   3. around a point, neighbours whose UVs turn the same way are a group. A triangle without area
//      in UV space joins whichever group comes first;
//   4. the frame of a group is the mean of its triangles' directions of growing u, each brought
//      into the plane of the point's normal, weighted by the triangle's angle there. A triangle
//      without area in UV space has no direction; one whose direction is just opposite counts
//      apart;
//   5. triangles of which two corners have the same position take no part; their corners get the
//      frame of the first triangle that has the same point.
//
// What decides (which corners are equal, which way UVs turn) is computed in single precision as
// others do; sums are in double precision, since they need not be the same in the last place.
// Angles are found with +, -, *, / and square roots alone.
//
// This is an implementation of our own, held against recorded results of the reference
// (docs/decisions/031): the same bits whatever compiler and library it is built with.
#include "mesh/tangent_space.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "mesh/vertex_frames.h"

namespace pounce::mesh {
namespace {

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
// Finding who is opposite to whom takes the square of a group's triangles; larger groups are one.
constexpr std::size_t kMostCompared = 512;

Vec3d unit_or_zero(Vec3d v) {
  const double size = length(v);
  return size > std::numeric_limits<float>::min() ? v * (1 / size) : v;
}

Vec3d in_plane(Vec3d v, Vec3d normal) { return unit_or_zero(v - normal * dot(normal, v)); }

/// The angle between unit vectors. tan(angle / 16) from half angles is below 0.2, where a few terms
/// of the arc tangent's series are exact to 1e-9.
double angle_between(Vec3d a, Vec3d b) {
  // The two lengths are twice the sine and twice the cosine of half the angle: the diagonals of the
  // rhombus of a and b. Each step halves the angle once more.
  const double t4 = length(a - b) / (2 + length(a + b));
  const double t8 = t4 / (1 + std::sqrt(1 + t4 * t4));
  const double t = t8 / (1 + std::sqrt(1 + t8 * t8)), q = t * t;
  return 16 * t * (1 - q * (1.0 / 3 - q * (1.0 / 5 - q * (1.0 / 7 - q * (1.0 / 9 - q / 11)))));
}

std::size_t before(std::size_t corner) { return corner == 0 ? 2 : corner - 1; }
std::size_t after(std::size_t corner) { return corner == 2 ? 0 : corner + 1; }

class TangentSpace {
 public:
  TangentSpace(const Mesh& mesh, const std::vector<std::uint32_t>& uv_set_of)
      : mesh_(mesh), uv_set_of_(uv_set_of), triangles_(mesh.triangles.size()) {}

  CornerTangents make() {
    weld();
    look_at_triangles();
    find_neighbours();
    make_groups();
    neighbours_ = {};
    make_frames();
    take_over();
    return std::move(out_);
  }

 private:
  enum Kind : std::uint8_t {
    mirrored = 0,
    upright = 1,  ///< UVs turn as the triangle does
    any = 2,      ///< flag: no area in UV space
    left_out = 4  ///< flag: no part in neighbourhoods
  };

  Vec2f uv(std::uint32_t vertex, std::uint32_t set) const {
    return has_set(set) ? mesh_.uv_sets[set][vertex] : Vec2f{};
  }
  bool has_set(std::uint32_t set) const { return set < mesh_.uv_sets.size(); }
  std::uint32_t set_of(std::size_t triangle) const {
    return uv_set_of_[mesh_.triangle_material[triangle]];
  }
  std::uint32_t point(std::size_t triangle, std::size_t corner) const {
    return point_of_[mesh_.triangles[triangle][corner]];
  }

  // --- points ------------------------------------------------------------------------------------

  /// What makes a vertex a point: position, normal, UV; and the material, as a primitive has one.
  struct PointKey {
    std::array<std::uint32_t, 9> words{};
    bool operator==(const PointKey&) const = default;

    std::uint64_t hash() const {
      std::uint64_t h = 0x9E3779B97F4A7C15ULL;
      for (const std::uint32_t word : words) h = (h ^ word) * 0xD6E8FEB86659FD93ULL ^ h >> 29;
      return h ^ h >> 32;
    }
  };

  PointKey key(std::uint32_t vertex) const {
    // -0 equals 0.
    const auto bits = [](float v) { return v == 0 ? 0U : std::bit_cast<std::uint32_t>(v); };
    const Vec3f &p = mesh_.positions[vertex], &n = mesh_.normals[vertex];
    const std::uint32_t material = material_of_[vertex];
    const Vec2f t = uv(vertex, uv_set_of_[material]);
    return {{bits(p.x), bits(p.y), bits(p.z), bits(n.x), bits(n.y), bits(n.z), bits(t.x), bits(t.y),
             material}};
  }

  /// Equal vertices become the first of them.
  void weld() {
    const std::size_t vertices = mesh_.positions.size();
    material_of_.assign(vertices, kNone);
    for (std::size_t t = 0; t < triangles_; ++t) {
      for (const std::uint32_t v : mesh_.triangles[t]) {
        if (material_of_[v] == kNone) material_of_[v] = mesh_.triangle_material[t];
      }
    }
    point_of_.resize(vertices);
    std::vector<std::uint32_t> slots(std::bit_ceil(2 * vertices + 1), kNone);
    // Open addressing, less than half full. A slot holds the first vertex of its point, and keys
    // are made again for each comparison: stored, they would take 36 bytes for each vertex.
    for (std::uint32_t v = 0; v < vertices; ++v) {
      point_of_[v] = v;
      if (material_of_[v] == kNone) continue;  // no triangle has it
      const PointKey own = key(v);
      std::size_t slot = own.hash() & (slots.size() - 1);
      while (slots[slot] != kNone && key(slots[slot]) != own)
        slot = (slot + 1) & (slots.size() - 1);
      if (slots[slot] == kNone) slots[slot] = v;
      point_of_[v] = slots[slot];
    }
    material_of_ = {};
  }

  // --- triangles ---------------------------------------------------------------------------------

  void look_at_triangles() {
    kinds_.resize(triangles_);
    for (std::size_t t = 0; t < triangles_; ++t) kinds_[t] = kind_of(t);
  }

  std::uint8_t kind_of(std::size_t t) const {
    const auto& v = mesh_.triangles[t];
    const auto& p = mesh_.positions;
    const std::uint32_t set = set_of(t);
    if (p[v[0]] == p[v[1]] || p[v[0]] == p[v[2]] || p[v[1]] == p[v[2]]) return left_out;
    for (const std::uint32_t vertex : v) {
      if (!mesh_.has_uv(set, vertex)) return left_out;
    }
    const float area = uv_area(t);
    const std::uint8_t turn = area > 0 ? upright : mirrored;
    const Directions d = directions(t);
    const bool is_flat =
        !(std::abs(area) > std::numeric_limits<float>::min()) || d.u == Vec3d{} || d.v == Vec3d{};
    return static_cast<std::uint8_t>(turn | (is_flat ? any : 0));
  }

  /// Twice the area of its UVs, with v up.
  float uv_area(std::size_t t) const {
    const auto& v = mesh_.triangles[t];
    const std::uint32_t set = set_of(t);
    const Vec2f a = uv(v[0], set), b = uv(v[1], set), c = uv(v[2], set);
    return -((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x));
  }

  /// Where u and v (up) grow on a triangle: unit vectors, or zero.
  struct Directions {
    Vec3d u, v;
  };
  Directions directions(std::size_t t) const {
    const auto& v = mesh_.triangles[t];
    const std::uint32_t set = set_of(t);
    const auto uv_of = [&](std::size_t k) {
      const Vec2f p = uv(v[k], set);
      return Vec2d{p.x, p.y};
    };
    const Vec3d a(mesh_.positions[v[0]]);
    const Vec3d e1 = Vec3d(mesh_.positions[v[1]]) - a, e2 = Vec3d(mesh_.positions[v[2]]) - a;
    const Vec2d d1 = uv_of(1) - uv_of(0), d2 = uv_of(2) - uv_of(0);
    const double sign = uv_area(t) > 0 ? -1 : 1;  // of v down
    return {unit_or_zero((e1 * d2.y - e2 * d1.y) * sign),
            unit_or_zero((e1 * d2.x - e2 * d1.x) * sign)};
  }

  // --- neighbours --------------------------------------------------------------------------------

  /// neighbours_[3 t + k]: the triangle across the edge from corner k to the next.
  void find_neighbours() {
    struct Edge {
      std::uint32_t low, high, corner;
    };
    std::vector<Edge> edges;
    edges.reserve(3 * triangles_);
    for (std::size_t t = 0; t < triangles_; ++t) {
      if ((kinds_[t] & left_out) != 0) continue;
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t a = point(t, k), b = point(t, after(k));
        edges.push_back({std::min(a, b), std::max(a, b), static_cast<std::uint32_t>(3 * t + k)});
      }
    }
    std::sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) {
      return a.low != b.low     ? a.low < b.low
             : a.high != b.high ? a.high < b.high
                                : a.corner < b.corner;
    });
    neighbours_.assign(3 * triangles_, kNone);
    const auto goes_up = [&](const Edge& e) { return point(e.corner / 3, e.corner % 3) == e.low; };
    for (std::size_t first = 0; first < edges.size();) {
      std::size_t last = first;
      while (last < edges.size() && edges[last].low == edges[first].low &&
             edges[last].high == edges[first].high)
        ++last;
      // Each takes the first later one that runs the other way and is free.
      std::size_t next[2] = {first, first};
      for (std::size_t i = first; i < last; ++i) {
        if (neighbours_[edges[i].corner] != kNone) continue;
        const bool up = goes_up(edges[i]);
        std::size_t& j = next[up ? 0 : 1];
        j = std::max(j, i + 1);
        while (j < last && (goes_up(edges[j]) == up || neighbours_[edges[j].corner] != kNone)) ++j;
        if (j == last) continue;
        neighbours_[edges[i].corner] = edges[j].corner / 3;
        neighbours_[edges[j].corner] = edges[i].corner / 3;
      }
      first = last;
    }
  }

  // --- groups ------------------------------------------------------------------------------------

  void make_groups() {
    out_.of_corner.assign(3 * triangles_, kNone);
    for (std::size_t t = 0; t < triangles_; ++t) {
      if ((kinds_[t] & (any | left_out)) != 0) continue;
      for (std::size_t k = 0; k < 3; ++k) {
        if (out_.of_corner[3 * t + k] == kNone) grow(t, k);
      }
    }
  }

  /// A new group: this corner, and what can be reached from it around its point.
  void grow(std::size_t triangle, std::size_t corner) {
    const auto group = static_cast<std::uint32_t>(group_turns_.size());
    const auto turn = static_cast<std::uint8_t>(kinds_[triangle] & upright);
    const std::uint32_t around = point(triangle, corner);
    group_turns_.push_back(turn);
    open_.assign(1, static_cast<std::uint32_t>(triangle));
    while (!open_.empty()) {
      const std::size_t t = open_.back();
      open_.pop_back();
      std::size_t k = 0;
      while (point(t, k) != around) ++k;
      if (!join(t, k, group, turn)) continue;
      // The edge before the corner last in, first out would be asked first: the order tells where a
      // triangle without area in UV space goes.
      for (const std::size_t edge : {before(k), k}) {
        const std::uint32_t neighbour = neighbours_[3 * t + edge];
        if (neighbour != kNone) open_.push_back(neighbour);
      }
    }
  }

  bool join(std::size_t t, std::size_t k, std::uint32_t group, std::uint8_t turn) {
    std::uint32_t* const corners = &out_.of_corner[3 * t];
    if (corners[k] != kNone) return false;
    const bool is_first = corners[0] == kNone && corners[1] == kNone && corners[2] == kNone;
    // Whichever group reaches it first decides how a triangle without area in UV space turns.
    if ((kinds_[t] & any) != 0 && is_first)
      kinds_[t] = static_cast<std::uint8_t>((kinds_[t] & ~upright) | turn);
    if ((kinds_[t] & upright) != turn) return false;
    corners[k] = group;
    return true;
  }

  // --- frames ------------------------------------------------------------------------------------

  /// A corner's share of its group's frame.
  struct Share {
    std::uint32_t corner = 0;
    bool is_any = false;
    Vec3d u, v;  ///< in the plane of the normal
    double angle = 0;
  };

  void make_frames() {
    const std::size_t groups = group_turns_.size();
    std::vector<std::uint32_t> starts(groups + 1, 0), corners;
    std::size_t count = 0;
    for (const std::uint32_t group : out_.of_corner) {
      if (group == kNone) continue;
      ++starts[group + 1];
      ++count;
    }
    for (std::size_t g = 0; g < groups; ++g) starts[g + 1] += starts[g];
    corners.resize(count);
    std::vector<std::uint32_t> next(starts.begin(), starts.end() - 1);
    for (std::uint32_t c = 0; c < out_.of_corner.size(); ++c) {
      if (out_.of_corner[c] != kNone) corners[next[out_.of_corner[c]]++] = c;
    }
    next = {};
    out_.tangents.resize(groups);
    std::vector<Share> shares;
    for (std::size_t g = 0; g < groups; ++g) {
      shares.clear();
      for (std::uint32_t i = starts[g]; i < starts[g + 1]; ++i) shares.push_back(share(corners[i]));
      make_frame(shares, static_cast<std::uint32_t>(g));
    }
  }

  Share share(std::uint32_t corner) const {
    const std::size_t t = corner / 3, k = corner % 3;
    const auto& v = mesh_.triangles[t];
    // To double precision: as stored they are off by a float's last place.
    const Vec3d normal = unit_or_zero(Vec3d(mesh_.normals[v[k]]));
    const Directions d = directions(t);
    Share out{corner, (kinds_[t] & any) != 0, in_plane(d.u, normal), in_plane(d.v, normal), 0};
    const Vec3d at(mesh_.positions[v[k]]);
    out.angle = angle_between(in_plane(Vec3d(mesh_.positions[v[before(k)]]) - at, normal),
                              in_plane(Vec3d(mesh_.positions[v[after(k)]]) - at, normal));
    return out;
  }

  static bool agree(const Share& a, const Share& b) {
    constexpr double kOpposite = -1 + 1e-7;  // what single precision tells from -1
    return a.is_any || b.is_any || a.corner == b.corner ||
           (dot(a.u, b.u) > kOpposite && dot(a.v, b.v) > kOpposite);
  }

  Vec4f frame(const std::vector<const Share*>& shares, std::uint32_t group) const {
    Vec3d sum;
    for (const Share* s : shares) {
      if (!s->is_any) sum = sum + s->u * s->angle;
    }
    const Vec3d u = unit_or_zero(sum);
    const float sign = group_turns_[group] == upright ? 1.0F : -1.0F;
    return {static_cast<float>(u.x), static_cast<float>(u.y), static_cast<float>(u.z), sign};
  }

  void make_frame(const std::vector<Share>& shares, std::uint32_t group) {
    std::vector<const Share*> members;
    for (const Share& s : shares) members.push_back(&s);
    out_.tangents[group] = frame(members, group);
    // Nearly always true. Then nobody is opposite to anybody, and the square of the group is
    // spared.
    const bool close = std::all_of(shares.begin(), shares.end(), [&](const Share& s) {
      return s.is_any || (dot(s.u, shares[0].u) > 0.01 && dot(s.v, shares[0].v) > 0.01);
    });
    if (close || shares.size() > kMostCompared) return;
    for (const Share& own : shares) {
      members.clear();
      for (const Share& s : shares) {
        if (agree(own, s)) members.push_back(&s);
      }
      if (members.size() == shares.size()) continue;
      out_.of_corner[own.corner] = static_cast<std::uint32_t>(out_.tangents.size());
      out_.tangents.push_back(frame(members, group));
    }
  }

  /// Corners without a group: of a triangle without area in space, the frame of the first corner
  /// that has the same point.
  void take_over() {
    std::vector<std::uint32_t> first;
    std::uint32_t unknown = kNone;
    for (std::size_t c = 0; c < out_.of_corner.size(); ++c) {
      if (out_.of_corner[c] != kNone) continue;
      if (first.empty()) first = first_corners();
      const std::uint32_t found =
          (kinds_[c / 3] & left_out) != 0 ? first[point(c / 3, c % 3)] : kNone;
      if (found == kNone && unknown == kNone) {
        unknown = static_cast<std::uint32_t>(out_.tangents.size());
        out_.tangents.push_back({1, 0, 0, 1});
      }
      out_.of_corner[c] = found == kNone ? unknown : found;
    }
  }

  /// The frame of the first corner at each point.
  std::vector<std::uint32_t> first_corners() const {
    std::vector<std::uint32_t> first(point_of_.size(), kNone);
    for (std::size_t c = out_.of_corner.size(); c-- > 0;) {
      if (out_.of_corner[c] != kNone) first[point(c / 3, c % 3)] = out_.of_corner[c];
    }
    return first;
  }

  const Mesh& mesh_;
  const std::vector<std::uint32_t>& uv_set_of_;
  const std::size_t triangles_;
  std::vector<std::uint32_t> material_of_;  ///< by vertex: of the first triangle that has it
  std::vector<std::uint32_t> point_of_;     ///< by vertex
  std::vector<std::uint8_t> kinds_;         ///< by triangle
  std::vector<std::uint32_t> neighbours_;   ///< by corner: across the edge that begins there
  std::vector<std::uint8_t> group_turns_;
  std::vector<std::uint32_t> open_;
  CornerTangents out_;
};

}  // namespace

CornerTangents mikk_tangents(const Mesh& mesh, const std::vector<std::uint32_t>& uv_set_of) {
  return TangentSpace(mesh, uv_set_of).make();
}

std::uint64_t set_tangents(Mesh& mesh, const std::vector<std::uint32_t>& uv_set_of,
                           const std::vector<bool>& keeps_own) {
  const CornerTangents made = mikk_tangents(mesh, uv_set_of);
  VertexSplitter<Vec4f> vertices(mesh.tangents);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      std::uint32_t& corner = mesh.triangles[t][k];
      const bool has_own = !mesh.own_tangents.empty() && mesh.own_tangents[corner];
      if (has_own && keeps_own[mesh.triangle_material[t]]) continue;
      corner = vertices.with(corner, made.tangents[made.of_corner[3 * t + k]]);
    }
  }
  return vertices.split(mesh);
}

std::uint64_t tangents_bytes(const Mesh& mesh) {
  constexpr std::uint64_t kPerTriangle = 101;  // of this, while edges are sorted, or frames made
  constexpr std::uint64_t kPerVertex = 24;     // the most slots that find equal ones
  const std::uint64_t corners = 3 * std::uint64_t{mesh.triangles.size()};
  const std::uint64_t vertices = mesh.positions.size();
  const std::uint64_t copy = 2 * sizeof(Vec3f) + 2 * sizeof(Vec4f) + 9 + 9 * mesh.uv_sets.size();
  return kPerTriangle * mesh.triangles.size() + kPerVertex * vertices +
         (corners - std::min(corners, vertices)) * copy;
}

}  // namespace pounce::mesh
