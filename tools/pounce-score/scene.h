// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/vec.h"

namespace pounce::score {

/// A Gaussian in double precision, ready to be drawn.
struct Gaussian {
  Vec3d mean;
  std::array<double, 6> covariance{};  ///< xx xy xz yy yz zz
  std::array<Vec3d, 3> axis;           ///< unit, the longest first
  std::array<double, 3> sigma{};       ///< along them
  double alpha = 0;
  Vec3d colour;          ///< of degree 0
  std::uint32_t sh = 0;  ///< of its first coefficient in Scene::sh
};

struct Scene {
  std::vector<Gaussian> gaussians;
  std::uint32_t lobes = 0;  ///< coefficients beyond degree 0, per channel
  std::vector<Vec3d> sh;
  bool antialiased = false;
};

/// Reads a scene with all that its Gaussians show. Throws pounce::Error.
Scene read_scene(const std::string& path);

/// What a Gaussian shows along a unit direction from the eye to it; of degree 0 alone without
/// `harmonics`. Not below 0.
Vec3d colour_along(const Scene& scene, const Gaussian& gaussian, Vec3d direction, bool harmonics);

/// Sigma v.
Vec3d times(const std::array<double, 6>& m, Vec3d v);

}  // namespace pounce::score
