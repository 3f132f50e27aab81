// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "store/blocks/splat_block.h"
#include "support/random.h"
#include "support/reference_splats.h"

namespace pounce::test {

/// A block of these, in their order; values rounded to floats.
inline store::SplatBlock splat_block(const std::vector<ReferenceSplat>& scene) {
  store::SplatBlock block;
  const auto put = [](PageVector<float>& column, double v) {
    column.push_back(static_cast<float>(v));
  };
  const bool normals = std::any_of(scene.begin(), scene.end(),
                                   [](const ReferenceSplat& s) { return length(s.normal) > 0; });
  for (const ReferenceSplat& s : scene) {
    const std::array<double, 3> mean{s.mean.x, s.mean.y, s.mean.z},
        colour{s.colour.x, s.colour.y, s.colour.z}, normal{s.normal.x, s.normal.y, s.normal.z};
    for (std::size_t k = 0; k < 3; ++k) {
      put(block.mean[k], mean[k]);
      put(block.sigma[k], s.sigma[k]);
      put(block.colour[k], colour[k]);
      if (normals) put(block.normal[k], normal[k]);
    }
    double norm = 0;
    for (const double q : s.rotation) norm += q * q;
    for (std::size_t k = 0; k < 4; ++k) put(block.rotation[k], s.rotation[k] / std::sqrt(norm));
    put(block.alpha, s.alpha);
  }
  return block;
}

inline std::array<double, 4> random_rotation(Random& random) {
  std::array<double, 4> q{};
  double norm = 0;
  do {
    norm = 0;
    for (double& v : q) {
      v = random.between(-1.0, 1.0);
      norm += v * v;
    }
  } while (norm > 1 || norm < 0.01);
  for (double& v : q) v /= std::sqrt(norm);
  return q;
}

/// Every number a float, as files have it.
inline ReferenceSplat as_floats(ReferenceSplat s) {
  const auto f = [](double& v) { v = static_cast<double>(static_cast<float>(v)); };
  for (double* v : {&s.mean.x, &s.mean.y, &s.mean.z, &s.alpha, &s.colour.x, &s.colour.y,
                    &s.colour.z, &s.normal.x, &s.normal.y, &s.normal.z})
    f(*v);
  for (double& v : s.sigma) f(v);
  for (double& v : s.rotation) f(v);
  return s;
}

/// Gaussians around the square (-1..1)^2 of the plane z = 0, of every kind that a scene may hold:
/// discs in the plane, needles, discs of no thickness, round ones, ones larger than the square, and
/// a second layer below.
inline std::vector<ReferenceSplat> random_splats(Random& random, std::size_t count,
                                                 bool with_normals) {
  std::vector<ReferenceSplat> scene;
  for (std::size_t i = 0; i < count; ++i) {
    ReferenceSplat s;
    s.mean = {random.between(-1.2, 1.2), random.between(-1.2, 1.2), random.between(-0.02, 0.02)};
    if (random.one_in(4)) s.mean.z -= 0.3;
    const double size = std::exp(random.between(-4.5, -2.0));
    // Nearly in the plane: a small turn about a random axis of it.
    s.rotation = {1, random.between(-0.2, 0.2), random.between(-0.2, 0.2),
                  random.between(-1.0, 1.0)};
    s.sigma = {size, size * random.between(0.4, 1.0), size * random.between(0.05, 0.3)};
    switch (random.below(8)) {
      case 0:
        s.sigma = {size, size * 0.03, size * 0.02};
        s.rotation = random_rotation(random);
        break;
      case 1:
        s.sigma[2] = 1e-6;
        break;
      case 2:
        s.sigma = {size, size, size};
        break;
      case 3:
        if (random.one_in(8)) s.sigma = {3, 2, 0.01};
        break;
      case 4:
        s.rotation = random_rotation(random);
        break;
      default:
        break;
    }
    s.alpha = random.between(0.02, 1.0);
    s.colour = {random.between(0.0, 1.0), random.between(0.0, 1.3), random.between(0.0, 1.0)};
    if (with_normals && !random.one_in(5)) {
      s.normal = {random.between(-0.2, 0.2), random.between(-0.2, 0.2),
                  random.one_in(6) ? -1.0 : 1.0};
      s.normal = s.normal * (1 / length(s.normal));
    }
    scene.push_back(as_floats(s));
  }
  return scene;
}

}  // namespace pounce::test
