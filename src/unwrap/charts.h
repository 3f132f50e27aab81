// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "core/vec.h"
#include "unwrap/unwrap.h"

namespace pounce::unwrap {

/// A chart laid flat: its triangles do not overlap, and none is turned over.
struct Chart {
  std::vector<std::uint32_t> triangles;
  std::vector<Vec2d> corners;  ///< three for each of them, in space's units, v downwards
};

/// Cuts a mesh into charts. Every triangle is in one.
std::vector<Chart> make_charts(std::span<const Vec3f> positions,
                               std::span<const Triangle> triangles,
                               const std::function<void()>& poll);

/// From where to where, along x, a triangle reaches between two heights; from > to: nowhere.
std::pair<double, double> span_between(const Vec2d* triangle, double y0, double y1);

/// Where a chart goes: its corners turned, times the scale of all, and moved by `at`, in texels.
struct Placement {
  double cosine = 1, sine = 0;
  Vec2d at;
  Vec2d placed(Vec2d p, double scale) const {
    return {(cosine * p.x - sine * p.y) * scale + at.x, (sine * p.x + cosine * p.y) * scale + at.y};
  }
};
struct Packing {
  double scale = 1;  ///< texels per unit of space
  std::vector<Placement> charts;
};

/// Places all charts in a square of options.size texels, as large as it finds room for. None, where
/// they would have to be smaller than a hundredth of that, since there are too many for the gutter.
Packing pack(std::span<const Chart> charts, const Options& options,
             const std::function<void()>& poll);

}  // namespace pounce::unwrap
