// SPDX-License-Identifier: Apache-2.0
//
// From a stored block of Gaussians to what the blend's inner loop reads.
//
// The store keeps what the scene's file says, column by column: small and exact, but a blend would
// rebuild matrices from quaternions for each texel. So a block is unfolded once and used by many
// packets of texels: axes sorted by size, variances, the covariance, and factors that depend on
// the Gaussian alone. What is unfolded is a cache entry with a price (most_bytes()) that is known
// from the index before the block is read, as every lease must be.
//
// Sorted axes make the third one the normal and the first one the reach, so later stages need no
// branch by which sigma is largest.
//
// The tree's shape (splat_spheres.h) never shows in a pixel, and neither does the sieve, which
// keeps a part of a block.
#include "gaussian/splat_set.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/bounds.h"
#include "core/directions.h"
#include "core/portable_math.h"

namespace pounce::gaussian {
namespace {

constexpr float kLeastPlanarity = 0.02F;
/// Unfolds one Gaussian, except for its spherical harmonics.
SplatShape shape_of(const store::SplatBlock& block, std::size_t i) {
  SplatShape out{};
  const auto axes = rotation_columns(block.rotation[0][i], block.rotation[1][i],
                                     block.rotation[2][i], block.rotation[3][i]);
  std::array<std::size_t, 3> order{0, 1, 2};  // by size; of equal ones the first comes first
  const auto sort = [&](std::size_t a, std::size_t b) {
    if (block.sigma[order[b]][i] > block.sigma[order[a]][i]) std::swap(order[a], order[b]);
  };
  sort(0, 1);
  sort(1, 2);
  sort(0, 1);
  // An odd permutation mirrors the frame; turning one axis around makes it right-handed again.
  const bool odd = (order[1] + 3 - order[0]) % 3 != 1;
  std::array<float, 3> sigma{};
  for (std::size_t k = 0; k < 3; ++k) {
    sigma[k] = block.sigma[order[k]][i];
    const Vec3f axis = axes[order[k]] * (odd && k == 2 ? -1.0F : 1.0F);
    out.axis[k][0] = axis.x;
    out.axis[k][1] = axis.y;
    out.axis[k][2] = axis.z;
    out.mean[k] = block.mean[k][i];
    out.variance[k] = sigma[k] * sigma[k];
    out.colour[k] = block.colour[k][i];
  }
  // A disc's response is trusted as a place on a surface; a needle's or a ball's hardly. The least
  // planarity keeps scenes that consist of balls alone visible.
  const float planarity =
      sigma[1] > 0 ? std::max(kLeastPlanarity, 1 - sigma[2] / sigma[1]) : kLeastPlanarity;
  out.flatness = planarity * (sigma[0] > 0 ? sigma[1] / sigma[0] : 1.0F);
  out.alpha = block.alpha[i];
  out.two_sided = 1;
  std::copy_n(out.axis[2], 3, out.normal);
  if (!block.normal[0].empty()) {
    const Vec3f n{block.normal[0][i], block.normal[1][i], block.normal[2][i]};
    if (n.x != 0 || n.y != 0 || n.z != 0) {
      out.two_sided = 0;
      out.normal[0] = n.x;
      out.normal[1] = n.y;
      out.normal[2] = n.z;
    }
  }
  return out;
}

void set_covariance(const SplatShape& shape, std::size_t i, SplatSet& set) {
  std::size_t c = 0;
  for (std::size_t a = 0; a < 3; ++a) {
    for (std::size_t b = a; b < 3; ++b) {
      float sum = 0;
      for (std::size_t k = 0; k < 3; ++k)
        sum += shape.axis[k][a] * shape.axis[k][b] * shape.variance[k];
      set.covariance[c++][i] = sum;
    }
  }
}

/// The factor of coefficient k = 0.. (degree 1 first) of a Gaussian. For `mean` it is the share of
/// a degree that a clamped cosine around the normal lets through (Ramamoorthi and Hanrahan 2001):
/// 2/3, 1/4, and nothing of degree 3. Hence degree 3 is not even stored for it.
float weight_of(SphericalHarmonics harmonics, std::uint32_t k) {
  if (harmonics == SphericalHarmonics::normal) return 1;
  return k < store::kLobesOfDegree[1] ? 2.0F / 3 : k < store::kLobesOfDegree[2] ? 0.25F : 0.0F;
}

/// How many of a block's lobes count.
std::uint32_t lobes_of(const store::SplatBlock& block, SphericalHarmonics harmonics) {
  if (harmonics == SphericalHarmonics::dc) return 0;
  return harmonics == SphericalHarmonics::mean ? std::min(block.lobes, store::kLobesOfDegree[2])
                                               : block.lobes;
}

/// Adds the coefficients that count of these Gaussians of a block to the set's last shapes.
void add_harmonics(const store::SplatBlock& block, std::span<const std::uint16_t> which,
                   SphericalHarmonics harmonics, SplatSet& set) {
  const std::uint32_t lobes = lobes_of(block, harmonics);
  const std::size_t count = block.size(), columns = std::size_t{3} * lobes;
  SplatShape* const shapes = set.shapes.data() + (set.shapes.size() - which.size());
  for (std::size_t k = 0; k < which.size(); ++k) {
    shapes[k].lobes = static_cast<std::int32_t>(lobes);
    if (lobes > 0) continue;
    for (float& v : shapes[k].colour) v = std::clamp(v, 0.0F, kLargestSplatColour);
  }
  // The store has columns, a texel needs all of one Gaussian: transposed here, once.
  const std::size_t first = set.sh.size();
  set.sh.resize(first + which.size() * columns);
  for (std::size_t c = 0; c < columns; ++c) {
    const float weight = weight_of(harmonics, static_cast<std::uint32_t>(c / 3));
    const std::uint16_t* const column = block.sh.data() + c * count;
    for (std::size_t k = 0; k < which.size(); ++k)
      set.sh[first + k * columns + c] = weight * half_to_float(column[which[k]]);
  }
}

/// The sieve's coarse half, for whole blocks of which a piece needs a few Gaussians. It must never
/// lose one that the exact test below keeps, so it takes the largest sigma on every axis and grows
/// outwards by more than that test's own rounding. Of each Gaussian: does the box that holds its
/// ellipsoid, however it lies, meet this one? Without branches, so that it becomes vectors.
void meet_all(const store::SplatBlock& block, const Box3f& box, std::vector<std::uint8_t>& meets) {
  constexpr float kOutwards = 0x1p-19F;  // more than splat_box() grows by
  const float* const x = block.mean[0].data();
  const float* const y = block.mean[1].data();
  const float* const z = block.mean[2].data();
  const float* const a = block.sigma[0].data();
  const float* const b = block.sigma[1].data();
  const float* const c = block.sigma[2].data();
  const std::size_t count = block.size();
  meets.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const float sigma = std::max(std::max(a[i], b[i]), c[i]);
    const float largest = std::abs(x[i]) + std::abs(y[i]) + std::abs(z[i]);
    const float r = 3 * sigma + (3 * sigma + largest) * kOutwards;
    meets[i] = static_cast<std::uint8_t>((x[i] + r >= box.lo.x) & (x[i] - r <= box.hi.x) &
                                         (y[i] + r >= box.lo.y) & (y[i] - r <= box.hi.y) &
                                         (z[i] + r >= box.lo.z) & (z[i] - r <= box.hi.z));
  }
}

}  // namespace

std::uint64_t SplatSet::most_bytes(std::uint64_t splats, std::uint32_t lobes) {
  const std::uint64_t bytes = round_to_pages(splats * sizeof(SplatShape)) + sizeof(SplatSet) +
                              round_to_pages(splats * 3 * lobes * sizeof(float)) +
                              6 * round_to_pages(whole_registers(splats) * sizeof(float));
  return bytes + tree_bytes(splats);
}

void SplatSet::reserve(std::size_t splats, std::uint32_t lobes) {
  shapes.reserve(splats);
  sh.reserve(splats * 3 * lobes);
  for (auto& column : covariance) column.reserve(whole_registers(splats));
  for (SplatSpheres& level : levels) {
    for (auto& axis : level.centre) axis.reserve(whole_registers(splats));
    level.radius.reserve(whole_registers(splats));
    splats = (splats + kFanOut - 1) / kFanOut;
  }
}

void SplatSet::clear() {
  shapes.clear();
  sh.clear();
  for (auto& column : covariance) column.clear();
  for (SplatSpheres& level : levels) {
    for (auto& axis : level.centre) axis.clear();
    level.radius.clear();
    level.count = 0;
  }
}

void add_splats(const store::SplatBlock& block, std::span<const std::uint16_t> which,
                SphericalHarmonics harmonics, SplatSet& set) {
  std::size_t at = set.shapes.size();
  resize(set.levels[0], at + which.size());
  for (auto& column : set.covariance) column.resize(whole_registers(at + which.size()));
  for (const std::uint16_t i : which) {
    const SplatShape& shape = set.shapes.emplace_back(shape_of(block, i));
    for (std::size_t k = 0; k < 3; ++k) set.levels[0].centre[k][at] = shape.mean[k];
    set.levels[0].radius[at] = kSplatCutOff * std::sqrt(shape.variance[0]) * kSphereMargin;
    set_covariance(shape, at++, set);
  }
  add_harmonics(block, which, harmonics, set);
}

/// Pointers into `sh` last: it grows while parts of blocks are added, and growing moves it.
void finish(SplatSet& set) {
  const float* sh = set.sh.data();
  for (SplatShape& shape : set.shapes) {
    shape.sh = sh;
    sh += std::ptrdiff_t{3} * shape.lobes;
  }
  make_levels(set.levels);
}

void find_near(const store::SplatBlock& block, std::span<const Box3f> boxes,
               std::vector<std::uint16_t>& near) {
  near.clear();
  Box3f all;
  for (const Box3f& box : boxes) all.extend(box);
  std::vector<std::uint8_t> meets;
  meet_all(block, all, meets);
  for (std::size_t i = 0; i < meets.size(); ++i) {
    if (meets[i] == 0) continue;
    const Box3f own = store::splat_box(block.splat(i));
    if (std::any_of(boxes.begin(), boxes.end(), [&](const Box3f& b) { return own.overlaps(b); }))
      near.push_back(static_cast<std::uint16_t>(i));
  }
}

SplatSet make_splat_set(const store::SplatBlock& block, SphericalHarmonics harmonics) {
  SplatSet set;
  set.reserve(block.size(), lobes_of(block, harmonics));
  std::vector<std::uint16_t> all(block.size());
  std::iota(all.begin(), all.end(), std::uint16_t{0});
  add_splats(block, all, harmonics, set);
  finish(set);
  return set;
}

}  // namespace pounce::gaussian
