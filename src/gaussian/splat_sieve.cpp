// SPDX-License-Identifier: Apache-2.0
#include "gaussian/splat_sieve.h"

#include <algorithm>
#include <cmath>

namespace pounce::gaussian {
namespace {

/// Of each Gaussian: does the box that holds its ellipsoid, however it lies, meet this one? Without
/// branches, so that it becomes vectors.
void meet_all(const store::SplatBlock& block, const Box3f& box, std::vector<std::uint8_t>& meets) {
  constexpr float kOutwards = 0x1p-19F;  // more than splat_box() grows by
  const float* const x = block.mean[0].data();
  const float* const y = block.mean[1].data();
  const float* const z = block.mean[2].data();
  const float* const a = block.sigma[0].data();
  const float* const b = block.sigma[1].data();
  const float* const c = block.sigma[2].data();
  const std::size_t count = block.size();
  meets.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const float sigma = std::max(std::max(a[i], b[i]), c[i]);
    const float largest = std::abs(x[i]) + std::abs(y[i]) + std::abs(z[i]);
    const float r = 3 * sigma + (3 * sigma + largest) * kOutwards;
    meets[i] = static_cast<std::uint8_t>((x[i] + r >= box.lo.x) & (x[i] - r <= box.hi.x) &
                                         (y[i] + r >= box.lo.y) & (y[i] - r <= box.hi.y) &
                                         (z[i] + r >= box.lo.z) & (z[i] - r <= box.hi.z));
  }
}

}  // namespace

void find_near(const store::SplatBlock& block, std::span<const Box3f> boxes,
               std::vector<std::uint16_t>& near) {
  near.clear();
  Box3f all;
  for (const Box3f& box : boxes) all.extend(box);
  std::vector<std::uint8_t> meets;
  meet_all(block, all, meets);
  for (std::size_t i = 0; i < meets.size(); ++i) {
    if (meets[i] == 0) continue;
    const Box3f own = store::splat_box(block.splat(i));
    if (std::any_of(boxes.begin(), boxes.end(), [&](const Box3f& b) { return own.overlaps(b); }))
      near.push_back(static_cast<std::uint16_t>(i));
  }
}

}  // namespace pounce::gaussian
