// SPDX-License-Identifier: Apache-2.0
#include "unwrap/unwrap.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "unwrap/charts.h"

namespace pounce::unwrap {
namespace {

constexpr double kEnough = 0.76;
/// What is cut where that is not filled, one after the other until it is, or until so many of these
/// in sequence were in vain.
constexpr std::array<Unwieldy, 5> kUnwieldy{
    {{1.0 / 50, 0.9}, {1.0 / 100, 0.8}, {1.0 / 200, 0.65}, {1.0 / 400, 0.6}, {1.0 / 800, 0.5}}};
constexpr int kInVain = 3;
/// Of the roots of the area of as many tiles: as long as the edge of one that is filled so far.
constexpr double kInTile = 1, kAny = std::numeric_limits<double>::infinity();
constexpr double kWorth = 0.03;  ///< what twice as many charts must add to the fill

double fill_of(const std::vector<Chart>& charts, const Packing& packing, const Options& options) {
  double area = 0;
  for (const Chart& chart : charts) area += area_of(chart);
  const double scale = packing.scale / options.size;
  return area * scale * scale / options.tiles;
}

}  // namespace

Unwrapped unwrap(std::span<const Vec3f> positions, std::span<const Triangle> triangles,
                 const Options& options, const std::function<void()>& poll) {
  Charts cutter(positions, triangles, poll);
  std::vector<Chart> charts = cutter.make();
  const double root = std::sqrt(static_cast<double>(options.tiles));
  // What is longer than a tile would make all charts smaller.
  if (options.tiles > 1) charts = cutter.cut(std::move(charts), {kAny, kInTile / root});
  Packing packing = pack(charts, options, kEnough, 0, poll);
  // As few charts as fill enough of the image.
  std::vector<Chart> smaller = charts;
  int in_vain = 0;
  for (const Unwieldy& limit : kUnwieldy) {
    if (in_vain == kInVain || fill_of(charts, packing, options) >= kEnough) break;
    smaller = cutter.cut(std::move(smaller), {limit.waste / options.tiles, limit.length / root});
    if (smaller.size() == charts.size()) continue;
    Packing other = pack(smaller, options, kEnough, packing.rough, poll);
    ++in_vain;
    const double more =
        static_cast<double>(smaller.size()) / static_cast<double>(charts.size()) - 1;
    const double gain = fill_of(smaller, other, options) - fill_of(charts, packing, options);
    if (!(gain > 0) || gain < kWorth * more) continue;
    in_vain = 0;
    charts = smaller;
    packing = std::move(other);
  }
  Unwrapped out;
  out.triangles.resize(triangles.size());
  out.charts.resize(triangles.size());
  out.chart_count = static_cast<std::uint32_t>(charts.size());
  out.fits = packing.charts.size() == charts.size();
  if (!out.fits) return out;
  double area = 0;
  for (std::uint32_t c = 0; c < charts.size(); ++c) {
    const Chart& chart = charts[c];
    const Placement& place = packing.charts[c];
    out.tiles.push_back(place.tile);
    std::map<std::uint32_t, std::uint32_t> own;  // the chart's points to new vertices
    for (std::size_t i = 0; i < chart.triangles.size(); ++i) {
      const std::uint32_t t = chart.triangles[i];
      out.charts[t] = c;
      std::array<Vec2d, 3> corners;
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t vertex = triangles[t][k];
        corners[k] = place.placed(chart.corners[3 * i + k], packing.scale) * (1.0 / options.size);
        const auto [found, is_new] =
            own.try_emplace(chart.points[3 * i + k], static_cast<std::uint32_t>(out.vertex.size()));
        if (is_new) {
          out.vertex.push_back(vertex);
          out.uvs.push_back(Vec2f{static_cast<float>(std::clamp(corners[k].x, 0.0, 1.0)),
                                  static_cast<float>(std::clamp(corners[k].y, 0.0, 1.0))});
        }
        out.triangles[t][k] = found->second;
      }
      const auto [a, b, d] = corners;
      area += std::abs((b.x - a.x) * (d.y - a.y) - (b.y - a.y) * (d.x - a.x)) / 2;
    }
  }
  out.fill = area / options.tiles;
  return out;
}

}  // namespace pounce::unwrap
