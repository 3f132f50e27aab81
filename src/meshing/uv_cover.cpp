// SPDX-License-Identifier: Apache-2.0
#include "meshing/uv_cover.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mesh/uv_raster.h"

namespace pounce::meshing {
namespace {

constexpr double kMostPeriods = 2;
constexpr std::uint16_t kFull = std::numeric_limits<std::uint16_t>::max();

constexpr double kFarthest = 1e6;  ///< from 0: beyond, floats know no texels
constexpr std::uint64_t kRowAsTexels = 16;

/// x in [0, edge).
std::uint32_t wrapped(std::int64_t x, std::int64_t edge) {
  const std::int64_t rest = x % edge;
  return static_cast<std::uint32_t>(rest < 0 ? rest + edge : rest);
}

}  // namespace

bool UvCover::counts(const Uvs& uvs) {
  const auto [left, right] = std::minmax({uvs[0].x, uvs[1].x, uvs[2].x});
  const auto [top, bottom] = std::minmax({uvs[0].y, uvs[1].y, uvs[2].y});
  return double{right} - double{left} <= kMostPeriods &&
         double{bottom} - double{top} <= kMostPeriods &&
         std::max({std::abs(left), std::abs(right), std::abs(top), std::abs(bottom)}) <= kFarthest;
}

/// Adds the texels whose middles it covers, each once for every period.
void UvCover::find_runs(const Uvs& uvs) {
  if (!counts(uvs)) return;
  std::array<Vec2d, 3> corners;
  for (std::size_t k = 0; k < 3; ++k)
    corners[k] = {double{uvs[k].x} * edge_ - 0.5, double{uvs[k].y} * edge_ - 0.5};
  const auto far = static_cast<std::int64_t>(kFarthest) * edge_ * 2;
  mesh::raster_triangle(
      corners, {-far, -far, far, far}, [&](std::int64_t y, std::int64_t begin, std::int64_t end) {
        const std::uint32_t row = wrapped(y, edge_) * edge_;
        while (begin < end) {
          const std::uint32_t at = wrapped(begin, edge_);
          const auto count =
              static_cast<std::uint32_t>(std::min<std::int64_t>(end - begin, edge_ - at));
          runs_.push_back({row + at, count});
          begin += count;
        }
      });
}

void UvCover::add(const Uvs& uvs) {
  runs_.clear();
  find_runs(uvs);
  for (const Run& run : runs_) {
    for (std::uint32_t texel = run.first; texel < run.first + run.count; ++texel) {
      if (counts_[texel] < kFull) ++counts_[texel];
    }
  }
}

std::uint32_t UvCover::at_middle(const Uvs& uvs) const {
  const auto texel = [this](float a, float b, float c) {
    const double middle = (double{a} + double{b} + double{c}) / 3;
    const auto at = static_cast<std::uint32_t>((middle - std::floor(middle)) * edge_);
    return std::min(at, edge_ - 1);
  };
  return counts_[texel(uvs[0].y, uvs[1].y, uvs[2].y) * edge_ + texel(uvs[0].x, uvs[1].x, uvs[2].x)];
}

bool UvCover::replace(std::span<const Uvs> old, std::span<const Uvs> fresh, std::uint32_t most) {
  runs_.clear();
  for (const Uvs& uvs : old) find_runs(uvs);
  const std::size_t old_runs = runs_.size();
  for (const Uvs& uvs : fresh) find_runs(uvs);
  looked_at_ = runs_.size() * kRowAsTexels;
  for (std::size_t i = 0; i < runs_.size(); ++i) {
    const auto step = static_cast<std::int16_t>(i < old_runs ? -1 : 1);
    const auto first = changes_.begin() + runs_[i].first;
    for (auto at = first; at != first + runs_[i].count; ++at)
      *at = static_cast<std::int16_t>(*at + step);
    looked_at_ += runs_[i].count;
  }
  bool has_room = true;
  for (std::size_t i = old_runs; i < runs_.size() && has_room; ++i) {
    for (std::uint32_t texel = runs_[i].first; texel < runs_[i].first + runs_[i].count; ++texel) {
      const int change = changes_[texel];
      if (change > 0 && counts_[texel] + change > static_cast<int>(most)) has_room = false;
    }
  }
  for (const Run& run : runs_) {
    for (std::uint32_t texel = run.first; texel < run.first + run.count; ++texel) {
      if (has_room)
        counts_[texel] =
            static_cast<std::uint16_t>(std::clamp<int>(counts_[texel] + changes_[texel], 0, kFull));
      changes_[texel] = 0;
    }
  }
  return has_room;
}

std::uint64_t UvCover::shared() const {
  return static_cast<std::uint64_t>(
      std::count_if(counts_.begin(), counts_.end(), [](std::uint16_t n) { return n > 1; }));
}

}  // namespace pounce::meshing
