// SPDX-License-Identifier: Apache-2.0
#include "score.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "render.h"

namespace pounce::score {
namespace {

constexpr double kLeastCosine = 0.2;
constexpr double kNearBefore = 0.02;   // of the diagonal: depth of what is seen
constexpr double kLeastOpacity = 0.5;  // of what is seen
constexpr double kPixels = 800;        // along the diagonal
constexpr int kManyViews = 24, kLeastViews = 3;

std::vector<Vec3d> four_sides() { return {{1, 0, 0}, {-1, 0, 0}, {0, 0, 1}, {0, 0, -1}}; }

std::vector<Vec3d> fourteen_sides() {
  std::vector<Vec3d> out = four_sides();
  out.push_back({0, 1, 0});
  out.push_back({0, -1, 0});
  for (const double x : {1.0, -1.0}) {
    for (const double y : {1.0, -1.0}) {
      for (const double z : {1.0, -1.0}) out.push_back(Vec3d{x, y, z} * (1 / std::numbers::sqrt3));
    }
  }
  return out;
}

/// Directions spread evenly: a spiral of Fibonacci.
std::vector<Vec3d> many_views() {
  std::vector<Vec3d> out;
  for (int i = 0; i < kManyViews; ++i) {
    const double y = 1 - (2 * i + 1.0) / kManyViews, r = std::sqrt(1 - y * y);
    const double turn = 2 * std::numbers::pi * i / std::numbers::phi;
    out.push_back({r * std::cos(turn), y, r * std::sin(turn)});
  }
  return out;
}

Vec3d clamped(Vec3d c) {
  return {std::clamp(c.x, 0.0, 1.0), std::clamp(c.y, 0.0, 1.0), std::clamp(c.z, 0.0, 1.0)};
}

/// What each view sees of each point; nothing where it does not see it.
using Views = std::vector<std::vector<std::optional<Sight>>>;

Views look(const Scene& scene, const Points& points, const std::vector<Vec3d>& directions,
           bool harmonics, double behind) {
  Views views(directions.size());
  tbb::parallel_for(std::size_t{0}, directions.size(), [&](std::size_t v) {
    const Vec3d d = directions[v];
    const auto pixels = render(scene, points.points, d, points.diagonal / kPixels, harmonics);
    views[v].resize(pixels.size());
    for (std::uint32_t p = 0; p < pixels.size(); ++p) {
      const Point& point = points.points[p];
      const double cosine = -dot(d, point.normal);
      if (cosine < kLeastCosine || pixels[p].opacity < kLeastOpacity) continue;
      const double away = (pixels[p].median_depth - dot(d, point.position)) / points.diagonal;
      if (away < -kNearBefore || away > behind) continue;
      views[v][p] = {p, clamped(pixels[p].colour), away * cosine};
    }
  });
  return views;
}

/// Of the channel that is most off.
double error_of(const Sight& sight, const std::vector<Vec3d>& colours) {
  const Vec3d d = clamped(colours[sight.point]) - sight.colour;
  return std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)});
}

std::vector<Sight> one_by_one(const Views& views) {
  std::vector<Sight> out;
  for (const auto& view : views) {
    for (std::uint32_t p = 0; p < view.size(); ++p) {
      if (view[p]) out.push_back(*view[p]);
    }
  }
  return out;
}

}  // namespace

Truth make_truth(const Scene& scene, const Points& points, bool harmonics, double behind) {
  Truth truth;
  const Views sides = look(scene, points, fourteen_sides(), harmonics, behind);
  truth.sides = one_by_one(sides);
  truth.four = one_by_one(Views(sides.begin(), sides.begin() + 4));
  const auto directions = many_views();
  const Views views = look(scene, points, directions, harmonics, behind);
  for (std::uint32_t p = 0; p < points.points.size(); ++p) {
    Vec3d sum;
    double weights = 0, away = 0;
    int seen = 0;
    for (std::size_t v = 0; v < views.size(); ++v) {
      if (!views[v][p]) continue;
      const double cosine = -dot(directions[v], points.points[p].normal);
      sum = sum + views[v][p]->colour * cosine;
      away += views[v][p]->behind * cosine;
      weights += cosine;
      ++seen;
    }
    if (seen >= kLeastViews) truth.many.push_back({p, sum * (1 / weights), away / weights});
  }
  return truth;
}

Truth beyond(const Truth& truth, double behind) {
  Truth out = truth;
  for (std::vector<Sight>* const sights : {&out.four, &out.sides, &out.many})
    std::erase_if(*sights, [&](const Sight& s) { return !(s.behind > behind); });
  return out;
}

double psnr(const std::vector<Sight>& truth, const std::vector<Vec3d>& colours) {
  double sum = 0;
  for (const Sight& s : truth) {
    const Vec3d d = clamped(colours[s.point]) - s.colour;
    sum += dot(d, d);
  }
  return -10 * std::log10(sum / (3.0 * static_cast<double>(truth.size())));
}

double share_off(const std::vector<Sight>& truth, const std::vector<Vec3d>& colours) {
  std::size_t off = 0;
  for (const Sight& s : truth) off += error_of(s, colours) > 0.15 ? 1 : 0;
  return static_cast<double>(off) / static_cast<double>(truth.size());
}

Ranking rank(const Truth& truth, const std::vector<Vec3d>& colours,
             const std::vector<Vec3d>& numbers) {
  constexpr double kWrong = 0.1;
  struct One {
    double number, error;
  };
  std::vector<One> all;
  for (const Sight& s : truth.many) {
    if (numbers[s.point].x > 0) all.push_back({numbers[s.point].x, error_of(s, colours)});
  }
  Ranking out;
  out.texels = all.size();
  if (all.empty()) return out;
  std::stable_sort(all.begin(), all.end(),
                   [](const One& a, const One& b) { return a.number < b.number; });
  const std::size_t tenth = std::max<std::size_t>(all.size() / 10, 1);
  double wrong = 0, pairs = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    out.error += all[i].error;
    if (i < tenth) out.least_error += all[i].error;
  }
  // Of equal numbers half of the pairs count.
  for (std::size_t i = 0; i < all.size();) {
    double w = 0, r = 0;
    const double number = all[i].number;
    for (; i < all.size() && !(all[i].number > number); ++i) (all[i].error > kWrong ? w : r) += 1;
    pairs += (wrong + w / 2) * r;
    wrong += w;
  }
  const auto count = static_cast<double>(all.size());
  out.wrong = wrong / count;
  out.error /= count;
  out.least_error /= static_cast<double>(tenth);
  if (wrong > 0 && wrong < count) out.area = pairs / (wrong * (count - wrong));
  return out;
}

std::vector<Vec3d> composited(const Scene& scene, const Points& points, double above) {
  constexpr double kBelow = 0.05;
  const auto all = hits(scene, points.points, above * points.diagonal, kBelow * points.diagonal);
  std::vector<Vec3d> out(all.size());
  tbb::parallel_for(std::size_t{0}, all.size(),
                    [&](std::size_t p) { out[p] = composite(scene, all[p]); });
  return out;
}

}  // namespace pounce::score
