// SPDX-License-Identifier: Apache-2.0
//
// What happens to Gaussians between a format's decoder and the rest of pounce, in columns of 256.
//
// A decoder writes whatever its bytes say into a SplatBatch; nothing of it is trusted. BatchScene
// then drops what is no Gaussian, counting it by reason, and turns the rest to the axes that the
// user asked for. Being in one place, these rules are the same for every format, and a decoder
// needs no checks of values: only its headers and offsets can do harm.
//
// Three kinds of turning meet here. The user's axes are a signed permutation and apply exactly. A
// glTF node may hold any affine map M (SplatPlacement): the covariance becomes M Sigma M^T, which
// for a similarity is a product of quaternions, and else a singular value decomposition per
// Gaussian. Spherical harmonics follow the rotation in M (ShRotation).
//
// All is done in an order that is fixed, in IEEE operations and exp_same(): the same file gives the
// same bytes on every machine.
//
// A Gaussian that is left out is always counted by the first reason that holds, in a fixed order.
// The counts are in the report and in the store's directory, where they are compared with the rows
// of the file: a format's decoder must not drop a row itself.
#include "io/splats/batch.h"

#include <algorithm>
//
// Memory does not depend on the scene, since one batch is decoded, judged and turned at a time.
// Columns let the exponentials of logarithms and logits run over arrays, as vector code.
#include <cmath>
#include <optional>
#include <utility>

#include "core/directions.h"
#include "core/portable_math.h"

namespace pounce::io {
namespace {

using store::Splat;
using store::SplatFilter;

// What is below one step of 8 bits the reference renderer does not draw, either.
constexpr float kLeastAlpha = 1.0F / 255.0F;
// Harmonics are kept as halves; larger ones would become infinite.
constexpr float kMostHalf = 65504.0F;

/// Unit vector, or zeros where there is no direction.
template <std::size_t N>
std::array<float, N> unit(const std::array<float, N>& v) {
  double sum = 0;
  for (const float c : v) sum += static_cast<double>(c) * static_cast<double>(c);
  std::array<float, N> result{};
  if (!(sum > 0) || !std::isfinite(sum)) return result;
  // In double precision: the square of a float can neither overflow nor vanish in it.
  const double scale = 1 / std::sqrt(sum);
  for (std::size_t k = 0; k < N; ++k) result[k] = static_cast<float>(v[k] * scale);
  return result;
}

/// Row `i` of neighbouring columns.
template <std::size_t N>
std::array<float, N> row(const std::array<SplatBatch::Column, N>& columns, std::size_t i) {
  std::array<float, N> result;
  for (std::size_t k = 0; k < N; ++k) result[k] = columns[k][i];
  return result;
}

/// Why row i is of no use, if so.
std::optional<SplatFilter> reason_against(const SplatBatch& batch, std::size_t i,
                                          std::uint32_t lobes) {
  // A sum is finite or NaN if and only if every term is: 0 times infinity is NaN.
  float zero = 0;
  for (const float v : row(batch.mean, i)) zero += v * 0;
  for (const float v : row(batch.colour, i)) zero += v * 0;
  for (const float v : row(batch.rotation, i)) zero += v * 0;
  for (std::size_t k = 0; k < 3 * lobes; ++k) zero += batch.sh[k][i] * 0;
  float largest = 0, sum = batch.alpha[i];
  for (const float v : row(batch.sigma, i)) {
    largest = std::max(largest, std::abs(v));
    sum += std::abs(v);  // infinity is meant: only NaN spoils it
  }
  if (zero != 0 || std::isnan(sum)) return SplatFilter::not_finite;
  // The order of the reasons is part of what reports say: a Gaussian counts for the first.
  const auto rotation = row(batch.rotation, i);
  if (std::all_of(rotation.begin(), rotation.end(), [](float v) { return v == 0; }))
    return SplatFilter::zero_quaternion;
  if (batch.alpha[i] < kLeastAlpha) return SplatFilter::transparent;
  if (largest == 0) return SplatFilter::sizeless;
  if (!std::isfinite(largest)) return SplatFilter::exploded;
  return std::nullopt;
}

Splat splat(const SplatBatch& batch, std::size_t i) {
  const auto vector = [](const std::array<float, 3>& v) { return Vec3f{v[0], v[1], v[2]}; };
  Splat s;
  s.mean = vector(row(batch.mean, i));
  const Vec3f sigma = vector(row(batch.sigma, i));
  s.sigma = {std::abs(sigma.x), std::abs(sigma.y), std::abs(sigma.z)};
  s.rotation = unit(row(batch.rotation, i));
  // A file of floats may hold more than 1, which can only mean opaque.
  s.alpha = std::min(batch.alpha[i], 1.0F);
  s.colour = vector(row(batch.colour, i));
  s.normal = vector(unit(row(batch.normal, i)));
  return s;
}

using Matrix = std::array<Vec3d, 3>;  // columns
using HarmonicMatrix = std::array<std::array<double, 16>, 16>;

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
  // A disc's third column may be exactly zero, a needle's second as well: whatever stands at right
  // angles will do then. Below 1e-150 of the largest a direction is rounding error alone.
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

constexpr double kPi = 3.14159265358979323846;

/// All 16 harmonics at once. Harmonics of one degree stay among themselves, so each degree has a
/// matrix, and what lies outside of these blocks comes out as 0: entry (j, k) is the integral over
/// the sphere of Y_j(e) Y_k(M^T e). Products of two harmonics of degree 3 are polynomials of degree
/// 6, and Lebedev's rule of 26 directions (the 6 faces, 12 edges and 8 corners of a cube)
/// integrates those of degree 7 exactly.
HarmonicMatrix rotation_matrix(const std::array<Vec3d, 3>& columns) {
  constexpr std::array<double, 4> kWeights{0, 1.0 / 21, 4.0 / 105, 9.0 / 280};  // by cells moved
  HarmonicMatrix result{};
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
void cut(const HarmonicMatrix& all, std::size_t first, std::array<std::array<float, N>, N>& out) {
  for (std::size_t j = 0; j < N; ++j) {
    for (std::size_t k = 0; k < N; ++k) out[j][k] = entry(all[first + j][first + k]);
  }
}

template <std::size_t N>
void multiply(const std::array<std::array<float, N>, N>& matrix, float* values,
              std::size_t stride) {
  // In one order and in single precision, for the same bits everywhere.
  std::array<float, N> old;
  for (std::size_t k = 0; k < N; ++k) old[k] = values[k * stride];
  for (std::size_t j = 0; j < N; ++j) {
    float sum = 0;
    for (std::size_t k = 0; k < N; ++k) sum += matrix[j][k] * old[k];
    values[j * stride] = sum;
  }
}

}  // namespace

void exponential(SplatBatch::Column& column, std::size_t rows) {
  for (std::size_t i = 0; i < rows; ++i)
    column[i] = static_cast<float>(exp_same(static_cast<double>(column[i])));
}

void logistic(SplatBatch::Column& column, std::size_t rows) {
  for (std::size_t i = 0; i < rows; ++i)
    column[i] = static_cast<float>(1.0 / (1.0 + exp_same(-static_cast<double>(column[i]))));
}

void colour_of_dc(SplatBatch::Column& column, std::size_t rows) {
  for (std::size_t i = 0; i < rows; ++i)
    column[i] = static_cast<float>(0.5 + kShDegree0 * static_cast<double>(column[i]));
}

void BatchScene::append_harmonics(const SplatBatch& batch, std::size_t i,
                                  store::SplatRows& out) const {
  std::array<float, 3 * store::kMostLobes> values;
  const std::size_t count = 3 * out.lobes;
  for (std::size_t k = 0; k < count; ++k) values[k] = batch.sh[k][i];
  if (turn_ != Axes{}) {
    for (std::size_t c = 0; c < 3; ++c) turn_harmonics_.apply(&values[c], 3, out.lobes);
  }
  const std::size_t at = out.sh.size();
  out.sh.resize(at + count);
  for (std::size_t k = 0; k < count; ++k)
    out.sh[at + k] = float_to_half(std::clamp(values[k], -kMostHalf, kMostHalf));
}

/// Appends the Gaussians of the first `rows` rows that can be used, with `out.lobes` coefficients
/// each, and counts the others by reason. What is read of the batch need not be finite: a
/// coefficient that is no number is a reason, too.
void BatchScene::append(const SplatBatch& batch, std::size_t rows, store::SplatRows& out,
                        store::SplatCounts& filtered) const {
  const bool turned = turn_ != Axes{};
  for (std::size_t i = 0; i < rows; ++i) {
    if (const auto reason = reason_against(batch, i, out.lobes)) {
      ++filtered[static_cast<std::size_t>(*reason)];
      continue;
    }
    Splat s = splat(batch, i);
    if (turned) {
      s.mean = turn_.apply(s.mean);
      s.normal = turn_.apply(s.normal);
      turn_.apply(s.sigma, s.rotation);
    }
    out.splats.push_back(s);
    if (out.lobes > 0) append_harmonics(batch, i, out);
  }
}

void BatchScene::read(std::uint64_t first, std::uint64_t count, store::SplatRows& out,
                      store::SplatCounts& filtered) const {
  PageVector<SplatBatch> storage(1);
  SplatBatch& batch = storage.front();
  decode(first, count, out.lobes, batch,
         [&](std::size_t rows) { append(batch, rows, out, filtered); });
}

// One batch at a time, whatever the range.
std::uint64_t BatchScene::read_bytes() const {
  return round_to_pages(sizeof(SplatBatch)) + decode_bytes();
}

Decomposed decompose(Matrix columns) {
  // One-sided Jacobi: rotate pairs of columns until all are at right angles. It never forms the
  // product M^T M, whose rounding would bury a singular value of 1e-8 beside one of 1, so discs
  // keep their thickness.
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
      // Of the rotations that bring the two columns to right angles the smaller one: t is the
      // tangent of its angle, in the form that does not cancel.
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

SplatPlacement::SplatPlacement(const Matrix& columns, Vec3d offset)
    : columns_(columns),
      offset_(offset),
      parts_(decompose(columns)),
      harmonics_(orthogonal_part(parts_)) {
  is_identity_ = columns == kIdentity && offset == Vec3d{};
  // Nodes nearly always hold a rotation and one scale: that needs no decomposition per Gaussian.
  const auto [low, high] = std::minmax_element(parts_.sigma.begin(), parts_.sigma.end());
  is_similarity_ = *high > 0 && *high - *low <= 1e-6 * *high;
  if (is_similarity_) rotation_ = quaternion_of(proper(orthogonal_part(parts_)));
}

void SplatPlacement::apply(SplatBatch& batch, std::size_t rows, std::uint32_t lobes) const {
  if (is_identity_) return;
  for (std::size_t i = 0; i < rows; ++i) {
    // In double precision, rounded once: a node may be far from 0.
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
  // M R S times its own transpose is the new covariance, M Sigma M^T. So its left singular vectors
  // are the new axes, and its singular values the new sigmas.
  Matrix axes = rotation_columns(q[0], q[1], q[2], q[3]);
  for (std::size_t k = 0; k < 3; ++k) axes[k] = times(columns_, axes[k] * sigma[k]);
  const Decomposed d = decompose(axes);
  const auto rotation = quaternion_of(proper(d.u));
  for (std::size_t k = 0; k < 4; ++k) batch.rotation[k][i] = static_cast<float>(rotation[k]);
  for (std::size_t k = 0; k < 3; ++k) batch.sigma[k][i] = static_cast<float>(d.sigma[k]);
}

ShRotation::ShRotation(const std::array<Vec3d, 3>& columns) {
  const HarmonicMatrix all = rotation_matrix(columns);
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
