// SPDX-License-Identifier: Apache-2.0
//
// Harmonics of one degree stay among themselves, so each degree has a matrix: entry (j, k) is the
// integral over the sphere of Y_j(e) Y_k(M^T e). Products of two harmonics of degree 3 are
// polynomials of degree 6, and Lebedev's rule of 26 directions (the 6 faces, 12 edges and 8 corners
// of a cube) integrates those of degree 7 exactly.
#include "io/splats/sh_rotation.h"

#include <cmath>

#include "core/directions.h"

namespace pounce::io {
namespace {

using Matrix = std::array<std::array<double, 16>, 16>;

constexpr double kPi = 3.14159265358979323846;

/// All 16 harmonics at once; what lies outside of the degrees' blocks comes out as 0.
Matrix rotation_matrix(const std::array<Vec3d, 3>& columns) {
  constexpr std::array<double, 4> kWeights{0, 1.0 / 21, 4.0 / 105, 9.0 / 280};  // by cells moved
  Matrix result{};
  for (int at = 0; at < 27; ++at) {
    const Vec3d cell{static_cast<double>(at % 3 - 1), static_cast<double>(at / 3 % 3 - 1),
                     static_cast<double>(at / 9 - 1)};
    const double square = dot(cell, cell);
    if (square == 0) continue;
    const Vec3d e = cell * (1 / std::sqrt(square));
    const auto to = sh_basis<double>(e.x, e.y, e.z);
    const auto from = sh_basis<double>(dot(columns[0], e), dot(columns[1], e), dot(columns[2], e));
    const double weight = 4 * kPi * kWeights[static_cast<std::size_t>(square)];
    for (std::size_t j = 0; j < 16; ++j) {
      for (std::size_t k = 0; k < 16; ++k) result[j][k] += weight * to[j] * from[k];
    }
  }
  return result;
}

/// What is meant to be a whole number is one: a turn by 180 degrees changes signs and nothing else.
float entry(double value) {
  const double whole = std::round(value);
  return static_cast<float>(std::abs(value - whole) < 1e-12 ? whole : value);
}

template <std::size_t N>
void cut(const Matrix& all, std::size_t first, std::array<std::array<float, N>, N>& out) {
  for (std::size_t j = 0; j < N; ++j) {
    for (std::size_t k = 0; k < N; ++k) out[j][k] = entry(all[first + j][first + k]);
  }
}

template <std::size_t N>
void multiply(const std::array<std::array<float, N>, N>& matrix, float* values,
              std::size_t stride) {
  std::array<float, N> old;
  for (std::size_t k = 0; k < N; ++k) old[k] = values[k * stride];
  for (std::size_t j = 0; j < N; ++j) {
    float sum = 0;
    for (std::size_t k = 0; k < N; ++k) sum += matrix[j][k] * old[k];
    values[j * stride] = sum;
  }
}

}  // namespace

ShRotation::ShRotation(const std::array<Vec3d, 3>& columns) {
  const Matrix all = rotation_matrix(columns);
  cut(all, 1, degree_1_);
  cut(all, 4, degree_2_);
  cut(all, 9, degree_3_);
}

ShRotation::ShRotation(const Axes& axes)
    : ShRotation(
          {axes.apply(Vec3d{1, 0, 0}), axes.apply(Vec3d{0, 1, 0}), axes.apply(Vec3d{0, 0, 1})}) {}

void ShRotation::apply(float* values, std::size_t stride, std::uint32_t lobes) const {
  if (lobes >= 3) multiply(degree_1_, values, stride);
  if (lobes >= 8) multiply(degree_2_, values + 3 * stride, stride);
  if (lobes >= 15) multiply(degree_3_, values + 8 * stride, stride);
}

}  // namespace pounce::io
