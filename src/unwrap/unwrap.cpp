// SPDX-License-Identifier: Apache-2.0
#include "unwrap/unwrap.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "unwrap/charts.h"

namespace pounce::unwrap {

Unwrapped unwrap(std::span<const Vec3f> positions, std::span<const Triangle> triangles,
                 const Options& options, const std::function<void()>& poll) {
  const std::vector<Chart> charts = make_charts(positions, triangles, poll);
  const Packing packing = pack(charts, options, poll);
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
    std::map<std::uint32_t, std::uint32_t> own;  // old vertex to new
    for (std::size_t i = 0; i < chart.triangles.size(); ++i) {
      const std::uint32_t t = chart.triangles[i];
      out.charts[t] = c;
      std::array<Vec2d, 3> corners;
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t vertex = triangles[t][k];
        corners[k] = place.placed(chart.corners[3 * i + k], packing.scale) * (1.0 / options.size);
        const auto [found, is_new] =
            own.try_emplace(vertex, static_cast<std::uint32_t>(out.vertex.size()));
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
  out.fill = area;
  return out;
}

}  // namespace pounce::unwrap
