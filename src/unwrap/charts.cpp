// SPDX-License-Identifier: Apache-2.0
//
// Charts are grown from triangle to triangle as long as all of them face about alike, and joined
// where that still holds. So each can be laid flat by looking at it from its side: nothing is
// turned over, and nothing is stretched by more than the cone allows. It may still lie behind
// itself, as a spiral staircase does: then it is cut between the two that overlap, and both parts
// are looked at again.
#include "unwrap/charts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <queue>
#include <tuple>
#include <utility>

#include "core/directions.h"

namespace pounce::unwrap {
namespace {

/// Of a triangle's normal with its chart's axis: while the chart grows, once it is joined to
/// another, and at last (a stretch of 1.6, and of 2 where tiny ones were joined).
constexpr double kGrowing = 0.75, kJoined = 0.71, kWithin = 0.62;
/// Charts of less than this share of the area are joined even so: each costs a gutter around it.
constexpr double kTiny = 1.0 / 500, kTinyJoined = 0.5;
constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

class Cutter {
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
    find_neighbours();
  }

  std::vector<Chart> make() {
    grow();
    join();
    std::vector<Chart> charts;
    for (std::vector<std::uint32_t>& members : charts_) {
      if (!members.empty()) flatten(std::move(members), charts);
    }
    return charts;
  }

 private:
  /// Triangles that share an edge; one with more or fewer than two sides is a border.
  void find_neighbours() {
    using Edge = std::tuple<std::uint32_t, std::uint32_t, std::uint32_t>;
    std::vector<Edge> edges;
    for (std::uint32_t t = 0; t < triangles_.size(); ++t) {
      for (std::uint32_t k = 0; k < 3; ++k) {
        const auto [a, b] = std::minmax(triangles_[t][k], triangles_[t][(k + 1) % 3]);
        edges.emplace_back(a, b, 3 * t + k);
      }
    }
    std::sort(edges.begin(), edges.end());
    neighbours_.assign(3 * triangles_.size(), kNone);
    for (std::size_t i = 0; i + 1 < edges.size(); ++i) {
      const auto same = [&](std::size_t j) {
        return j < edges.size() && std::get<0>(edges[j]) == std::get<0>(edges[i]) &&
               std::get<1>(edges[j]) == std::get<1>(edges[i]);
      };
      if (!same(i + 1)) continue;
      if (same(i + 2)) {
        while (same(i + 1)) ++i;
        continue;
      }
      const std::uint32_t a = std::get<2>(edges[i]), b = std::get<2>(edges[i + 1]);
      neighbours_[a] = b / 3;
      neighbours_[b] = a / 3;
      ++i;
    }
  }
  template <class F>
  void for_neighbours(std::uint32_t t, const F& f) const {
    for (std::uint32_t k = 0; k < 3; ++k) {
      if (neighbours_[3 * t + k] != kNone) f(neighbours_[3 * t + k], k);
    }
  }
  double facing(std::uint32_t t, Vec3d axis) const {
    return normals_[t] == Vec3d{} ? 1 : dot(normals_[t], axis);
  }
  Vec3d axis_of(const std::vector<std::uint32_t>& members) const {
    Vec3d sum{};
    for (const std::uint32_t t : members) sum = sum + areas_[t];
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
      const Vec3d axis = length(sum) > 0 ? unit_vector(sum) : normals_[t];
      if (facing(t, axis) < kGrowing) continue;
      chart_of_[t] = own;
      members.push_back(t);
      sum = sum + areas_[t];
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

  // --- laid flat ---------------------------------------------------------------------------------

  void flatten(std::vector<std::uint32_t> members, std::vector<Chart>& charts) {
    std::deque<std::vector<std::uint32_t>> waiting{std::move(members)};
    while (!waiting.empty()) {
      poll_();
      Chart chart;
      chart.triangles = std::move(waiting.front());
      waiting.pop_front();
      project(chart);
      if (const auto overlap = find_overlap(chart)) {
        auto [one, other] = cut(chart.triangles, overlap->first, overlap->second);
        waiting.push_back(std::move(one));
        waiting.push_back(std::move(other));
      } else {
        charts.push_back(std::move(chart));
      }
    }
  }
  void project(Chart& chart) const {
    const Vec3d n = axis_of(chart.triangles);
    const Vec3d right =
        unit_vector(cross(std::abs(n.y) < 0.9 ? Vec3d{0, 1, 0} : Vec3d{1, 0, 0}, n));
    const Vec3d down = cross(right, n);  // right x down leads away from whoever looks
    double in_space = 0, flat = 0;
    for (const std::uint32_t t : chart.triangles) {
      for (const std::uint32_t v : triangles_[t]) {
        const Vec3d p(positions_[v]);
        chart.corners.push_back({dot(p, right), dot(p, down)});
      }
      in_space += length(areas_[t]);
      flat += std::abs(dot(areas_[t], n));
    }
    const double scale = flat > 0 ? std::sqrt(in_space / flat) : 1;
    for (Vec2d& corner : chart.corners) corner = corner * scale;
  }

  /// The area that two triangles have in common.
  static double common_area(const Vec2d* a, const Vec2d* b) {
    std::array<Vec2d, 10> polygon{a[0], a[1], a[2]}, next;
    std::size_t count = 3;
    const auto side = [](Vec2d p, Vec2d q, Vec2d r) {
      return (q.x - p.x) * (r.y - p.y) - (q.y - p.y) * (r.x - p.x);
    };
    const double sign = side(b[0], b[1], b[2]) < 0 ? -1 : 1;
    for (std::size_t k = 0; k < 3 && count > 0; ++k) {
      const Vec2d from = b[k], to = b[(k + 1) % 3];
      std::size_t kept = 0;
      for (std::size_t i = 0; i < count; ++i) {
        const Vec2d p = polygon[i], q = polygon[(i + 1) % count];
        const double at_p = sign * side(from, to, p), at_q = sign * side(from, to, q);
        if (at_p >= 0) next[kept++] = p;
        if ((at_p < 0) != (at_q < 0)) {
          const double t = at_p / (at_p - at_q);
          next[kept++] = p + (q - p) * t;
        }
      }
      polygon.swap(next);
      count = kept;
    }
    double twice = 0;
    for (std::size_t i = 2; i < count; ++i) twice += side(polygon[0], polygon[i - 1], polygon[i]);
    return std::abs(twice) / 2;
  }

  /// Is what they have in common more than rounding makes of it?
  static bool in_common(const Vec2d* a, const Vec2d* b, double area_a, double area_b,
                        double longest_squared) {
    const auto apart = [](double a0, double a1, double a2, double b0, double b1, double b2) {
      return std::max({a0, a1, a2}) < std::min({b0, b1, b2}) ||
             std::max({b0, b1, b2}) < std::min({a0, a1, a2});
    };
    if (apart(a[0].x, a[1].x, a[2].x, b[0].x, b[1].x, b[2].x) ||
        apart(a[0].y, a[1].y, a[2].y, b[0].y, b[1].y, b[2].y))
      return false;
    constexpr double kRounding = 1e-7, kOfLongest = 3e-6;
    return common_area(a, b) > kRounding * std::min(area_a, area_b) + kOfLongest * longest_squared;
  }

  /// Two triangles of a chart that overlap, by their numbers in it. Cells of a grid hold those that
  /// lie there.
  static std::optional<std::pair<std::size_t, std::size_t>> find_overlap(const Chart& chart) {
    const std::size_t count = chart.triangles.size();
    if (count < 2) return std::nullopt;
    Vec2d low = chart.corners.front(), high = low;
    for (const Vec2d p : chart.corners) {
      low = {std::min(low.x, p.x), std::min(low.y, p.y)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y)};
    }
    const double size = std::max(high.x - low.x, high.y - low.y);
    if (size == 0) return std::nullopt;
    const auto cells =
        static_cast<std::size_t>(std::clamp(std::sqrt(static_cast<double>(count)), 1.0, 1024.0));
    const double per_unit = static_cast<double>(cells) / size;
    const auto cell = [&](double v, double from) {
      return std::min(static_cast<std::size_t>(std::max((v - from) * per_unit, 0.0)), cells - 1);
    };
    std::vector<std::vector<std::uint32_t>> grid(cells * cells);
    std::vector<double> areas(count), lengths(count);  // the longest edge, squared
    for (std::size_t i = 0; i < count; ++i) {
      const Vec2d* const own = &chart.corners[3 * i];
      areas[i] = std::abs((own[1].x - own[0].x) * (own[2].y - own[0].y) -
                          (own[1].y - own[0].y) * (own[2].x - own[0].x)) /
                 2;
      for (std::size_t k = 0; k < 3; ++k) {
        const Vec2d edge = own[(k + 1) % 3] - own[k];
        lengths[i] = std::max(lengths[i], edge.x * edge.x + edge.y * edge.y);
      }
      const double y0 = std::min({own[0].y, own[1].y, own[2].y}),
                   y1 = std::max({own[0].y, own[1].y, own[2].y});
      for (std::size_t y = cell(y0, low.y); y <= cell(y1, low.y); ++y) {
        auto [from, to] = span_between(own, low.y + static_cast<double>(y) / per_unit,
                                       low.y + static_cast<double>(y + 1) / per_unit);
        if (from > to) {  // by rounding alone: anywhere
          from = std::min({own[0].x, own[1].x, own[2].x});
          to = std::max({own[0].x, own[1].x, own[2].x});
        }
        // A cell more, since what lies on the line between two may be rounded to either.
        const std::size_t first = cell(from, low.x), last = cell(to, low.x);
        for (std::size_t x = first - (first > 0 ? 1 : 0); x <= std::min(last + 1, cells - 1); ++x) {
          for (const std::uint32_t j : grid[y * cells + x]) {
            if (j != i && in_common(own, &chart.corners[3 * j], areas[i], areas[j],
                                    std::max(lengths[i], lengths[j])))
              return std::pair(std::size_t{j}, i);
          }
          grid[y * cells + x].push_back(static_cast<std::uint32_t>(i));
        }
      }
    }
    return std::nullopt;
  }

  /// What is nearer, in steps from triangle to triangle, to the one or to the other.
  std::pair<std::vector<std::uint32_t>, std::vector<std::uint32_t>> cut(
      const std::vector<std::uint32_t>& members, std::size_t one, std::size_t other) {
    std::map<std::uint32_t, int> side;
    for (const std::uint32_t t : members) side[t] = -1;
    std::deque<std::uint32_t> open{members[one], members[other]};
    side[members[one]] = 0;
    side[members[other]] = 1;
    while (!open.empty()) {
      const std::uint32_t t = open.front();
      open.pop_front();
      for_neighbours(t, [&](std::uint32_t next, std::uint32_t) {
        const auto found = side.find(next);
        if (found == side.end() || found->second >= 0) return;
        found->second = side[t];
        open.push_back(next);
      });
    }
    std::pair<std::vector<std::uint32_t>, std::vector<std::uint32_t>> parts;
    for (const std::uint32_t t : members)  // what hangs together with neither goes with the first
      (side[t] == 1 ? parts.second : parts.first).push_back(t);
    return parts;
  }

  std::span<const Vec3f> positions_;
  std::span<const Triangle> triangles_;
  const std::function<void()>& poll_;
  std::vector<Vec3d> areas_, normals_;     ///< of triangles: normal times area; unit, or 0
  std::vector<std::uint32_t> neighbours_;  ///< three for each
  std::vector<std::uint32_t> chart_of_;
  std::vector<std::vector<std::uint32_t>> charts_;
};

}  // namespace

std::pair<double, double> span_between(const Vec2d* triangle, double y0, double y1) {
  double from = std::numeric_limits<double>::infinity(), to = -from;
  for (std::size_t k = 0; k < 3; ++k) {
    Vec2d a = triangle[k], b = triangle[(k + 1) % 3];
    if (a.y > b.y) std::swap(a, b);
    if (b.y < y0 || a.y > y1) continue;
    for (const double y : {std::max(a.y, y0), std::min(b.y, y1)}) {
      const double x = b.y > a.y ? a.x + (b.x - a.x) * ((y - a.y) / (b.y - a.y)) : a.x;
      from = std::min(from, x);
      to = std::max(to, x);
    }
    if (b.y > a.y) continue;
    from = std::min(from, b.x);
    to = std::max(to, b.x);
  }
  return {from, to};
}

std::vector<Chart> make_charts(std::span<const Vec3f> positions,
                               std::span<const Triangle> triangles,
                               const std::function<void()>& poll) {
  return Cutter(positions, triangles, poll).make();
}

}  // namespace pounce::unwrap
