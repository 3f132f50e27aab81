// SPDX-License-Identifier: Apache-2.0
#include "unwrap/outline.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <tuple>

namespace pounce::unwrap {

double area_of(const Chart& chart) {
  double twice = 0;
  for (std::size_t i = 0; i < chart.corners.size(); i += 3) {
    const Vec2d a = chart.corners[i], b = chart.corners[i + 1], c = chart.corners[i + 2];
    twice += std::abs((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x));
  }
  return twice / 2;
}

double Outline::length() const {
  double sum = 0;
  for (const auto& [a, b] : edges) {
    const Vec2d along = b - a;
    sum += std::sqrt(along.x * along.x + along.y * along.y);
  }
  return sum;
}

Box Outline::box(const Turn& turn) const {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Box box{{kInfinity, kInfinity}, {-kInfinity, -kInfinity}};
  for (const auto& [a, b] : edges) {
    for (const Vec2d corner : {a, b}) {
      const Vec2d p = turn.of(corner);
      box.low = {std::min(box.low.x, p.x), std::min(box.low.y, p.y)};
      box.high = {std::max(box.high.x, p.x), std::max(box.high.y, p.y)};
    }
  }
  return box;
}

Turn Outline::best_turn() const {
  constexpr int kTurns = 24;
  Turn best;
  double least = std::numeric_limits<double>::infinity();
  for (int k = 0; k < kTurns; ++k) {
    const double t = kEighth * k / kTurns;
    const Turn turn{(1 - t * t) / (1 + t * t), 2 * t / (1 + t * t)};
    for (const Turn& own : {turn, Turn{turn.sine, turn.cosine}}) {  // up to 45 degrees, and beyond
      const Box now = box(own);
      const double area = now.width() * now.height();
      if (!(area < least)) continue;
      least = area;
      best = now.width() >= now.height() ? own : own.quarter(1);
    }
  }
  return best;
}

Outline outline_of(const Chart& chart) {
  struct Edge {
    std::uint32_t low, high, from;  ///< points; the corner from which it goes to the next
    bool is_along;                  ///< from the lower point to the higher one
  };
  std::vector<Edge> edges;
  Outline outline;
  const auto next = [](std::uint32_t corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; };
  for (std::uint32_t c = 0; c < chart.points.size(); ++c) {
    const std::uint32_t a = chart.points[c], b = chart.points[next(c)];
    edges.push_back({std::min(a, b), std::max(a, b), c, a < b});
  }
  std::sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) {
    return std::tie(a.low, a.high, a.from) < std::tie(b.low, b.high, b.from);
  });
  for (std::size_t first = 0, end = 0; first < edges.size(); first = end) {
    // What is gone along in both directions is inside.
    std::array<std::vector<std::uint32_t>, 2> ways;
    for (; end < edges.size() && edges[end].low == edges[first].low &&
           edges[end].high == edges[first].high;
         ++end)
      ways[edges[end].is_along ? 1 : 0].push_back(edges[end].from);
    for (const auto& way : ways) {
      const std::size_t inner = std::min(ways[0].size(), ways[1].size());
      for (std::size_t i = inner; i < way.size(); ++i)
        outline.edges.emplace_back(chart.corners[way[i]], chart.corners[next(way[i])]);
    }
  }
  return outline;
}

}  // namespace pounce::unwrap
