// SPDX-License-Identifier: Apache-2.0
//
// Charts are grown from triangle to triangle as long as all of them face about alike, and joined
// where that still holds. What counts is where the surface faces around a triangle, not the
// triangle's own normal: a capture's surface is rough, and would fall into thousands of charts.
//
// Each is laid flat. Where it cannot be, since it curves too much or lies behind itself as a spiral
// staircase does, it is cut in two, and both parts are tried again.
#include "unwrap/charts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <map>
#include <numeric>
#include <optional>
#include <queue>
#include <tuple>
#include <utility>

#include "core/directions.h"
#include "unwrap/flatten.h"
#include "unwrap/halve.h"
#include "unwrap/neighbours.h"
#include "unwrap/outline.h"

namespace pounce::unwrap {
namespace {

/// Cosine of where a triangle faces with its chart's axis: while the chart grows, once it is joined
/// to another, and at last.
constexpr double kGrowing = 0.6, kJoined = 0.62, kWithin = 0.5;
constexpr double kFromSeed = 0.4;  ///< of where two triangles face, while it grows
/// Charts of less than this share of the area are joined even so: each costs a gutter around it.
constexpr double kTiny = 1.0 / 500, kTinyJoined = 0.2;
/// So many times a triangle faces as it and its neighbours do, at most; of a mesh with few
/// triangles each is a part of the shape, and no roughness.
constexpr int kSmoothing = 4;
constexpr double kSmoothingPerSide = 1.0 / 40;  ///< of the root of their number

/// What a cut costs, of its length times the root of the area of all.
constexpr double kCutCost = 0.005;

/// No more than this share of a chart's area may be stretched by more than that.
constexpr double kStretched = 0.1, kStretch = 1.6;

}  // namespace

class Charts::Cutter {
 public:
  Cutter(std::span<const Vec3f> positions, std::span<const Triangle> triangles,
         const std::function<void()>& poll)
      : positions_(positions), triangles_(triangles), poll_(poll) {
    for (const Triangle& t : triangles) {
      const Vec3d a(positions[t[0]]), b(positions[t[1]]), c(positions[t[2]]);
      areas_.push_back(cross(b - a, c - a) * 0.5);
      const double size = length(areas_.back());
      // Which way a sliver faces is a matter of rounding.
      constexpr double kSliver = 1e-6;
      const double longest = std::max({dot(b - a, b - a), dot(c - b, c - b), dot(a - c, a - c)});
      normals_.push_back(size > kSliver * longest ? areas_.back() * (1 / size) : Vec3d{});
    }
    neighbours_ = find_neighbours(triangles_, normals_);
    marks_.resize(triangles.size());
    numbers_.resize(triangles.size());
    facing_ = normals_;
    const double side = std::sqrt(static_cast<double>(triangles.size()));
    const int rounds = std::min(kSmoothing, static_cast<int>(side * kSmoothingPerSide));
    for (int round = 0; round < rounds; ++round) {
      const std::vector<Vec3d> before = facing_;
      for (std::uint32_t t = 0; t < triangles_.size(); ++t) {
        Vec3d sum = before[t] * length(areas_[t]);
        for_neighbours(t, [&](std::uint32_t next, std::uint32_t) {
          sum = sum + before[next] * length(areas_[next]);
        });
        if (length(sum) > 0) facing_[t] = unit_vector(sum);
      }
    }
  }

  std::vector<Chart> make() {
    grow();
    join();
    straighten();
    std::vector<Chart> charts;
    for (std::vector<std::uint32_t>& members : charts_) {
      if (!members.empty()) flatten(std::move(members), charts);
    }
    return charts;
  }

  std::vector<Chart> cut_unwieldy(std::vector<Chart> charts, const Unwieldy& limit) {
    double total = 0;
    for (const Chart& chart : charts) total += area_of(chart);
    std::vector<Chart> kept;
    while (!charts.empty()) {
      std::vector<Chart> cut_now;
      for (Chart& chart : charts) {
        poll_();
        auto [first, second] = cut(chart, limit, total);
        const bool is_whole = first.empty() || second.empty();
        if (is_whole) kept.push_back(std::move(chart));
        for (auto* part : {&first, &second}) {
          if (!is_whole) flatten(std::move(*part), cut_now);
        }
      }
      charts = std::move(cut_now);
    }
    return kept;
  }

 private:
  template <class F>
  void for_neighbours(std::uint32_t t, const F& f) const {
    for (std::uint32_t k = 0; k < 3; ++k) {
      if (neighbours_[3 * t + k] != kNone) f(neighbours_[3 * t + k], k);
    }
  }
  double facing(std::uint32_t t, Vec3d axis) const {
    return facing_[t] == Vec3d{} ? 1 : dot(facing_[t], axis);
  }
  /// As much of it as the triangle is large.
  Vec3d weighed(std::uint32_t t) const { return facing_[t] * length(areas_[t]); }
  Vec3d axis_of(const std::vector<std::uint32_t>& members) const {
    Vec3d sum{};
    for (const std::uint32_t t : members) sum = sum + weighed(t);
    return length(sum) > 0 ? unit_vector(sum) : Vec3d{0, 0, 1};
  }

  void grow() {
    chart_of_.assign(triangles_.size(), kNone);
    std::vector<std::uint32_t> seeds(triangles_.size());
    std::iota(seeds.begin(), seeds.end(), 0U);
    std::stable_sort(seeds.begin(), seeds.end(), [&](std::uint32_t a, std::uint32_t b) {
      return dot(areas_[a], areas_[a]) > dot(areas_[b], areas_[b]);
    });
    for (const std::uint32_t seed : seeds) {
      if (chart_of_[seed] == kNone) grow_from(seed);
    }
  }
  void grow_from(std::uint32_t seed) {
    const auto own = static_cast<std::uint32_t>(charts_.size());
    std::vector<std::uint32_t> members;
    using Open = std::pair<double, std::uint32_t>;  // the less it is turned away the sooner
    std::priority_queue<Open, std::vector<Open>, std::greater<>> open;
    open.emplace(0, seed);
    Vec3d sum{};
    while (!open.empty()) {
      const std::uint32_t t = open.top().second;
      open.pop();
      if (chart_of_[t] != kNone) continue;
      const Vec3d axis = length(sum) > 0 ? unit_vector(sum) : facing_[t];
      // The axis follows what comes; it must not walk away from where it began.
      if (facing(t, axis) < kGrowing || facing(t, facing_[seed]) < kFromSeed) continue;
      chart_of_[t] = own;
      members.push_back(t);
      sum = sum + weighed(t);
      for_neighbours(t, [&](std::uint32_t next, std::uint32_t) {
        if (chart_of_[next] == kNone) open.emplace(1 - facing(next, axis), next);
      });
    }
    // The axis has moved on since the first ones came.
    const Vec3d axis = axis_of(members);
    std::erase_if(members, [&](std::uint32_t t) {
      const bool is_out = t != seed && facing(t, axis) < kWithin;
      if (is_out) chart_of_[t] = kNone;
      return is_out;
    });
    if (facing(seed, axis) < kWithin) {
      for (const std::uint32_t t : members) chart_of_[t] = kNone;
      members = {seed};
      chart_of_[seed] = own;
    }
    charts_.push_back(std::move(members));
  }

  /// Joins charts to the neighbour with whom they share the longest border, the smallest first.
  void join() {
    constexpr int kRounds = 4;
    for (int round = 0; round < kRounds; ++round) {
      std::vector<std::pair<double, std::uint32_t>> order;
      double total = 0;
      for (std::uint32_t c = 0; c < charts_.size(); ++c) {
        double area = 0;
        for (const std::uint32_t t : charts_[c]) area += length(areas_[t]);
        if (!charts_[c].empty()) order.emplace_back(area, c);
        total += area;
      }
      std::sort(order.begin(), order.end());
      std::size_t joined = 0;
      for (const auto& [area, c] : order)
        joined += join_to_best(c, area < kTiny * total ? kTinyJoined : kJoined) ? 1 : 0;
      if (joined == 0) break;
    }
  }
  bool join_to_best(std::uint32_t c, double limit) {
    if (charts_[c].empty()) return false;
    std::map<std::uint32_t, double> borders;
    for (const std::uint32_t t : charts_[c]) {
      for_neighbours(t, [&](std::uint32_t next, std::uint32_t k) {
        if (chart_of_[next] == c) return;
        const Vec3d a(positions_[triangles_[t][k]]), b(positions_[triangles_[t][(k + 1) % 3]]);
        borders[chart_of_[next]] += length(b - a);
      });
    }
    std::vector<std::pair<double, std::uint32_t>> order;
    for (const auto& [other, border] : borders) order.emplace_back(-border, other);
    std::sort(order.begin(), order.end());
    for (const auto& [border, other] : order) {
      std::vector<std::uint32_t> both = charts_[other];
      both.insert(both.end(), charts_[c].begin(), charts_[c].end());
      const Vec3d axis = axis_of(both);
      const bool fits = std::all_of(both.begin(), both.end(),
                                    [&](std::uint32_t t) { return facing(t, axis) >= limit; });
      if (!fits) continue;
      for (const std::uint32_t t : charts_[c]) chart_of_[t] = other;
      charts_[other] = std::move(both);
      charts_[c].clear();
      return true;
    }
    return false;
  }

  /// A triangle that more of another chart is around than of its own goes there: borders of teeth
  /// leave gaps that nothing fits into.
  void straighten() {
    constexpr int kRounds = 6;
    for (int round = 0; round < kRounds; ++round) {
      std::vector<Vec3d> axes;
      for (const auto& members : charts_) axes.push_back(axis_of(members));
      bool any = false;
      for (std::uint32_t t = 0; t < triangles_.size(); ++t) {
        const std::uint32_t own = chart_of_[t], other = most_around(t, chart_of_);
        if (other == own || facing(t, axes[other]) < kWithin) continue;
        chart_of_[t] = other;
        any = true;
      }
      if (!any) return;
      for (auto& members : charts_) members.clear();
      for (std::uint32_t t = 0; t < triangles_.size(); ++t) charts_[chart_of_[t]].push_back(t);
    }
  }
  /// Which of these parts has more of the triangle's neighbours than its own has; its own if none.
  template <class Parts>
  std::uint32_t most_around(std::uint32_t t, const Parts& part_of) const {
    const auto count = [&](std::uint32_t part) {
      int found = 0;
      for_neighbours(t, [&](std::uint32_t next, std::uint32_t) { found += part_of[next] == part; });
      return found;
    };
    std::uint32_t best = part_of[t];
    for_neighbours(t, [&](std::uint32_t next, std::uint32_t) {
      if (count(part_of[next]) > count(best)) best = part_of[next];
    });
    return best;
  }

  // --- laid flat ---------------------------------------------------------------------------------

  void flatten(std::vector<std::uint32_t> members, std::vector<Chart>& charts) {
    std::deque<std::vector<std::uint32_t>> waiting;
    for (std::vector<std::uint32_t>& part : connected(members)) waiting.push_back(std::move(part));
    while (!waiting.empty()) {
      poll_();
      Chart chart;
      chart.triangles = std::move(waiting.front());
      waiting.pop_front();
      const auto parts = lay(chart);
      for (const std::vector<std::uint32_t>& part : parts) {
        for (std::vector<std::uint32_t>& own : connected(part)) waiting.push_back(std::move(own));
      }
      if (parts.empty()) charts.push_back(std::move(chart));
    }
  }

  /// What hangs together by edges.
  std::vector<std::vector<std::uint32_t>> connected(const std::vector<std::uint32_t>& members) {
    ++mark_;
    for (const std::uint32_t t : members) marks_[t] = mark_;
    std::vector<std::vector<std::uint32_t>> parts;
    for (const std::uint32_t first : members) {
      if (marks_[first] != mark_) continue;
      std::vector<std::uint32_t>& part = parts.emplace_back();
      part.push_back(first);
      marks_[first] = 0;
      for (std::size_t i = 0; i < part.size(); ++i) {
        for_neighbours(part[i], [&](std::uint32_t next, std::uint32_t) {
          if (marks_[next] != mark_) return;
          marks_[next] = 0;
          part.push_back(next);
        });
      }
    }
    return parts;
  }

  /// The chart as a surface of its own, whose points are those that hang together: where it touches
  /// itself in a vertex there are several.
  Patch patch_of(const std::vector<std::uint32_t>& members) {
    ++mark_;
    for (std::uint32_t i = 0; i < members.size(); ++i) {
      marks_[members[i]] = mark_;
      numbers_[members[i]] = i;
    }
    std::vector<std::uint32_t> corner(3 * members.size());
    std::iota(corner.begin(), corner.end(), 0U);
    const auto root = [&](std::uint32_t c) {
      while (corner[c] != c) c = corner[c] = corner[corner[c]];
      return c;
    };
    for (std::uint32_t i = 0; i < members.size(); ++i) {
      for_neighbours(members[i], [&](std::uint32_t next, std::uint32_t k) {
        if (marks_[next] != mark_) return;
        for (const std::uint32_t own : {k, (k + 1) % 3}) {
          for (std::uint32_t other = 0; other < 3; ++other) {
            if (triangles_[next][other] != triangles_[members[i]][own]) continue;
            const std::uint32_t a = root(3 * i + own), b = root(3 * numbers_[next] + other);
            corner[std::max(a, b)] = std::min(a, b);
          }
        }
      });
    }
    Patch patch;
    std::vector<std::uint32_t> point(corner.size());
    for (std::uint32_t c = 0; c < corner.size(); ++c) {
      if (root(c) == c) {
        point[c] = static_cast<std::uint32_t>(patch.points.size());
        patch.points.emplace_back(positions_[triangles_[members[c / 3]][c % 3]]);
      } else {
        point[c] = point[root(c)];  // which comes before
      }
      if (c % 3 == 2) patch.triangles.push_back({point[c - 2], point[c - 1], point[c]});
    }
    return patch;
  }

  /// Lays a chart flat. Where that does not do: the parts that it is to be cut into.
  std::vector<std::vector<std::uint32_t>> lay(Chart& chart) {
    const Patch patch = patch_of(chart.triangles);
    std::vector<Vec2d> flat = lay_flat(patch, axis_of(chart.triangles), poll_);
    double in_space = 0;
    for (const std::uint32_t t : chart.triangles) in_space += length(areas_[t]);
    for (const Triangle& c : patch.triangles) {
      for (const std::uint32_t v : c) {
        chart.corners.push_back(flat[v]);
        chart.points.push_back(v);
      }
    }
    const double in_plane = area_of(chart);
    const double scale = in_plane > 0 ? std::sqrt(in_space / in_plane) : 1;
    for (auto* points : {&flat, &chart.corners}) {
      for (Vec2d& p : *points) p = p * scale;
    }
    if (chart.triangles.size() == 1) return {};
    double stretched = 0;
    std::vector<std::uint32_t> on_faces, others;
    for (std::size_t i = 0; i < patch.triangles.size(); ++i) {
      const std::uint32_t t = chart.triangles[i];
      const double stretch =
          normals_[t] == Vec3d{} ? 1 : stretch_of(patch, flat, patch.triangles[i]);
      if (stretch > kStretch) stretched += length(areas_[t]);
      (std::isfinite(stretch) ? others : on_faces).push_back(t);
    }
    // A few that cannot lie among the others go alone.
    const bool is_alike = stretched <= kStretched * in_space;
    if (is_alike && !on_faces.empty() && on_faces.size() < others.size()) return {on_faces, others};
    std::optional<std::pair<std::size_t, std::size_t>> apart;
    if (is_alike && on_faces.empty()) {
      apart = find_overlap(chart);
      if (!apart) return {};
    } else {
      apart = poles(chart);
    }
    auto [one, other] = cut(chart.triangles, apart->first, apart->second);
    // A strip from which little is cut each time takes long.
    constexpr std::size_t kLeast = 10;
    if (kLeast * std::min(one.size(), other.size()) < chart.triangles.size()) {
      const auto [first, last] = ends(chart.triangles);
      std::tie(one, other) = cut(chart.triangles, first, last);
    }
    return {std::move(one), std::move(other)};
  }

  /// The triangles of a chart that are farthest apart in where they face.
  std::pair<std::size_t, std::size_t> poles(const Chart& chart) const {
    const auto farthest_from = [&](Vec3d axis, std::size_t but) {
      std::size_t best = but == 0 ? 1 : 0;
      for (std::size_t i = 0; i < chart.triangles.size(); ++i) {
        if (i != but && facing(chart.triangles[i], axis) < facing(chart.triangles[best], axis))
          best = i;
      }
      return best;
    };
    const std::size_t one = farthest_from(axis_of(chart.triangles), chart.triangles.size());
    const std::size_t other = farthest_from(facing_[chart.triangles[one]], one);
    return {one, other};
  }

  /// Two triangles of a chart that are as many steps apart as any, nearly.
  std::pair<std::size_t, std::size_t> ends(const std::vector<std::uint32_t>& members) {
    const auto farthest_from = [&](std::size_t first) {
      ++mark_;
      for (std::uint32_t i = 0; i < members.size(); ++i) {
        marks_[members[i]] = mark_;
        numbers_[members[i]] = i;
      }
      std::vector<std::uint32_t> reached{members[first]};
      marks_[members[first]] = 0;
      for (std::size_t i = 0; i < reached.size(); ++i) {
        for_neighbours(reached[i], [&](std::uint32_t next, std::uint32_t) {
          if (marks_[next] != mark_) return;
          marks_[next] = 0;
          reached.push_back(next);
        });
      }
      return std::size_t{numbers_[reached.back()]};
    };
    const std::size_t one = farthest_from(0), other = farthest_from(one);
    return {one, other != one ? other : (one == 0 ? 1 : 0)};
  }

  /// What is nearer, in steps from triangle to triangle, to the one or to the other.
  std::pair<std::vector<std::uint32_t>, std::vector<std::uint32_t>> cut(
      const std::vector<std::uint32_t>& members, std::size_t one, std::size_t other) {
    // Parts: 1 and 2; 3 is what neither has reached yet; 0 is not of the chart.
    constexpr std::uint32_t kOpen = 3;
    side_.resize(triangles_.size());
    for (const std::uint32_t t : members) side_[t] = kOpen;
    std::vector<std::uint32_t> reached{members[one], members[other]};
    side_[members[one]] = 1;
    side_[members[other]] = 2;
    for (std::size_t i = 0; i < reached.size(); ++i) {
      for_neighbours(reached[i], [&](std::uint32_t next, std::uint32_t) {
        if (side_[next] != kOpen) return;
        side_[next] = side_[reached[i]];
        reached.push_back(next);
      });
    }
    return parts_by_side(members, {members[one], members[other]});
  }

  /// Across an unwieldy chart; nothing, if it is none or no cut helps.
  std::pair<std::vector<std::uint32_t>, std::vector<std::uint32_t>> cut(const Chart& chart,
                                                                        const Unwieldy& limit,
                                                                        double total) {
    if (chart.triangles.size() == 1) return {};
    const Outline outline = outline_of(chart);
    const double long_side = outline.box(outline.best_turn()).width();
    const bool is_long = long_side > limit.length * std::sqrt(total);
    if (!is_long && hull_area(outline) - area_of(chart) <= limit.waste * total) return {};
    const std::vector<char> sides = halves(chart, outline, kCutCost * std::sqrt(total), !is_long);
    if (sides.empty()) return {};
    side_.resize(triangles_.size());
    for (std::size_t i = 0; i < sides.size(); ++i)
      side_[chart.triangles[i]] = sides[i] == 0 ? 1 : 2;
    return parts_by_side(chart.triangles, {kNone, kNone});
  }

  std::pair<std::vector<std::uint32_t>, std::vector<std::uint32_t>> parts_by_side(
      const std::vector<std::uint32_t>& members, std::array<std::uint32_t, 2> stay) {
    constexpr int kRounds = 4;
    for (int round = 0; round < kRounds; ++round) {
      for (const std::uint32_t t : members) {
        if (t == stay[0] || t == stay[1]) continue;
        const std::uint32_t best = most_around(t, side_);
        if (best == 1 || best == 2) side_[t] = best;
      }
    }
    std::pair<std::vector<std::uint32_t>, std::vector<std::uint32_t>> parts;
    for (const std::uint32_t t : members)  // what hangs together with neither goes with the first
      (side_[t] == 2 ? parts.second : parts.first).push_back(t);
    for (const std::uint32_t t : members) side_[t] = 0;
    return parts;
  }

  std::span<const Vec3f> positions_;
  std::span<const Triangle> triangles_;
  const std::function<void()>& poll_;
  std::vector<Vec3d> areas_, normals_;     ///< of triangles: normal times area; unit, or 0
  std::vector<Vec3d> facing_;              ///< the normal around a triangle
  std::vector<std::uint32_t> neighbours_;  ///< three for each
  std::vector<std::uint32_t> chart_of_;
  std::vector<std::uint32_t> side_;  ///< of a cut; 0 outside of one
  std::uint32_t mark_ = 0;
  std::vector<std::uint32_t> marks_;    ///< of triangles: what has `mark_` is of those at hand
  std::vector<std::uint32_t> numbers_;  ///< of them among these
  std::vector<std::vector<std::uint32_t>> charts_;
};

Charts::Charts(std::span<const Vec3f> positions, std::span<const Triangle> triangles,
               const std::function<void()>& poll)
    : cutter_(std::make_unique<Cutter>(positions, triangles, poll)) {}
Charts::~Charts() = default;
std::vector<Chart> Charts::make() { return cutter_->make(); }
std::vector<Chart> Charts::cut(std::vector<Chart> charts, const Unwieldy& limit) {
  return cutter_->cut_unwieldy(std::move(charts), limit);
}

}  // namespace pounce::unwrap
