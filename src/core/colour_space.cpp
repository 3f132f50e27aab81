// SPDX-License-Identifier: Apache-2.0
//
// A colour space here is three lights and a white. From one to another goes a matrix: to X, Y, Z,
// then into the other's lights. What each light contributes is solved for, so that equal parts of
// all three give white; where the whites differ, the colours are adapted to the new one. Files may
// say any eight numbers, so are_primaries() asks first whether the equations have a sensible
// solution.
//
// Both curves of sRGB need roots. pow() differs in its last bit from one C library to another, and
// a texel whose value falls on the edge between two codes would differ with it; so roots are found
// by Newton's method from above, which ends at the same number everywhere.
//
// Readers and writers of images name spaces with this, planning chooses them,
// shading/texel_input.cpp converts texels. Spaces of a configuration are OpenColorIO's (io/image),
// not these.
#include "core/colour_space.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/vec.h"

namespace pounce {
namespace {

// SMPTE ST 2065-1 and the Academy's S-2014-004 for ACES, SMPTE EG 432-1 with D65 for Display P3.
constexpr Chromaticities kAp1{0.713F, 0.293F, 0.165F, 0.830F, 0.128F, 0.044F, 0.32168F, 0.33767F};
constexpr Chromaticities kAp0{0.7347F, 0.2653F, 0.0F, 1.0F, 0.0001F, -0.077F, 0.32168F, 0.33767F};
constexpr Chromaticities kP3{0.680F, 0.320F, 0.265F, 0.690F, 0.150F, 0.060F, 0.3127F, 0.3290F};

struct Named {
  const char* name;
  Chromaticities primaries;
  bool linear;
};
// The first name of a space is the one that messages use.
constexpr std::array<Named, 6> kNamed{{{"srgb", kRec709, false},
                                       {"lin_rec709", kRec709, true},
                                       {"acescg", kAp1, true},
                                       {"aces2065-1", kAp0, true},
                                       {"display-p3", kP3, false},
                                       {"linear", kRec709, true}}};

/// ICC.1:2010, 7.2.16.
constexpr Vec3d kD50{0.9642, 1.0, 0.8249};

constexpr Matrix3 kBradford{0.8951, 0.2664, -0.1614, -0.7502, 1.7135,
                            0.0367, 0.0389, -0.0685, 1.0296};

Vec3d times(const Matrix3& m, Vec3d v) noexcept {
  return {m[0] * v.x + m[1] * v.y + m[2] * v.z, m[3] * v.x + m[4] * v.y + m[5] * v.z,
          m[6] * v.x + m[7] * v.y + m[8] * v.z};
}

Matrix3 times(const Matrix3& a, const Matrix3& b) noexcept {
  Matrix3 out;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column) {
      out[3 * row + column] =
          a[3 * row] * b[column] + a[3 * row + 1] * b[3 + column] + a[3 * row + 2] * b[6 + column];
    }
  }
  return out;
}

double minor(const Matrix3& m, std::size_t row, std::size_t column) noexcept {
  const std::size_t r1 = (row + 1) % 3, r2 = (row + 2) % 3;
  const std::size_t c1 = (column + 1) % 3, c2 = (column + 2) % 3;
  return m[3 * r1 + c1] * m[3 * r2 + c2] - m[3 * r1 + c2] * m[3 * r2 + c1];
}

double determinant(const Matrix3& m) noexcept {
  return m[0] * minor(m, 0, 0) + m[1] * minor(m, 0, 1) + m[2] * minor(m, 0, 2);
}

Matrix3 inverse(const Matrix3& m) noexcept {
  const double det = determinant(m);
  Matrix3 out;
  for (std::size_t row = 0; row < 3; ++row) {
    // Cyclic minors carry their signs already.
    for (std::size_t column = 0; column < 3; ++column)
      out[3 * column + row] = minor(m, row, column) / det;
  }
  return out;
}

Vec3d xyz(const Chromaticities& c, std::size_t which) noexcept {
  const auto x = static_cast<double>(c[2 * which]), y = static_cast<double>(c[2 * which + 1]);
  return {x / y, 1, (1 - x - y) / y};
}

/// A column per primary, of any brightness: (x, y, 1 - x - y).
Matrix3 directions(const Chromaticities& c) noexcept {
  Matrix3 m;
  for (std::size_t p = 0; p < 3; ++p) {
    const auto x = static_cast<double>(c[2 * p]), y = static_cast<double>(c[2 * p + 1]);
    m[p] = x;
    m[3 + p] = y;
    m[6 + p] = 1 - x - y;
  }
  return m;
}

/// To X, Y, Z, white of Y = 1.
Matrix3 to_xyz(const Chromaticities& c) noexcept {
  Matrix3 m = directions(c);
  // The brightness of each light, such that all three together are white.
  const Vec3d scale = times(inverse(m), xyz(c, 3));
  for (std::size_t row = 0; row < 3; ++row) {
    m[3 * row] *= scale.x;
    m[3 * row + 1] *= scale.y;
    m[3 * row + 2] *= scale.z;
  }
  return m;
}

/// Scales the responses of three cones so that one white becomes the other.
Matrix3 adaptation(Vec3d from_white, Vec3d to_white) noexcept {
  const Vec3d from = times(kBradford, from_white), to = times(kBradford, to_white);
  const Matrix3 scale{to.x / from.x, 0, 0, 0, to.y / from.y, 0, 0, 0, to.z / from.z};
  return times(inverse(kBradford), times(scale, kBradford));
}

/// CIE XYZ is no mixture of lights with a white of its own: "primaries" of (1,0), (0,1), (0,0) and
/// white at a third only say that the channels are X, Y and Z. Programs write them as they measured
/// or computed them, for a white of D65 (OpenEXR's own pair of reference images differs by the
/// matrix of Rec. 709 alone). Adapting them from equal energy would tint everything.
bool is_cie_xyz(const Chromaticities& c) noexcept {
  constexpr Chromaticities kXyz{1, 0, 0, 1, 0, 0, 1 / 3.0F, 1 / 3.0F};
  return same_primaries(c, kXyz);
}

/// What is white in pictures of these.
Vec3d white_of(const Chromaticities& c) noexcept { return xyz(is_cie_xyz(c) ? kRec709 : c, 3); }

std::string lower(std::string text) {
  for (char& c : text) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
  return text;
}

/// The positive root of r^n = x for x > 0 by Newton's method, from a start above the root: each
/// step falls until rounding stops it.
double root(double x, int n) noexcept {
  double r = std::max(x, 1.0);
  // Far from the root a step only takes a fixed share of r off: beyond the range of a half the
  // start is the power of two above the root.
  constexpr double kNear = 1e6;
  if (x > kNear && std::isfinite(x)) r = std::ldexp(1.0, std::ilogb(x) / n + 1);
  for (int i = 0; i < 200; ++i) {
    double power = 1;
    for (int k = 1; k < n; ++k) power *= r;
    const double next = r - (r - x / power) / n;
    if (!(next < r)) break;
    r = next;
  }
  return r;
}

}  // namespace

bool same_primaries(const Chromaticities& a, const Chromaticities& b) noexcept {
  return std::equal(a.begin(), a.end(), b.begin(),
                    [](float x, float y) { return std::fabs(x - y) < 5e-4F; });
}

std::optional<ColourSpace> colour_space_from_name(const std::string& name) {
  for (const Named& named : kNamed) {
    if (lower(name) == named.name) return ColourSpace{named.primaries, named.linear};
  }
  return std::nullopt;
}

std::string colour_space_names() {
  std::string names;
  for (const Named& named : kNamed) names += (names.empty() ? "" : ", ") + std::string(named.name);
  return names;
}

std::string colour_space_name(const ColourSpace& space) {
  if (!space.config_name.empty()) return space.config_name;
  for (const Named& named : kNamed) {
    if (named.linear == space.linear && same_primaries(named.primaries, space.primaries))
      return named.name;
  }
  const Chromaticities& c = space.primaries;
  return fmt::format("{} with red {:g} {:g}, green {:g} {:g}, blue {:g} {:g}, white {:g} {:g}",
                     space.linear ? "linear light" : "sRGB encoding", c[0], c[1], c[2], c[3], c[4],
                     c[5], c[6], c[7]);
}

bool are_primaries(const Chromaticities& c) noexcept {
  if (!std::all_of(c.begin(), c.end(), [](float v) { return std::fabs(v) < 10; })) return false;
  if (!(c[7] > 0.01F)) return false;  // of white: everything is divided by it
  const Matrix3 m = directions(c);
  if (!(std::fabs(determinant(m)) > 1e-4)) return false;
  // White is a mixture of them; its cones can be adapted.
  const Vec3d parts = times(inverse(m), xyz(c, 3)), cones = times(kBradford, xyz(c, 3));
  return parts.x > 0 && parts.y > 0 && parts.z > 0 && cones.x > 0.01 && cones.y > 0.01 &&
         cones.z > 0.01;
}

Matrix3 primaries_matrix(const Chromaticities& from, const Chromaticities& to) noexcept {
  // From right to left: to X, Y, Z, to the other white, into the other's lights.
  const Matrix3 adapted = times(adaptation(white_of(from), white_of(to)), to_xyz(from));
  return times(inverse(to_xyz(to)), adapted);
}

Matrix3 adaptation_to_d50(const Chromaticities& from) noexcept {
  return adaptation(white_of(from), kD50);
}

Matrix3 matrix_to_d50(const Chromaticities& from) noexcept {
  return times(adaptation_to_d50(from), to_xyz(from));
}

// IEC 61966-2-1. x^2.4 = x^2 * (x^2)^(1/5); x^(1/2.4) = (x^5)^(1/12) = sqrt(sqrt(cbrt(x^5))).
double srgb_to_linear(double coded) noexcept {
  if (coded <= 0.04045) return coded / 12.92;
  const double x = (coded + 0.055) / 1.055;
  return x * x * root(x * x, 5);
}

double linear_to_srgb(double linear) noexcept {
  if (linear <= 0.0031308) return linear * 12.92;
  const double x5 = linear * linear * linear * linear * linear;
  return 1.055 * std::sqrt(std::sqrt(root(x5, 3))) - 0.055;
}

}  // namespace pounce
