// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/vec.h"
#include "io/splats/batch.h"

namespace pounce::io {

/// A matrix as U diag(sigma) V^T; columns of U and V are orthonormal, sigma >= 0.
struct Decomposed {
  std::array<Vec3d, 3> u;
  std::array<double, 3> sigma;
  std::array<Vec3d, 3> v;
};
/// By Jacobi rotations of columns, which keep small singular values as exact as large ones.
Decomposed decompose(std::array<Vec3d, 3> columns);

/// The quaternion w, x, y, z of a proper rotation, and the other way round.
std::array<double, 4> quaternion_of(const std::array<Vec3d, 3>& columns);
std::array<Vec3d, 3> matrix_of(const std::array<double, 4>& unit);

/// Where a file places a group of Gaussians: any affine map. Means are mapped, covariances become
/// M Sigma M^T, harmonics turn with what is a rotation (or reflection) in M. Immutable.
class SplatPlacement {
 public:
  /// By the images of x, y and z, and of the origin.
  SplatPlacement(const std::array<Vec3d, 3>& columns, Vec3d offset);
  /// In place, for the first `rows`.
  void apply(SplatBatch& batch, std::size_t rows, std::uint32_t lobes) const;

 private:
  void turn(SplatBatch& batch, std::size_t i) const;
  void shear(SplatBatch& batch, std::size_t i) const;

  std::array<Vec3d, 3> columns_;
  Vec3d offset_;
  Decomposed parts_;
  bool is_identity_ = false, is_similarity_ = false;
  std::array<double, 4> rotation_{1, 0, 0, 0};  ///< of a similarity, its reflection left out
  ShRotation harmonics_;
};

}  // namespace pounce::io
