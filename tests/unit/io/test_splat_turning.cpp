// SPDX-License-Identifier: Apache-2.0
//
// Gaussians and their harmonics under axes, and under the matrices of nodes.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <numeric>
#include <random>
#include <vector>

#include "core/directions.h"
#include "io/splats/batch.h"

namespace pounce::io {
namespace {

using Columns = std::array<Vec3d, 3>;
using Coefficients = std::array<float, 15>;

Vec3d unit(Vec3d v) { return v * (1 / std::sqrt(dot(v, v))); }
Vec3d times(const Columns& m, Vec3d v) { return m[0] * v.x + m[1] * v.y + m[2] * v.z; }

class Random {
 public:
  double between(double low, double high) {
    return low + (high - low) * static_cast<double>(engine_()) / 4294967295.0;
  }
  Vec3d vector() { return {between(-1, 1), between(-1, 1), between(-1, 1)}; }
  Columns rotation() {
    const Vec3d a = unit(vector()), c = unit(cross(a, vector()));
    return {a, cross(c, a), c};
  }
  Coefficients coefficients() {
    Coefficients out;
    for (float& v : out) v = static_cast<float>(between(-1, 1));
    return out;
  }

 private:
  std::mt19937 engine_{11};
};

double show(const Coefficients& c, Vec3d d) {
  const auto basis = sh_basis<double>(d.x, d.y, d.z);
  double sum = 0;
  for (std::size_t k = 0; k < c.size(); ++k) sum += basis[k + 1] * static_cast<double>(c[k]);
  return sum;
}

void check_turned(const ShRotation& rotation, const Columns& m, Random& random) {
  const Coefficients before = random.coefficients();
  Coefficients after = before;
  rotation.apply(after.data(), 1, 15);
  for (int i = 0; i < 20; ++i) {
    const Vec3d d = unit(random.vector());
    CHECK(show(after, times(m, d)) == Approx(show(before, d)).margin(2e-6));
  }
}

TEST_CASE("the basis has the values of its definition", "[io]") {
  const auto up = sh_basis<double>(0.0, 0.0, 1.0);
  CHECK(up[0] == Approx(0.28209479));
  CHECK(up[2] == Approx(0.48860251));
  CHECK(up[6] == Approx(0.63078313));   // 0.31539157 * 2
  CHECK(up[12] == Approx(0.74635267));  // 0.37317633 * 2
  const auto d = sh_basis<double>(0.6, -0.48, 0.64);
  CHECK(d[1] == Approx(0.48860251 * 0.48));
  CHECK(d[4] == Approx(1.09254843 * 0.6 * -0.48));
  CHECK(d[8] == Approx(0.54627422 * (0.36 - 0.2304)));
  CHECK(d[9] == Approx(-0.59004359 * -0.48 * (3 * 0.36 - 0.2304)));
  CHECK(d[15] == Approx(-0.59004359 * 0.6 * (0.36 - 3 * 0.2304)));
}

TEST_CASE("turned harmonics show in the turned direction what they showed before", "[io]") {
  Random random;
  for (int i = 0; i < 50; ++i) {
    Columns m = random.rotation();
    if (i % 2 == 1) m[1] = m[1] * -1.0;  // a reflection
    check_turned(ShRotation(m), m, random);
  }
}

TEST_CASE("all 48 axes turn harmonics", "[io]") {
  Random random;
  std::array<std::uint8_t, 3> from{0, 1, 2};
  int seen = 0;
  do {
    for (int signs = 0; signs < 8; ++signs, ++seen) {
      Axes axes{from, {}};
      for (std::size_t k = 0; k < 3; ++k)
        axes.sign[k] = static_cast<std::int8_t>((signs >> k & 1) != 0 ? -1 : 1);
      const Columns m{axes.apply(Vec3d{1, 0, 0}), axes.apply(Vec3d{0, 1, 0}),
                      axes.apply(Vec3d{0, 0, 1})};
      check_turned(ShRotation(axes), m, random);
    }
  } while (std::next_permutation(from.begin(), from.end()));
  CHECK(seen == 48);
}

TEST_CASE("flips of axes change signs and nothing else", "[io]") {
  for (int signs = 0; signs < 8; ++signs) {
    const auto sign = [&](int k) { return (signs >> k & 1) != 0 ? -1.0F : 1.0F; };
    const float sx = sign(0), sy = sign(1), sz = sign(2);
    const Axes axes{
        {0, 1, 2},
        {static_cast<std::int8_t>(sx), static_cast<std::int8_t>(sy), static_cast<std::int8_t>(sz)}};
    const Coefficients table{sy, sz,           sx, sx * sy, sy * sz, 1,  sx * sz, 1,
                             sy, sx * sy * sz, sy, sz,      sx,      sz, sx};
    Coefficients values;
    std::iota(values.begin(), values.end(), 1.0F);
    Coefficients turned = values;
    ShRotation(axes).apply(turned.data(), 1, 15);
    for (std::size_t k = 0; k < 15; ++k) CHECK(turned[k] == values[k] * table[k]);
  }
}

TEST_CASE("fewer degrees leave the others alone", "[io]") {
  Coefficients values;
  values.fill(1);
  ShRotation(parse_axes("-x,-y,-z")).apply(values.data(), 1, 3);
  CHECK(values[2] == -1);
  CHECK(std::all_of(values.begin() + 3, values.end(), [](float v) { return v == 1; }));
}

/// Row by row.
std::array<double, 9> covariance(const Columns& axes, const std::array<double, 3>& sigma) {
  std::array<double, 9> out{};
  for (std::size_t k = 0; k < 3; ++k) {
    const std::array<double, 3> a{axes[k].x * sigma[k], axes[k].y * sigma[k], axes[k].z * sigma[k]};
    for (std::size_t r = 0; r < 3; ++r)
      for (std::size_t c = 0; c < 3; ++c) out[3 * r + c] += a[r] * a[c];
  }
  return out;
}

TEST_CASE("a node's matrix maps means, covariances and harmonics", "[io]") {
  Random random;
  const bool is_similar = GENERATE(true, false);
  for (int round = 0; round < 60; ++round) {
    Columns m = random.rotation();
    if (is_similar) {  // some of them mirrored
      for (Vec3d& column : m) column = column * (round % 2 == 0 ? 2.5 : -0.5);
    } else {
      m[0] = m[0] * 3.0;
      m[1] = m[1] * -0.2;
      if (round % 3 == 0) m[2] = m[2] + m[0] * 0.3;
    }
    const Vec3d offset{1, -2, 3};
    SplatBatch batch;
    const auto set = [&](auto& columns, std::initializer_list<double> values) {
      std::size_t k = 0;
      for (const double v : values) columns[k++][0] = static_cast<float>(v);
    };
    const Vec3d mean = random.vector();
    const std::array<double, 3> sigma{0.5, 0.0625, round % 4 == 0 ? 0 : 1e-6};
    const std::array<double, 4> q = quaternion_of(random.rotation());
    set(batch.mean, {mean.x, mean.y, mean.z});
    set(batch.sigma, {sigma[0], sigma[1], sigma[2]});
    set(batch.rotation, {2 * q[0], 2 * q[1], 2 * q[2], 2 * q[3]});
    const Coefficients before = random.coefficients();
    for (std::size_t k = 0; k < 15; ++k) batch.sh[3 * k + 1][0] = before[k];
    SplatPlacement(m, offset).apply(batch, 1, 15);

    const Vec3d expected = times(m, mean) + offset;
    CHECK(batch.mean[0][0] == Approx(expected.x).margin(1e-6));
    CHECK(batch.mean[2][0] == Approx(expected.z).margin(1e-6));
    Columns old = rotation_columns(q[0], q[1], q[2], q[3]);
    for (Vec3d& axis : old) axis = times(m, axis);
    const auto wanted = covariance(old, sigma);
    std::array<double, 4> found_q;
    std::array<double, 3> found_sigma;
    double length = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      found_q[k] = static_cast<double>(batch.rotation[k][0]);
      length += found_q[k] * found_q[k];
    }
    for (double& v : found_q) v /= std::sqrt(length);
    for (std::size_t k = 0; k < 3; ++k) found_sigma[k] = static_cast<double>(batch.sigma[k][0]);
    const auto found =
        covariance(rotation_columns(found_q[0], found_q[1], found_q[2], found_q[3]), found_sigma);
    for (std::size_t k = 0; k < 9; ++k) CHECK(found[k] == Approx(wanted[k]).margin(2e-6));
    // A sheared space has no turn; of a similarity, harmonics are those of its rotation.
    if (std::abs(dot(m[0], m[1])) + std::abs(dot(m[0], m[2])) > 1e-9) continue;
    Coefficients after;
    for (std::size_t k = 0; k < 15; ++k) after[k] = batch.sh[3 * k + 1][0];
    Columns pure = m;
    for (Vec3d& column : pure) column = unit(column);
    for (int i = 0; i < 5; ++i) {
      const Vec3d d = unit(random.vector());
      CHECK(show(after, times(pure, d)) == Approx(show(before, d)).margin(3e-6));
    }
  }
}

TEST_CASE("matrices come apart as they should", "[io]") {
  Random random;
  for (int round = 0; round < 200; ++round) {
    Columns m{random.vector(), random.vector(), random.vector()};
    if (round % 5 == 1) m[2] = m[0];
    if (round % 5 == 2) m[1] = m[2] = Vec3d{};
    if (round % 5 == 3) m[2] = m[2] * 1e-9;
    if (round == 4) m = {};
    const Decomposed d = decompose(m);
    for (std::size_t k = 0; k < 3; ++k) {
      Vec3d column{};
      for (std::size_t j = 0; j < 3; ++j) {
        const double v = k == 0 ? d.v[j].x : k == 1 ? d.v[j].y : d.v[j].z;
        column = column + d.u[j] * (d.sigma[j] * v);
        CHECK(dot(d.u[k], d.u[j]) == Approx(k == j ? 1 : 0).margin(1e-6));
      }
      const Vec3d off = column - m[k];
      CHECK(std::sqrt(dot(off, off)) < 1e-12);
    }
  }
}

}  // namespace
}  // namespace pounce::io
