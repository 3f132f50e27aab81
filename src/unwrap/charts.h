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

/// Which charts are in the way of packing: those in whose hull more than this share of the area of
/// all is empty, and those longer than so many roots of it.
struct Unwieldy {
  double waste = 1, length = 1;
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
  /// The same charts, but those that are unwieldy in two or more, if that helps.
  std::vector<Chart> cut(std::vector<Chart> charts, const Unwieldy& limit);

 private:
  class Cutter;
  std::unique_ptr<Cutter> cutter_;
};

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
  std::uint32_t tile = 0;
  Vec2d placed(Vec2d p, double scale) const {
    return {(cosine * p.x - sine * p.y) * scale + at.x, (sine * p.x + cosine * p.y) * scale + at.y};
  }
};
struct Packing {
  double scale = 0;  ///< texels per unit of space
  double rough = 0;  ///< what that was before most of the tries
  std::vector<Placement> charts;
};

/// Places all charts in a square of options.size texels, as large as it finds room for. None, where
/// they would have to be smaller than a hundredth of that, since there are too many for the gutter,
/// or if their rough scale does not come out larger than `than`, which may be 0. Where they do not
/// come near to the fill that is `wanted` it does not try for long.
Packing pack(std::span<const Chart> charts, const Options& options, double wanted, double than,
             const std::function<void()>& poll);

}  // namespace pounce::unwrap
