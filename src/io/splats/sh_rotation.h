// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/job_space.h"
#include "core/vec.h"

namespace pounce::io {

/// What turning (or mirroring) space does to spherical harmonics of degrees 1 to 3: the turned
/// coefficients show in direction M d what the old ones showed in direction d. Immutable.
class ShRotation {
 public:
  /// From the images of x, y and z, which are orthonormal.
  explicit ShRotation(const std::array<Vec3d, 3>& columns);
  explicit ShRotation(const Axes& axes);

  /// values[k * stride] for k < lobes (3, 8 or 15): the coefficients of one channel of one
  /// Gaussian.
  void apply(float* values, std::size_t stride, std::uint32_t lobes) const;

 private:
  std::array<std::array<float, 3>, 3> degree_1_;
  std::array<std::array<float, 5>, 5> degree_2_;
  std::array<std::array<float, 7>, 7> degree_3_;
};

}  // namespace pounce::io
