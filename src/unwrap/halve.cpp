// SPDX-License-Identifier: Apache-2.0
#include "unwrap/halve.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>

namespace pounce::unwrap {
namespace {

/// Leaves them in another order.
double hull_area(std::vector<Vec2d>& points) {
  std::sort(points.begin(), points.end(),
            [](Vec2d a, Vec2d b) { return std::tie(a.x, a.y) < std::tie(b.x, b.y); });
  double twice = 0;
  std::vector<Vec2d> hull;
  const auto turn = [](Vec2d a, Vec2d b, Vec2d c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
  };
  for (int half = 0; half < 2; ++half) {
    hull.clear();
    for (const Vec2d p : points) {
      while (hull.size() >= 2 && turn(hull[hull.size() - 2], hull.back(), p) <= 0) hull.pop_back();
      hull.push_back(p);
    }
    for (std::size_t i = 0; i + 1 < hull.size(); ++i)
      twice += hull[i].x * hull[i + 1].y - hull[i].y * hull[i + 1].x;
    std::reverse(points.begin(), points.end());
  }
  return std::abs(twice) / 2;
}

}  // namespace

double hull_area(const Outline& outline) {
  std::vector<Vec2d> points;
  for (const auto& [a, b] : outline.edges) points.push_back(a);
  return hull_area(points);
}

std::vector<char> halves(const Chart& chart, const Outline& outline, double per_length,
                         bool if_smaller) {
  constexpr int kTurns = 6, kPlaces = 16;
  constexpr double kLeast = 0.1;  // of both hulls, what the smaller one must be
  double least = if_smaller ? hull_area(outline) : std::numeric_limits<double>::infinity();
  double best_at = 0;
  Vec2d best{};
  std::array<std::vector<Vec2d>, 2> sides;
  const auto look = [&](Vec2d way) {
    const auto along = [&](Vec2d p) { return p.x * way.x + p.y * way.y; };
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const auto& [a, b] : outline.edges) {
      low = std::min(low, along(a));
      high = std::max(high, along(a));
    }
    for (int place = 1; place < kPlaces; ++place) {
      const double at = low + (high - low) * place / kPlaces;
      for (auto& side : sides) side.clear();
      double cut = 0;
      for (const auto& [a, b] : outline.edges) {
        const double from = along(a) - at, to = along(b) - at;
        sides[from < 0 ? 0 : 1].push_back(a);
        if ((from < 0) == (to < 0)) continue;
        const Vec2d p = a + (b - a) * (from / (from - to));
        for (auto& side : sides) side.push_back(p);
        // Where it goes over to one side less where it comes back: all its stretches together.
        cut += (from < 0 ? 1 : -1) * (p.y * way.x - p.x * way.y);
      }
      const double one = hull_area(sides[0]), other = hull_area(sides[1]);
      const double cost = one + other + per_length * std::abs(cut);
      if (!(cost < least) || std::min(one, other) < kLeast * (one + other)) continue;
      least = cost;
      best = way;
      best_at = at;
    }
  };
  for (int k = 0; k < kTurns; ++k) {
    const double t = kEighth * k / kTurns;
    const double cosine = (1 - t * t) / (1 + t * t), sine = 2 * t / (1 + t * t);
    look({cosine, sine});
    look({sine, cosine});
    look({-sine, cosine});
    look({-cosine, sine});
  }
  std::vector<char> on_side;
  if (best == Vec2d{}) return on_side;
  for (std::size_t i = 0; i < chart.corners.size(); i += 3) {
    const Vec2d sum = chart.corners[i] + chart.corners[i + 1] + chart.corners[i + 2];
    on_side.push_back(sum.x * best.x + sum.y * best.y < 3 * best_at ? 0 : 1);
  }
  return on_side;
}

}  // namespace pounce::unwrap
