// SPDX-License-Identifier: Apache-2.0
#include "io/splats/upright.h"

#include <array>
#include <cmath>
#include <cstddef>

namespace pounce::io {
namespace {

using Quaternion = std::array<float, 4>;  // w, x, y, z

constexpr float kHalf = 0.5F, kRoot = 0.70710678F;

/// A rotation of the cube: column k of its matrix is plus or minus the axis from[k].
struct Renaming {
  Quaternion turn;
  std::array<std::size_t, 3> from;
};
constexpr std::array<Renaming, 24> kRenamings{{
    {{1, 0, 0, 0}, {0, 1, 2}},
    {{0, 1, 0, 0}, {0, 1, 2}},
    {{0, 0, 1, 0}, {0, 1, 2}},
    {{0, 0, 0, 1}, {0, 1, 2}},
    {{kRoot, kRoot, 0, 0}, {0, 2, 1}},
    {{kRoot, -kRoot, 0, 0}, {0, 2, 1}},
    {{0, 0, kRoot, kRoot}, {0, 2, 1}},
    {{0, 0, kRoot, -kRoot}, {0, 2, 1}},
    {{kRoot, 0, kRoot, 0}, {2, 1, 0}},
    {{kRoot, 0, -kRoot, 0}, {2, 1, 0}},
    {{0, kRoot, 0, kRoot}, {2, 1, 0}},
    {{0, kRoot, 0, -kRoot}, {2, 1, 0}},
    {{kRoot, 0, 0, kRoot}, {1, 0, 2}},
    {{kRoot, 0, 0, -kRoot}, {1, 0, 2}},
    {{0, kRoot, kRoot, 0}, {1, 0, 2}},
    {{0, kRoot, -kRoot, 0}, {1, 0, 2}},
    {{kHalf, kHalf, kHalf, kHalf}, {1, 2, 0}},
    {{kHalf, kHalf, -kHalf, -kHalf}, {1, 2, 0}},
    {{kHalf, -kHalf, kHalf, -kHalf}, {1, 2, 0}},
    {{kHalf, -kHalf, -kHalf, kHalf}, {1, 2, 0}},
    {{kHalf, -kHalf, -kHalf, -kHalf}, {2, 0, 1}},
    {{kHalf, -kHalf, kHalf, kHalf}, {2, 0, 1}},
    {{kHalf, kHalf, -kHalf, kHalf}, {2, 0, 1}},
    {{kHalf, kHalf, kHalf, -kHalf}, {2, 0, 1}},
}};

Quaternion product(const Quaternion& a, const Quaternion& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

}  // namespace

void turn_least(store::Splat& splat) {
  const Quaternion q = splat.rotation;
  const Renaming* best = nullptr;
  float largest = -1;
  for (const Renaming& renaming : kRenamings) {
    const float w = std::abs(product(q, renaming.turn)[0]);
    if (w > largest) {
      largest = w;
      best = &renaming;
    }
  }
  splat.rotation = product(q, best->turn);
  if (splat.rotation[0] < 0) {
    for (float& v : splat.rotation) v = -v;
  }
  const std::array<float, 3> sigma{splat.sigma.x, splat.sigma.y, splat.sigma.z};
  splat.sigma = {sigma[best->from[0]], sigma[best->from[1]], sigma[best->from[2]]};
}

}  // namespace pounce::io
