// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/bounds.h"
#include "core/page_pool.h"
#include "core/vec.h"

namespace pounce::store {

inline constexpr std::size_t kMostSplatsPerBlock = 4096;
/// Coefficients of spherical harmonics beyond degree 0, of each colour channel, by highest degree.
inline constexpr std::array<std::uint32_t, 4> kLobesOfDegree{0, 3, 8, 15};
inline constexpr std::uint32_t kMostLobes = 15;
/// Bytes of a Gaussian's coefficients: half floats of three channels.
constexpr std::uint64_t lobe_bytes(std::uint32_t lobes) {
  return 3 * sizeof(std::uint16_t) * lobes;
}
/// No encoded block is larger: 17 columns of floats, normals included, and harmonics.
inline constexpr std::size_t kLargestSplatBytes =
    8 + (17 * sizeof(float) + lobe_bytes(kMostLobes)) * kMostSplatsPerBlock;

/// One Gaussian of a splat scene, as readers make it and sorting moves it.
struct Splat {
  Vec3f mean;
  Vec3f sigma;  ///< standard deviations along the axes of `rotation`; >= 0, one of them > 0
  std::array<float, 4> rotation{1, 0, 0, 0};  ///< unit quaternion w, x, y, z
  float alpha = 1;                            ///< opacity, in (0, 1]
  Vec3f colour;                               ///< as the scene encodes it, not clamped
  Vec3f normal;                               ///< unit, or 0 0 0 where the file has none
  bool operator==(const Splat&) const = default;
};

/// The largest standard deviation.
inline float size_of(const Splat& splat) {
  return std::max({splat.sigma.x, splat.sigma.y, splat.sigma.z});
}

/// Rounds everything but the mean to 16 significant bits, a relative error of at most 2^-16: far
/// below what a blend shows, and a quarter of those columns' bytes becomes zero
/// (docs/decisions/010-splat-store.md). What it rounded it leaves alone, and no size or opacity
/// above 0 becomes 0.
void round_for_store(Splat& splat);

/// Is no half float of these infinite or NaN?
bool all_finite(std::span<const std::uint16_t> halves);

/// The box of the Gaussian's 3-sigma ellipsoid: half extents 3 sqrt(Sigma_xx) and so on, rounded
/// outwards.
Box3f splat_box(const Splat& splat);

/// Neighbouring Gaussians of a splat scene: structure of arrays, every column of the same length
/// (at most kMostSplatsPerBlock), in the store's order. Values are finite and filtered: what cannot
/// be seen or is broken never gets here.
struct SplatBlock {
  std::array<PageVector<float>, 3> mean;  ///< x, y, z, after --source-axes
  std::array<PageVector<float>, 3>
      sigma;  ///< standard deviations along the axes of `rotation`; >= 0, the largest > 0
  /// Unit quaternion w, x, y, z. Axis k of the Gaussian is column k of its matrix.
  std::array<PageVector<float>, 4> rotation;
  PageVector<float> alpha;                  ///< opacity, in (0, 1]
  std::array<PageVector<float>, 3> colour;  ///< as the scene encodes it (sRGB-coded), not clamped
  /// Unit normals from the file, 0 0 0 for a Gaussian without one; all empty where no Gaussian of
  /// the block has one (then the shortest axis is meant, and its sign is unknown).
  std::array<PageVector<float>, 3> normal;
  std::uint32_t lobes = 0;  ///< one of kLobesOfDegree
  /// Half floats, finite: 3 * lobes columns of size() one after the other, in SplatRows' order.
  PageVector<std::uint16_t> sh;

  std::size_t size() const { return alpha.size(); }
  Splat splat(std::size_t i) const;
  /// Replaces the content by these; normals are kept if any is not 0 0 0. `coefficients`: those of
  /// one Gaussian after the other, 3 * lobes each.
  void assign(std::span<const Splat> splats, std::uint32_t lobes_each = 0,
              std::span<const std::uint16_t> coefficients = {});
  /// Bytes of a decoded block of that many Gaussians, whole pages.
  static std::uint64_t decoded_bytes(std::size_t splats, bool normals, std::uint32_t lobes);
};

/// Gaussians on their way from a reader to the sort, in the source's order. Everything is in the
/// job's axes, the harmonics too.
struct SplatRows {
  std::uint32_t lobes = 0;  ///< per Gaussian and channel, one of kLobesOfDegree
  PageVector<Splat> splats;
  /// Half floats, 3 * lobes per Gaussian: coefficient by coefficient in the order of 3DGS, red,
  /// green and blue of each together. colour = Splat::colour + sum of basis(direction) * these.
  PageVector<std::uint16_t> sh;
};

/// Filtered for compression, or as they are in memory, for what is not compressed.
enum class SplatBytes : std::uint8_t { filtered, plain };

/// Serialises a block into `raw` (replaced). Layout: docs/tile-format.md.
void encode(const SplatBlock& block, std::vector<std::byte>& raw,
            SplatBytes form = SplatBytes::filtered);
/// The inverse. Throws Error(damaged_store) naming `name` if `raw` is not what encode() makes of
/// Gaussians that a reader lets through.
SplatBlock decode_splats(std::span<const std::byte> raw, const std::string& name);

}  // namespace pounce::store
