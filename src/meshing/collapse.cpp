// SPDX-License-Identifier: Apache-2.0
#include "meshing/collapse.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "core/directions.h"
#include "meshing/quadrics.h"

namespace pounce::meshing {
namespace {

/// Of planes on edges, beside a square of the edge's length on the surface.
constexpr double kBorderWeight = 10, kSeamWeight = 1;
/// Of a texel that slides, beside the surface moving as far.
constexpr double kSlideWeight = 0.02;
constexpr double kTurn = 0.25;  ///< cosine: a triangle may turn so far at once
/// Triangles of a place that may move, or be moved to: work grows with their square.
constexpr std::size_t kMostAround = 64;
/// Of a place with more, those that have gone are dropped by and by.
constexpr std::size_t kManyAround = 1024;
constexpr std::size_t kOften = 1U << 16U;  ///< triangles looked at between two polls
constexpr std::size_t kTexelsAsOne = 16;   ///< take as long as a triangle
constexpr std::size_t kMostRefused = 2;
/// More than any texture set has: a material that fills so many periods is stacked or tiles.
constexpr double kMostLayers = 4;

struct Step {
  double cost = 0;
  std::uint32_t from = 0, to = 0, stamp = 0;
  bool operator<(const Step& other) const {  // the least comes first
    return std::tie(other.cost, other.from) < std::tie(cost, from);
  }
};
/// Of the queue, for each place: one step that is meant, and half a one that is not any more.
constexpr std::uint64_t kBytesOfSteps = sizeof(Step) * 3 / 2;

class Collapser {
 public:
  Collapser(WedgeSurface& surface, std::vector<UvCover>& covers, double distance,
            const std::function<void()>& poll)
      : s_(surface),
        covers_(covers),
        poll_(poll),
        most_error_(distance * distance),
        fans_(surface.places.size()),
        quadrics_(surface.places.size()),
        slides_(surface.wedges.size()),
        stays_(surface.places.size(), 0),
        stamps_(surface.places.size()),
        slots_(surface.places.size()),
        left_(surface.triangles.size()) {
    const Vec3d first = s_.places.empty() ? Vec3d{} : Vec3d(s_.places.front());
    points_.reserve(s_.places.size());
    for (const Vec3f& p : s_.places) points_.push_back(Vec3d(p) - first);
    queue_.reserve(s_.places.size() + s_.places.size() / 2 + 1);
    double area = 0, uv_area = 0;
    for (std::uint32_t t = 0; t < s_.triangles.size(); ++t) {
      count_work(1);
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

  void run(std::size_t triangles) {
    for (std::uint32_t p = 0; p < fans_.size(); ++p) choose(p);
    while (left_ > triangles && !queue_.empty()) {
      std::pop_heap(queue_.begin(), queue_.end());
      const Step step = queue_.back();
      queue_.pop_back();
      count_work(1);
      if (step.stamp != stamps_[step.from]) continue;
      // What lies two edges away may have changed since.
      if (!is_possible(step.from, step.to)) {
        choose(step.from);
      } else if (!find_room(step.from)) {
        refuse(step.from, step.to);
      } else {
        make(step.from, step.to);
      }
    }
    std::vector<Triangle> kept;
    for (const Triangle& t : s_.triangles) {
      if (!is_gone(t)) kept.push_back(t);
    }
    s_.triangles = std::move(kept);
    drop_unused(s_);
  }

 private:
  /// An edge that leads away from a place: how many triangles have it, and of the first one the
  /// wedges at both ends.
  struct Spoke {
    std::uint32_t to = 0, own_wedge = 0, far_wedge = 0, count = 0;
    bool is_seam = false, is_shared = false;  ///< shared: with the place that it may move to
    Vec3d normal;                             ///< of a triangle that has it
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

  void count_work(std::size_t triangles) {
    work_ += triangles;
    if (work_ < kOften) return;
    work_ = 0;
    poll_();
  }
  static bool is_gone(const Triangle& t) { return t[0] == t[1]; }
  void refuse(std::uint32_t p, std::uint32_t q) {
    // There may be so many for each place, on average; then those that meet another stay.
    if (refused_.size() < kMostRefused * fans_.size()) {
      refused_.insert(key(p, q));
    } else {
      stays_[p] = 1;
    }
    choose(p);
  }
  bool has_many(std::uint32_t p) const { return fans_[p].size() > kMostAround; }

  /// The spoke to a place, if there is one.
  Spoke* spoke_to(std::uint32_t to) {
    const std::uint32_t k = slots_[to];
    return k < spokes_.size() && spokes_[k].to == to ? &spokes_[k] : nullptr;
  }

  void find_spokes(std::uint32_t p) {
    spokes_.clear();
    for (const std::uint32_t t : fans_[p]) {
      const Triangle own = from(t, p);
      for (const std::uint32_t far : {own[1], own[2]}) {
        if (Spoke* same = spoke_to(place(far)); same != nullptr) {
          ++same->count;
          same->is_seam = same->is_seam || same->own_wedge != own[0] || same->far_wedge != far;
          continue;
        }
        const Vec3d a = points_[p];
        const Vec3d normal =
            unit_vector(cross(points_[place(own[1])] - a, points_[place(own[2])] - a));
        slots_[place(far)] = static_cast<std::uint32_t>(spokes_.size());
        spokes_.push_back({place(far), own[0], far, 1, false, false, normal});
      }
    }
  }

  /// What is known of a place before anything has moved.
  void look_at(std::uint32_t p) {
    count_work(fans_[p].size());
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

  /// Can one go around the place from triangle to triangle? After find_spokes().
  bool is_one_fan(std::uint32_t p) {
    std::vector<std::uint32_t> parents(spokes_.size());
    std::iota(parents.begin(), parents.end(), 0U);
    const auto root = [&](std::uint32_t k) {
      while (parents[k] != k) k = parents[k] = parents[parents[k]];
      return k;
    };
    std::size_t parts = parents.size();
    for (const std::uint32_t t : fans_[p]) {
      const Triangle own = from(t, p);
      const std::uint32_t b = root(slots_[place(own[1])]), c = root(slots_[place(own[2])]);
      if (b != c) --parts;
      parents[b] = c;
    }
    return parts <= 1;
  }

  /// Finds where the place goes next, if anywhere.
  void choose(std::uint32_t p) {
    ++stamps_[p];
    if (stays_[p] != 0 || fans_[p].empty() || has_many(p)) return;
    find_spokes(p);
    std::vector<std::pair<double, std::uint32_t>> ways;
    for (const Spoke& spoke : spokes_) {
      if (has_many(spoke.to)) continue;
      count_work(fans_[p].size());
      const Vec3d to = points_[spoke.to];
      const Quadric& own = quadrics_[p];
      const double error = own.at(to);
      if (error > most_error_ * own.weight || refused_.contains(key(p, spoke.to))) continue;
      ways.emplace_back(error + quadrics_[spoke.to].at(to) + slide_of(p, spoke.to), spoke.to);
    }
    std::sort(ways.begin(), ways.end());
    for (const auto& way : ways) {
      if (!is_possible(p, way.second)) continue;
      add_to_queue({way.first, p, way.second, stamps_[p]});
      return;
    }
  }

  /// It never grows beyond what it has room for: of each place one step at most is still meant.
  void add_to_queue(const Step& step) {
    if (queue_.size() == queue_.capacity()) {
      std::erase_if(queue_, [this](const Step& s) { return s.stamp != stamps_[s.from]; });
      std::make_heap(queue_.begin(), queue_.end());
    }
    queue_.push_back(step);
    std::push_heap(queue_.begin(), queue_.end());
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
    if (has_many(p) || has_many(q)) return false;
    count_work(fans_[p].size() + fans_[q].size());
    find_spokes(p);
    const Spoke* way = spoke_to(q);
    const bool on_border =
        std::any_of(spokes_.begin(), spokes_.end(), [](const Spoke& s) { return s.count == 1; });
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
  bool keeps_topology(std::uint32_t p, std::uint32_t q, std::uint32_t going) {
    std::uint32_t common = 0;
    for (const std::uint32_t t : fans_[q]) {
      const Triangle own = from(t, q);
      for (const std::uint32_t far : {own[1], own[2]}) {
        Spoke* spoke = spoke_to(place(far));
        if (spoke == nullptr || spoke->is_shared) continue;
        spoke->is_shared = true;
        ++common;
      }
    }
    if (common != going) return false;
    for (const std::uint32_t t : fans_[p]) {
      const Triangle own = from(t, p);
      const std::uint32_t b = place(own[1]), c = place(own[2]);
      if (b == q || c == q || !spoke_to(b)->is_shared || !spoke_to(c)->is_shared) continue;
      for (const std::uint32_t other : fans_[q]) {
        const Triangle far = from(other, q);
        if (std::minmax(place(far[1]), place(far[2])) == std::minmax(b, c)) return false;
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
    const bool is_done =
        forth ? cover.replace(before, after, most) : cover.replace(after, before, kAnyNumber);
    count_work(cover.texels_looked_at() / kTexelsAsOne);
    return is_done;
  }

  void make(std::uint32_t p, std::uint32_t q) {
    std::vector<std::uint32_t> around{q};
    for (const Spoke& spoke : spokes_) {
      if (spoke.to != q) around.push_back(spoke.to);
    }
    for (const std::uint32_t t : fans_[p]) {
      const Triangle own = from(t, p);
      if (place(own[1]) == q || place(own[2]) == q) {
        for (const std::uint32_t w : {own[1], own[2]}) take_from(place(w), t);
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
    std::vector<std::uint32_t>().swap(fans_[p]);  // its memory, too
    ++stamps_[p];
    for (const std::uint32_t r : around) choose(r);
  }

  /// Nothing reads the fan of a place with so many triangles that some of those gone may be in it.
  void take_from(std::uint32_t p, std::uint32_t t) {
    std::vector<std::uint32_t>& fan = fans_[p];
    if (fan.size() <= kManyAround) {
      std::erase(fan, t);
      return;
    }
    std::size_t& late = late_[p];
    if (2 * ++late <= fan.size()) return;
    std::erase_if(fan, [&](std::uint32_t own) { return own == t || is_gone(s_.triangles[own]); });
    late = 0;
  }

  static constexpr std::uint32_t kAnyNumber = 1U << 30U;

  WedgeSurface& s_;
  std::vector<UvCover>& covers_;
  const std::function<void()>& poll_;
  double most_error_;
  std::vector<Vec3d> points_;
  std::vector<std::vector<std::uint32_t>> fans_;  ///< by place: triangles
  std::vector<Quadric> quadrics_;
  std::vector<Slide> slides_;  ///< by wedge
  double slide_weight_ = 0;
  std::vector<char> stays_;
  std::vector<std::uint32_t> stamps_;  ///< of the last choice
  std::vector<std::uint32_t> slots_;   ///< by place: which of `spokes_` leads there, if one does
  std::size_t left_, work_ = 0;
  std::vector<Step> queue_;                              ///< a heap
  std::unordered_map<std::uint32_t, std::size_t> late_;  ///< by place: triangles gone of its fan
  std::unordered_set<std::uint64_t> refused_;            ///< for want of room
  std::vector<Spoke> spokes_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> turned_;
};

}  // namespace

std::vector<UvCover> covers_of(const WedgeSurface& surface, std::uint32_t edge) {
  std::vector<double> periods;  // that each material fills
  const auto material_of = [&](const Triangle& t) { return surface.wedges[t[0]].material; };
  for (const Triangle& t : surface.triangles) {
    if (periods.size() <= material_of(t)) periods.resize(material_of(t) + 1);
    const std::array<Vec2f, 3> uvs = uvs_of(surface, t);
    if (UvCover::counts(uvs)) periods[material_of(t)] += std::abs(turn_of(uvs)) / 2;
  }
  std::vector<UvCover> covers;
  covers.reserve(periods.size());
  for (const double own : periods) {
    const double scale = std::sqrt(std::min(1.0, kMostLayers / std::max(own, kMostLayers)));
    covers.emplace_back(std::max(1U, static_cast<std::uint32_t>(edge * scale)));
  }
  for (const Triangle& t : surface.triangles) covers[material_of(t)].add(uvs_of(surface, t));
  return covers;
}

std::uint64_t collapsing_bytes_of(const WedgeSurface& surface) {
  constexpr std::uint64_t kBlock = 16;  // what an allocation takes beside its contents, rounded up
  constexpr std::uint64_t kOfRefused = 2 * kBlock + sizeof(std::uint64_t) + 2 * sizeof(void*);
  constexpr std::uint64_t kFan = sizeof(std::vector<std::uint32_t>) + 2 * kBlock;
  constexpr std::uint64_t kOfPlace = sizeof(Vec3d) + kFan + sizeof(Quadric) + sizeof(char) +
                                     2 * sizeof(std::uint32_t) + kBytesOfSteps +
                                     kMostRefused * kOfRefused;
  // The surface itself, the dense one beside it, and what dropping the unused makes anew.
  constexpr std::uint64_t kCopies = 3;
  return surface.places.size() * (kOfPlace + kCopies * sizeof(Vec3f)) +
         surface.wedges.size() * (sizeof(Slide) + kCopies * sizeof(Wedge)) +
         surface.triangles.size() * (6 * sizeof(std::uint32_t) + kCopies * sizeof(Triangle));
}

void collapse(WedgeSurface& surface, std::vector<UvCover>& covers, std::size_t triangles,
              double distance, const std::function<void()>& poll) {
  if (surface.triangles.size() > triangles)
    Collapser(surface, covers, distance, poll).run(triangles);
}

}  // namespace pounce::meshing
