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

/// x in [0, edge).
std::uint32_t wrapped(std::int64_t x, std::int64_t edge) {
  const std::int64_t rest = x % edge;
  return static_cast<std::uint32_t>(rest < 0 ? rest + edge : rest);
}

}  // namespace

/// Calls each(texel) for those whose middles it covers, each once for every period.
template <class Visit>
void UvCover::visit(const Uvs& uvs, const Visit& each) const {
  const auto [left, right] = std::minmax({uvs[0].x, uvs[1].x, uvs[2].x});
  const auto [top, bottom] = std::minmax({uvs[0].y, uvs[1].y, uvs[2].y});
  constexpr double kFarthest = 1e6;  // from 0: beyond, floats know no texels
  if (double{right} - double{left} > kMostPeriods || double{bottom} - double{top} > kMostPeriods ||
      std::max({std::abs(left), std::abs(right), std::abs(top), std::abs(bottom)}) > kFarthest)
    return;
  std::array<Vec2d, 3> corners;
  for (std::size_t k = 0; k < 3; ++k)
    corners[k] = {double{uvs[k].x} * edge_ - 0.5, double{uvs[k].y} * edge_ - 0.5};
  const auto far = static_cast<std::int64_t>(kFarthest) * edge_ * 2;
  mesh::raster_triangle(corners, {-far, -far, far, far},
                        [&](std::int64_t y, std::int64_t begin, std::int64_t end) {
                          const std::uint32_t row = wrapped(y, edge_) * edge_;
                          for (std::int64_t x = begin; x < end; ++x) each(row + wrapped(x, edge_));
                        });
}

void UvCover::add(const Uvs& uvs) {
  visit(uvs, [this](std::uint32_t texel) {
    if (counts_[texel] < kFull) ++counts_[texel];
  });
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
  changes_.clear();
  for (const Uvs& uvs : old)
    visit(uvs, [this](std::uint32_t texel) { changes_.emplace_back(texel, -1); });
  for (const Uvs& uvs : fresh)
    visit(uvs, [this](std::uint32_t texel) { changes_.emplace_back(texel, 1); });
  std::sort(changes_.begin(), changes_.end());
  std::size_t kept = 0;
  for (std::size_t i = 0; i < changes_.size();) {
    std::pair<std::uint32_t, int> change{changes_[i].first, 0};
    for (; i < changes_.size() && changes_[i].first == change.first; ++i)
      change.second += changes_[i].second;
    if (change.second == 0) continue;
    if (change.second > 0 && counts_[change.first] + change.second > static_cast<int>(most))
      return false;
    changes_[kept++] = change;
  }
  for (std::size_t i = 0; i < kept; ++i) {
    std::uint16_t& count = counts_[changes_[i].first];
    count = static_cast<std::uint16_t>(std::clamp<int>(count + changes_[i].second, 0, kFull));
  }
  return true;
}

std::uint64_t UvCover::shared() const {
  return static_cast<std::uint64_t>(
      std::count_if(counts_.begin(), counts_.end(), [](std::uint16_t n) { return n > 1; }));
}

}  // namespace pounce::meshing
