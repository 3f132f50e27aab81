// SPDX-License-Identifier: Apache-2.0
#include "meshing/collapse.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <queue>
#include <tuple>
#include <unordered_set>
#include <utility>

#include "core/directions.h"

namespace pounce::meshing {
namespace {

/// Of planes on edges, beside a square of the edge's length on the surface.
constexpr double kBorderWeight = 10, kSeamWeight = 1;
/// Of a texel that slides, beside the surface moving as far.
constexpr double kSlideWeight = 0.02;
constexpr double kTurn = 0.25;  ///< cosine: a triangle may turn so far at once

/// The sum of squared distances from planes, each with a weight.
struct Quadric {
  double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0, x = 0, y = 0, z = 0, one = 0, weight = 0;

  /// Of the plane where n p + d is 0.
  void add(Vec3d n, double d, double w) {
    xx += w * n.x * n.x, xy += w * n.x * n.y, xz += w * n.x * n.z;
    yy += w * n.y * n.y, yz += w * n.y * n.z, zz += w * n.z * n.z;
    x += w * n.x * d, y += w * n.y * d, z += w * n.z * d;
    one += w * d * d;
    weight += w;
  }
  void add(const Quadric& q) {
    xx += q.xx, xy += q.xy, xz += q.xz, yy += q.yy, yz += q.yz, zz += q.zz;
    x += q.x, y += q.y, z += q.z, one += q.one, weight += q.weight;
  }
  double at(Vec3d p) const {
    const double square = xx * p.x * p.x + yy * p.y * p.y + zz * p.z * p.z +
                          2 * (xy * p.x * p.y + xz * p.x * p.z + yz * p.y * p.z);
    return std::max(square + 2 * (x * p.x + y * p.y + z * p.z) + one, 0.0);
  }
};

/// How far a texture slides: the squared differences between the UVs that a wedge's triangles had
/// at a place, continued as planes, and those that are there now.
struct Slide {
  Quadric squares;
  std::array<Vec3d, 2> rise{};  ///< sums over triangles, of u and v
  std::array<double, 2> at_zero{};

  void add(const std::array<Vec3d, 3>& corners, const std::array<Vec2f, 3>& uvs) {
    const Vec3d b = corners[1] - corners[0], c = corners[2] - corners[0];
    const double bb = dot(b, b), cc = dot(c, c), bc = dot(b, c), det = bb * cc - bc * bc;
    constexpr double kSliver = 1e-6;
    if (!(det > kSliver * bb * cc)) return;
    const double area = std::sqrt(det) / 2;
    for (std::size_t k = 0; k < 2; ++k) {
      const auto value = [&](std::size_t corner) {
        return double{k == 0 ? uvs[corner].x : uvs[corner].y};
      };
      const double to_b = value(1) - value(0), to_c = value(2) - value(0);
      const Vec3d g = b * ((to_b * cc - to_c * bc) / det) + c * ((to_c * bb - to_b * bc) / det);
      const double zero = value(0) - dot(g, corners[0]);
      squares.add(g, zero, area);
      rise[k] = rise[k] + g * area;
      at_zero[k] += zero * area;
    }
  }
  void add(const Slide& other) {
    squares.add(other.squares);
    for (std::size_t k = 0; k < 2; ++k) {
      rise[k] = rise[k] + other.rise[k];
      at_zero[k] += other.at_zero[k];
    }
  }
  double at(Vec3d p, Vec2f uv) const {
    const double u = uv.x, v = uv.y;
    const double both = u * (dot(rise[0], p) + at_zero[0]) + v * (dot(rise[1], p) + at_zero[1]);
    // Each triangle has counted its weight twice, once for u and once for v.
    return std::max(squares.at(p) - 2 * both + (u * u + v * v) * squares.weight / 2, 0.0);
  }
};

class Collapser {
 public:
  Collapser(WedgeSurface& surface, std::vector<UvCover>& covers, double distance)
      : s_(surface),
        covers_(covers),
        most_error_(distance * distance),
        fans_(surface.places.size()),
        quadrics_(surface.places.size()),
        slides_(surface.wedges.size()),
        stays_(surface.places.size(), 0),
        stamps_(surface.places.size()),
        left_(surface.triangles.size()) {
    const Vec3d first = s_.places.empty() ? Vec3d{} : Vec3d(s_.places.front());
    for (const Vec3f& p : s_.places) points_.push_back(Vec3d(p) - first);
    double area = 0, uv_area = 0;
    for (std::uint32_t t = 0; t < s_.triangles.size(); ++t) {
      const Triangle& own = s_.triangles[t];
      const std::array<Vec3d, 3> corners{points_[place(own[0])], points_[place(own[1])],
                                         points_[place(own[2])]};
      const std::array<Vec2f, 3> uvs = uvs_of(s_, own);
      area += length(cross(corners[1] - corners[0], corners[2] - corners[0]));
      uv_area += std::abs(turn_of(uvs));
      for (const std::uint32_t w : own) {
        fans_[place(w)].push_back(t);
        slides_[w].add(corners, uvs);
      }
    }
    if (uv_area > 0) slide_weight_ = kSlideWeight * area / uv_area;
    for (std::uint32_t p = 0; p < fans_.size(); ++p) look_at(p);
  }

  void run(std::size_t triangles, const std::function<void()>& poll) {
    for (std::uint32_t p = 0; p < fans_.size(); ++p) choose(p);
    for (std::size_t steps = 0; left_ > triangles && !queue_.empty(); ++steps) {
      constexpr std::size_t kOften = 4096;
      if (steps % kOften == 0) poll();
      const Step step = queue_.top();
      queue_.pop();
      if (step.stamp != stamps_[step.from]) continue;
      // What lies two edges away may have changed since.
      if (!is_possible(step.from, step.to)) {
        choose(step.from);
      } else if (!find_room(step.from)) {
        refused_.insert(key(step.from, step.to));
        choose(step.from);
      } else {
        make(step.from, step.to);
      }
    }
    std::vector<Triangle> kept;
    for (const Triangle& t : s_.triangles) {
      if (t[0] != t[1]) kept.push_back(t);
    }
    s_.triangles = std::move(kept);
    drop_unused(s_);
  }

 private:
  struct Step {
    double cost = 0;
    std::uint32_t from = 0, to = 0, stamp = 0;
    bool operator<(const Step& other) const {  // the least comes first
      return std::tie(other.cost, other.from) < std::tie(cost, from);
    }
  };
  /// An edge that leads away from a place: how many triangles have it, and of the first one the
  /// wedges at both ends.
  struct Spoke {
    std::uint32_t to = 0, own_wedge = 0, far_wedge = 0, count = 0;
    bool is_seam = false;
    Vec3d normal;  ///< of a triangle that has it
  };

  static std::uint64_t key(std::uint32_t from, std::uint32_t to) {
    return (std::uint64_t{from} << 32U) | to;
  }
  std::uint32_t place(std::uint32_t wedge) const { return s_.wedges[wedge].place; }
  /// A triangle's corners from that at `p` on.
  Triangle from(std::uint32_t t, std::uint32_t p) const {
    const Triangle& own = s_.triangles[t];
    const std::size_t k = place(own[0]) == p ? 0 : place(own[1]) == p ? 1 : 2;
    return {own[k], own[(k + 1) % 3], own[(k + 2) % 3]};
  }

  void find_spokes(std::uint32_t p) {
    spokes_.clear();
    for (const std::uint32_t t : fans_[p]) {
      const Triangle own = from(t, p);
      for (const std::uint32_t far : {own[1], own[2]}) {
        const auto same = std::find_if(spokes_.begin(), spokes_.end(),
                                       [&](const Spoke& s) { return s.to == place(far); });
        if (same == spokes_.end()) {
          const Vec3d a = points_[p];
          const Vec3d normal =
              unit_vector(cross(points_[place(own[1])] - a, points_[place(own[2])] - a));
          spokes_.push_back({place(far), own[0], far, 1, false, normal});
        } else {
          ++same->count;
          same->is_seam = same->is_seam || same->own_wedge != own[0] || same->far_wedge != far;
        }
      }
    }
  }

  /// What is known of a place before anything has moved.
  void look_at(std::uint32_t p) {
    const Vec3d a = points_[p];
    Quadric& quadric = quadrics_[p];
    for (const std::uint32_t t : fans_[p]) {
      const Triangle own = from(t, p);
      const Vec3d normal = cross(points_[place(own[1])] - a, points_[place(own[2])] - a);
      if (const double area = length(normal) / 2; area > 0)
        quadric.add(unit_vector(normal), -dot(unit_vector(normal), a), area);
    }
    find_spokes(p);
    std::size_t ends = 0;
    bool is_simple = true;
    for (const Spoke& spoke : spokes_) {
      is_simple = is_simple && spoke.count <= 2;
      ends += spoke.count == 1 ? 1 : 0;
      if (spoke.count == 2 && !spoke.is_seam) continue;
      const Vec3d along = points_[spoke.to] - a, across = cross(along, spoke.normal);
      if (length(across) > 0) {
        const Vec3d side = unit_vector(across);
        quadric.add(side, -dot(side, a),
                    dot(along, along) * (spoke.count == 2 ? kSeamWeight : kBorderWeight));
      }
    }
    stays_[p] = is_simple && ends <= 2 && is_one_fan(p) ? 0 : 1;
  }

  /// Can one go around the place from triangle to triangle?
  bool is_one_fan(std::uint32_t p) const {
    std::vector<Triangle> rest;
    for (const std::uint32_t t : fans_[p]) rest.push_back(from(t, p));
    std::vector<std::uint32_t> reached;
    for (bool any = true; any && !rest.empty();) {
      any = false;
      std::erase_if(rest, [&](const Triangle& t) {
        const std::uint32_t b = place(t[1]), c = place(t[2]);
        const auto has = [&](std::uint32_t x) {
          return std::find(reached.begin(), reached.end(), x) != reached.end();
        };
        if (!reached.empty() && !has(b) && !has(c)) return false;
        reached.push_back(b);
        reached.push_back(c);
        any = true;
        return true;
      });
    }
    return rest.empty();
  }

  /// Finds where the place goes next, if anywhere.
  void choose(std::uint32_t p) {
    ++stamps_[p];
    if (stays_[p] != 0 || fans_[p].empty()) return;
    find_spokes(p);
    std::vector<std::pair<double, std::uint32_t>> ways;
    for (const Spoke& spoke : spokes_) {
      const Vec3d to = points_[spoke.to];
      const Quadric& own = quadrics_[p];
      const double error = own.at(to);
      if (error > most_error_ * own.weight || refused_.contains(key(p, spoke.to))) continue;
      ways.emplace_back(error + quadrics_[spoke.to].at(to) + slide_of(p, spoke.to), spoke.to);
    }
    std::sort(ways.begin(), ways.end());
    for (const auto& way : ways) {
      if (!is_possible(p, way.second)) continue;
      queue_.push({way.first, p, way.second, stamps_[p]});
      return;
    }
  }

  /// What texels slide by when p moves to q, as an error of the surface.
  double slide_of(std::uint32_t p, std::uint32_t q) const {
    double sum = 0;
    for (const std::uint32_t t : fans_[p]) {
      const Triangle own = from(t, p);
      for (const std::uint32_t far : {own[1], own[2]}) {
        // An edge within a chart is met twice, and each side of a seam once.
        if (place(far) == q)
          sum += slides_[own[0]].at(points_[q], s_.wedges[far].uv) +
                 slides_[far].at(points_[q], s_.wedges[far].uv);
      }
    }
    return slide_weight_ * sum;
  }

  /// Fills `spokes_` (of p), `turned_` (wedges at p with what they become) and `gone_`.
  bool is_possible(std::uint32_t p, std::uint32_t q) {
    find_spokes(p);
    const Spoke* way = nullptr;
    bool on_border = false;
    for (const Spoke& spoke : spokes_) {
      if (spoke.to == q) way = &spoke;
      on_border = on_border || spoke.count == 1;
    }
    if (way == nullptr || way->count > 2 || (on_border && way->count != 1)) return false;
    turned_.clear();
    for (const std::uint32_t t : fans_[p]) {
      const Triangle own = from(t, p);
      for (const std::uint32_t far : {own[1], own[2]}) {
        if (place(far) != q) continue;
        for (const auto& known : turned_) {
          if (known.first == own[0] && known.second != far) return false;
        }
        turned_.emplace_back(own[0], far);
      }
    }
    return keeps_topology(p, q, way->count) && keeps_faces(p, q);
  }

  /// What p and q have both as neighbours must be the corners of triangles that go.
  bool keeps_topology(std::uint32_t p, std::uint32_t q, std::uint32_t going) const {
    std::vector<std::uint32_t> around;
    for (const std::uint32_t t : fans_[q]) {
      const Triangle own = from(t, q);
      around.push_back(place(own[1]));
      around.push_back(place(own[2]));
    }
    const auto is_around = [&](std::uint32_t x) {
      return std::find(around.begin(), around.end(), x) != around.end();
    };
    std::uint32_t common = 0;
    for (const Spoke& spoke : spokes_) common += spoke.to != q && is_around(spoke.to) ? 1 : 0;
    if (common != going) return false;
    for (const std::uint32_t t : fans_[p]) {
      const Triangle own = from(t, p);
      const std::uint32_t b = place(own[1]), c = place(own[2]);
      if (b == q || c == q) continue;
      for (std::size_t k = 0; k < around.size(); k += 2) {
        if (std::minmax(around[k], around[k + 1]) == std::minmax(b, c)) return false;
      }
    }
    return true;
  }

  std::uint32_t turned(std::uint32_t wedge) const {
    for (const auto& known : turned_) {
      if (known.first == wedge) return known.second;
    }
    return wedge;
  }

  /// Of the triangles that stay: each wedge has somewhere to go, and none turns over.
  bool keeps_faces(std::uint32_t p, std::uint32_t q) const {
    for (const std::uint32_t t : fans_[p]) {
      const Triangle own = from(t, p);
      if (place(own[1]) == q || place(own[2]) == q) continue;
      const std::uint32_t to = turned(own[0]);
      if (to == own[0]) return false;
      const Vec3d b = points_[place(own[1])], c = points_[place(own[2])];
      const Vec3d was = cross(b - points_[p], c - points_[p]),
                  is = cross(b - points_[q], c - points_[q]);
      if (dot(was, is) <= kTurn * length(was) * length(is)) return false;
      const double turn = turn_of(uvs_of(s_, own));
      const double turns = turn_of(uvs_of(s_, {to, own[1], own[2]}));
      if (turn != 0 ? turn * turns <= 0 : turns * turn_around(own[0], p) < 0) return false;
    }
    return true;
  }

  /// Which way most of the triangles with this wedge lie in the texture.
  double turn_around(std::uint32_t wedge, std::uint32_t p) const {
    double sum = 0;
    for (const std::uint32_t t : fans_[p]) {
      const Triangle own = from(t, p);
      if (own[0] == wedge) sum += turn_of(uvs_of(s_, own));
    }
    return sum;
  }

  /// Is there room in the textures? Only where an outline moves may there be none, or where they
  /// lie folded. After is_possible().
  bool find_room(std::uint32_t p) {
    bool is_seen = false, is_mirrored = false;
    for (const std::uint32_t t : fans_[p]) {
      const double turn = turn_of(uvs_of(s_, s_.triangles[t]));
      is_seen = is_seen || turn > 0;
      is_mirrored = is_mirrored || turn < 0;
    }
    const bool has_outline = std::any_of(spokes_.begin(), spokes_.end(),
                                         [](const Spoke& s) { return s.is_seam || s.count == 1; });
    if (!has_outline && !(is_seen && is_mirrored)) return true;
    std::vector<std::uint32_t> materials;
    for (const auto& known : turned_) materials.push_back(s_.wedges[known.first].material);
    std::sort(materials.begin(), materials.end());
    materials.erase(std::unique(materials.begin(), materials.end()), materials.end());
    std::size_t done = 0;
    for (; done < materials.size() && exchange(p, materials[done], true); ++done) continue;
    if (done == materials.size()) return true;
    while (done > 0) exchange(p, materials[--done], false);
    return false;
  }

  /// Puts what a material's triangles become into its texture, or takes that back.
  bool exchange(std::uint32_t p, std::uint32_t material, bool forth) {
    std::vector<UvCover::Uvs> before, after;
    UvCover& cover = covers_[material];
    std::uint32_t most = 1;
    for (const std::uint32_t t : fans_[p]) {
      const Triangle own = from(t, p);
      if (s_.wedges[own[0]].material != material) continue;
      before.push_back(uvs_of(s_, own));
      most = std::max(most, cover.at_middle(before.back()));
      const std::uint32_t to = turned(own[0]);
      if (to != own[1] && to != own[2]) after.push_back(uvs_of(s_, {to, own[1], own[2]}));
    }
    return forth ? cover.replace(before, after, most) : cover.replace(after, before, kAnyNumber);
  }

  void make(std::uint32_t p, std::uint32_t q) {
    std::vector<std::uint32_t> around{q};
    for (const Spoke& spoke : spokes_) {
      if (spoke.to != q) around.push_back(spoke.to);
    }
    for (const std::uint32_t t : fans_[p]) {
      const Triangle own = from(t, p);
      if (place(own[1]) == q || place(own[2]) == q) {
        for (const std::uint32_t w : {own[1], own[2]}) std::erase(fans_[place(w)], t);
        s_.triangles[t] = {0, 0, 0};
        --left_;
      } else {
        s_.triangles[t] = {turned(own[0]), own[1], own[2]};
        fans_[q].push_back(t);
      }
    }
    quadrics_[q].add(quadrics_[p]);
    for (std::size_t k = 0; k < turned_.size(); ++k) {
      if (k == 0 || turned_[0] != turned_[k])
        slides_[turned_[k].second].add(slides_[turned_[k].first]);
    }
    fans_[p] = {};
    ++stamps_[p];
    for (const std::uint32_t r : around) choose(r);
  }

  static constexpr std::uint32_t kAnyNumber = 1U << 30U;

  WedgeSurface& s_;
  std::vector<UvCover>& covers_;
  double most_error_;
  std::vector<Vec3d> points_;
  std::vector<std::vector<std::uint32_t>> fans_;  ///< by place: triangles
  std::vector<Quadric> quadrics_;
  std::vector<Slide> slides_;  ///< by wedge
  double slide_weight_ = 0;
  std::vector<char> stays_;
  std::vector<std::uint32_t> stamps_;  ///< of the last choice
  std::size_t left_;
  std::priority_queue<Step> queue_;
  std::unordered_set<std::uint64_t> refused_;  ///< for want of room
  std::vector<Spoke> spokes_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> turned_;
};

}  // namespace

std::vector<UvCover> covers_of(const WedgeSurface& surface, std::uint32_t edge) {
  std::vector<UvCover> covers;
  for (const Triangle& t : surface.triangles) {
    const std::uint32_t material = surface.wedges[t[0]].material;
    while (covers.size() <= material) covers.emplace_back(edge);
    covers[material].add(uvs_of(surface, t));
  }
  return covers;
}

void collapse(WedgeSurface& surface, std::vector<UvCover>& covers, std::size_t triangles,
              double distance, const std::function<void()>& poll) {
  if (surface.triangles.size() > triangles)
    Collapser(surface, covers, distance).run(triangles, poll);
}

}  // namespace pounce::meshing
