// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/vec.h"
#include "unwrap/unwrap.h"

namespace pounce::unwrap {

/// A chart laid flat: its triangles do not overlap (find_overlap()), and none is turned over.
struct Chart {
  std::vector<std::uint32_t> triangles;
  std::vector<Vec2d> corners;  ///< three for each of them, in space's units, v downwards
  /// Of each corner: which of the chart's points it is. A vertex that the chart passes twice is
  /// several.
  std::vector<std::uint32_t> points;
};

/// Which charts are in the way of packing: those that fill less than this share of the smallest box
/// around them, and of those with more than this share of the area of all any that fill it not
/// well.
struct Unwieldy {
  double area = 1, fill = 0;
};

/// Cuts a mesh into charts.
class Charts {
 public:
  /// What is given must outlive it. `poll` is called often and may throw.
  Charts(std::span<const Vec3f> positions, std::span<const Triangle> triangles,
         const std::function<void()>& poll);
  ~Charts();
  Charts(const Charts&) = delete;
  Charts& operator=(const Charts&) = delete;
  /// Every triangle is in one.
  std::vector<Chart> make();
  /// The same charts, but those that are unwieldy in two or more.
  std::vector<Chart> cut(std::vector<Chart> charts, const Unwieldy& limit);

 private:
  class Cutter;
  std::unique_ptr<Cutter> cutter_;
};

/// What a chart fills of the smallest box around it, of those at some angles.
double share_of_box(const Chart& chart);
/// Of its triangles in the plane, which is that in space.
double area_of(const Chart& chart);

/// Two triangles of a chart that overlap, by their numbers in it; nothing: none do by more than
/// a thousandth of the smaller one.
std::optional<std::pair<std::size_t, std::size_t>> find_overlap(const Chart& chart);

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
