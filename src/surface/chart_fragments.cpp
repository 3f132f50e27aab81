// SPDX-License-Identifier: Apache-2.0
#include "surface/chart_fragments.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/bounds.h"

namespace pounce::surface {
namespace {

constexpr std::size_t kMostTexels = 64;  // in a group
constexpr float kNear = 16;              // texel edges between the firsts of two fragments
constexpr float kFar = 256 * kNear;      // if there would be too many packets
constexpr float kAlike = 0.3F;           // cosine of their normals
constexpr auto kAnywhere = std::numeric_limits<float>::infinity();

/// Which axis a normal is nearest to, 0..5: both sides of a thin object are one place, nearly.
std::uint64_t side_of(Vec3f n) {
  const float x = std::abs(n.x), y = std::abs(n.y), z = std::abs(n.z);
  if (x >= y && x >= z) return n.x < 0 ? 0 : 1;
  if (y >= z) return n.y < 0 ? 2 : 3;
  return n.z < 0 ? 4 : 5;
}

/// Each of 16 bits with two empty ones above it.
std::uint64_t spread_out(std::uint64_t bits) {
  bits = (bits | bits << 16) & 0x0000FF0000FF;
  bits = (bits | bits << 8) & 0x00F00F00F00F;
  bits = (bits | bits << 4) & 0x0C30C30C30C3;
  return (bits | bits << 2) & 0x249249249249;
}

bool is_near(const TargetBlock::Texel& a, const TargetBlock::Texel& b, float far) {
  if (far == kAnywhere) return true;
  const Vec3f d = b.position - a.position;
  const float apart = std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)});
  return apart * std::min(a.per_texel, b.per_texel) <= far && dot(a.normal, b.normal) >= kAlike;
}

}  // namespace

void ChartFragments::add(std::span<const std::uint16_t> texels) {
  fragments_.push_back(
      {0, static_cast<std::uint16_t>(texels_.size()), static_cast<std::uint16_t>(texels.size())});
  texels_.insert(texels_.end(), texels.begin(), texels.end());
}

void ChartFragments::join(const TargetBlock& maps, std::size_t most_packets,
                          const std::function<void(std::span<const std::uint16_t>)>& add_group) {
  if (fragments_.empty()) return;
  sort(maps);
  std::vector<std::uint16_t> cuts;
  for (const float far : {kNear, kFar, kAnywhere}) {
    cuts = cut(maps, far);
    if (packets_of(cuts) <= most_packets) break;
  }
  std::vector<std::uint16_t> group;
  for (std::size_t g = 1; g < cuts.size(); ++g) {
    group.clear();
    for (std::size_t i = cuts[g - 1]; i < cuts[g]; ++i) {
      const auto first = texels_.begin() + fragments_[i].first;
      group.insert(group.end(), first, first + fragments_[i].count);
    }
    add_group(group);
  }
}

void ChartFragments::sort(const TargetBlock& maps) {
  Box3f box;
  for (const Fragment& fragment : fragments_) box.extend(first_of(maps, fragment).position);
  const Vec3f size = box.hi - box.lo;
  const float widest = std::max({size.x, size.y, size.z});
  const float cells = widest > 0 ? 65535 / widest : 0;
  const auto code = [&](float at, float from) {
    const float cell = (at - from) * cells;
    return spread_out(cell > 0 ? static_cast<std::uint64_t>(std::min(cell, 65535.0F)) : 0);
  };
  for (Fragment& fragment : fragments_) {
    const TargetBlock::Texel at = first_of(maps, fragment);
    fragment.key = side_of(at.normal) << 48 | code(at.position.x, box.lo.x) << 2 |
                   code(at.position.y, box.lo.y) << 1 | code(at.position.z, box.lo.z);
  }
  std::sort(fragments_.begin(), fragments_.end(), [](const Fragment& a, const Fragment& b) {
    return a.key != b.key ? a.key < b.key : a.first < b.first;
  });
}

std::vector<std::uint16_t> ChartFragments::cut(const TargetBlock& maps, float far) const {
  std::vector<std::uint16_t> cuts;
  cuts.reserve(fragments_.size() + 1);
  TargetBlock::Texel first;  // of the group
  std::size_t count = 0;
  for (std::size_t i = 0; i < fragments_.size(); ++i) {
    const TargetBlock::Texel at = first_of(maps, fragments_[i]);
    if (i == 0 || count + fragments_[i].count > kMostTexels || !is_near(first, at, far)) {
      cuts.push_back(static_cast<std::uint16_t>(i));
      first = at;
      count = 0;
    }
    count += fragments_[i].count;
  }
  cuts.push_back(static_cast<std::uint16_t>(fragments_.size()));
  return cuts;
}

std::size_t ChartFragments::packets_of(std::span<const std::uint16_t> cuts) const {
  std::size_t packets = 0;
  for (std::size_t g = 1; g < cuts.size(); ++g) {
    std::size_t count = 0;
    for (std::size_t i = cuts[g - 1]; i < cuts[g]; ++i) count += fragments_[i].count;
    packets += (count + kLanes - 1) / kLanes;
  }
  return packets;
}

}  // namespace pounce::surface
