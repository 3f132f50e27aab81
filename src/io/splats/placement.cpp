// SPDX-License-Identifier: Apache-2.0
#include "io/splats/placement.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace pounce::io {
namespace {

using Matrix = std::array<Vec3d, 3>;  // columns

constexpr Matrix kIdentity{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};

Vec3d times(const Matrix& m, Vec3d v) { return m[0] * v.x + m[1] * v.y + m[2] * v.z; }

double determinant(const Matrix& m) { return dot(m[0], cross(m[1], m[2])); }

/// A unit vector at right angles to a unit vector.
Vec3d beside(Vec3d v) {
  const Vec3d least = std::abs(v.x) <= std::abs(v.y) && std::abs(v.x) <= std::abs(v.z)
                          ? Vec3d{1, 0, 0}
                      : std::abs(v.y) <= std::abs(v.z) ? Vec3d{0, 1, 0}
                                                       : Vec3d{0, 0, 1};
  const Vec3d n = cross(v, least);
  return n * (1 / std::sqrt(dot(n, n)));
}

/// Unit vectors of columns at right angles to each other, of which some may be (next to) nothing.
void complete(Decomposed& d) {
  std::array<std::size_t, 3> order{0, 1, 2};
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return d.sigma[a] > d.sigma[b]; });
  const double least = d.sigma[order[0]] * 1e-150;
  Vec3d& first = d.u[order[0]];
  Vec3d& second = d.u[order[1]];
  first = d.sigma[order[0]] > 0 ? first * (1 / d.sigma[order[0]]) : Vec3d{1, 0, 0};
  second = d.sigma[order[1]] > least ? second * (1 / d.sigma[order[1]]) : beside(first);
  Vec3d& third = d.u[order[2]];
  third = d.sigma[order[2]] > least ? third * (1 / d.sigma[order[2]]) : cross(first, second);
}

/// U V^T: the rotation or reflection that is nearest.
Matrix orthogonal_part(const Decomposed& d) {
  Matrix result{};
  for (std::size_t k = 0; k < 3; ++k) {
    result[0] = result[0] + d.u[k] * d.v[k].x;
    result[1] = result[1] + d.u[k] * d.v[k].y;
    result[2] = result[2] + d.u[k] * d.v[k].z;
  }
  return result;
}

/// An ellipsoid is its own mirror image through its centre, so what is left of a reflection is a
/// rotation.
Matrix proper(Matrix m) {
  if (determinant(m) < 0) {
    for (Vec3d& column : m) column = column * -1.0;
  }
  return m;
}

std::array<double, 4> product(const std::array<double, 4>& a, const std::array<double, 4>& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

}  // namespace

Decomposed decompose(Matrix columns) {
  constexpr int kMostSweeps = 30;  // quadratic: 5 or 6 are usual
  constexpr std::array<std::pair<std::size_t, std::size_t>, 3> kPairs{{{0, 1}, {0, 2}, {1, 2}}};
  Decomposed d{columns, {}, kIdentity};
  bool done = false;
  for (int sweep = 0; sweep < kMostSweeps && !done; ++sweep) {
    done = true;
    for (const auto& [p, q] : kPairs) {
      const double pp = dot(d.u[p], d.u[p]), qq = dot(d.u[q], d.u[q]), pq = dot(d.u[p], d.u[q]);
      if (!(std::abs(pq) > 1e-15 * std::sqrt(pp * qq))) continue;
      done = false;
      const double zeta = (qq - pp) / (2 * pq);
      const double t = (zeta < 0 ? -1.0 : 1.0) / (std::abs(zeta) + std::sqrt(1 + zeta * zeta));
      const double c = 1 / std::sqrt(1 + t * t), s = c * t;
      for (Matrix* m : {&d.u, &d.v}) {
        const Vec3d old = (*m)[p];
        (*m)[p] = old * c - (*m)[q] * s;
        (*m)[q] = old * s + (*m)[q] * c;
      }
    }
  }
  for (std::size_t k = 0; k < 3; ++k) d.sigma[k] = std::sqrt(dot(d.u[k], d.u[k]));
  complete(d);
  return d;
}

std::array<double, 4> quaternion_of(const Matrix& m) {
  // Of w, x, y, z the largest comes from the diagonal, the others from it.
  const double xx = m[0].x, yy = m[1].y, zz = m[2].z;
  const std::array<double, 4> squares{1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz,
                                      1 - xx - yy + zz};
  const auto largest =
      static_cast<std::size_t>(std::max_element(squares.begin(), squares.end()) - squares.begin());
  const double a = m[1].z - m[2].y, b = m[2].x - m[0].z, c = m[0].y - m[1].x;
  const double xy = m[1].x + m[0].y, xz = m[2].x + m[0].z, yz = m[2].y + m[1].z;
  const std::array<std::array<double, 4>, 4> rows{{{squares[0], a, b, c},
                                                   {a, squares[1], xy, xz},
                                                   {b, xy, squares[2], yz},
                                                   {c, xz, yz, squares[3]}}};
  std::array<double, 4> q = rows[largest];
  double sum = 0;
  for (const double v : q) sum += v * v;
  for (double& v : q) v /= std::sqrt(sum);
  return q;
}

Matrix matrix_of(const std::array<double, 4>& q) {
  const auto [w, x, y, z] = q;
  return {{{1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)},
           {2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)},
           {2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)}}};
}

SplatPlacement::SplatPlacement(const Matrix& columns, Vec3d offset)
    : columns_(columns),
      offset_(offset),
      parts_(decompose(columns)),
      harmonics_(orthogonal_part(parts_)) {
  is_identity_ = columns == kIdentity && offset == Vec3d{};
  const auto [low, high] = std::minmax_element(parts_.sigma.begin(), parts_.sigma.end());
  is_similarity_ = *high > 0 && *high - *low <= 1e-6 * *high;
  if (is_similarity_) rotation_ = quaternion_of(proper(orthogonal_part(parts_)));
}

void SplatPlacement::apply(SplatBatch& batch, std::size_t rows, std::uint32_t lobes) const {
  if (is_identity_) return;
  for (std::size_t i = 0; i < rows; ++i) {
    const Vec3d mean = times(columns_, {batch.mean[0][i], batch.mean[1][i], batch.mean[2][i]});
    batch.mean[0][i] = static_cast<float>(mean.x + offset_.x);
    batch.mean[1][i] = static_cast<float>(mean.y + offset_.y);
    batch.mean[2][i] = static_cast<float>(mean.z + offset_.z);
    is_similarity_ ? turn(batch, i) : shear(batch, i);
    if (lobes == 0) continue;
    for (std::size_t c = 0; c < 3; ++c)
      harmonics_.apply(&batch.sh[c][i], 3 * SplatBatch::kRows, lobes);
  }
}

/// Every axis grows alike: the quaternion is multiplied.
void SplatPlacement::turn(SplatBatch& batch, std::size_t i) const {
  std::array<double, 4> q;
  for (std::size_t k = 0; k < 4; ++k) q[k] = static_cast<double>(batch.rotation[k][i]);
  q = product(rotation_, q);
  for (std::size_t k = 0; k < 4; ++k) batch.rotation[k][i] = static_cast<float>(q[k]);
  for (auto& sigma : batch.sigma) sigma[i] = static_cast<float>(sigma[i] * parts_.sigma[0]);
}

/// The new axes are those of M R S. What is no Gaussian stays none: its reason is found later.
void SplatPlacement::shear(SplatBatch& batch, std::size_t i) const {
  std::array<double, 4> q;
  double square = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    q[k] = static_cast<double>(batch.rotation[k][i]);
    square += q[k] * q[k];
  }
  std::array<double, 3> sigma;
  for (std::size_t k = 0; k < 3; ++k) sigma[k] = static_cast<double>(batch.sigma[k][i]);
  if (!(square > 0) || !std::isfinite(square + sigma[0] + sigma[1] + sigma[2])) return;
  for (double& v : q) v /= std::sqrt(square);
  Matrix axes = matrix_of(q);
  for (std::size_t k = 0; k < 3; ++k) axes[k] = times(columns_, axes[k] * sigma[k]);
  const Decomposed d = decompose(axes);
  const auto rotation = quaternion_of(proper(d.u));
  for (std::size_t k = 0; k < 4; ++k) batch.rotation[k][i] = static_cast<float>(rotation[k]);
  for (std::size_t k = 0; k < 3; ++k) batch.sigma[k][i] = static_cast<float>(d.sigma[k]);
}

}  // namespace pounce::io
