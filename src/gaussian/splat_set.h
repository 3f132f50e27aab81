// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/bounds.h"
#include "core/page_pool.h"
#include "gaussian/splat_spheres.h"
#include "pounce/options.h"
#include "store/blocks/splat_block.h"

namespace pounce::gaussian {

/// One Gaussian, ready to be blended.
struct SplatShape {
  float mean[3];
  float alpha;             ///< opacity
  float flatness;          ///< 1: a round disc; a needle or a ball is next to nothing
  float axis[3][3];        ///< unit, right-handed; the longest first
  float variance[3];       ///< along the axes: the squared standard deviations
  float normal[3];         ///< of the file, or the shortest axis
  float colour[3];         ///< of degree 0; 0..kLargestSplatColour where there are no harmonics
  std::int32_t two_sided;  ///< the normal's sign is unknown
  std::int32_t lobes;      ///< of its harmonics, one of store::kLobesOfDegree
  /// 3 * lobes coefficients in the order of store::SplatRows, weighted for the texels that look:
  /// with the direction d = -n from the eye to the surface a texel of unit normal n sees colour +
  /// sum basis(d) * sh, clamped to 0..kLargestSplatColour. Of the SplatSet.
  const float* sh;
};

/// Colours are clamped to 0..8 each: what a viewer shows ends at 1, and sums stay in 64 bits.
inline constexpr float kLargestSplatColour = 8;

/// A block of Gaussians as projection uses it: its Gaussians and a tree over them (SplatSpheres).
struct SplatSet {
  SplatSet() = default;
  SplatSet(SplatSet&&) = default;  // shapes point into sh, which a move leaves where it is
  SplatSet& operator=(SplatSet&&) = default;

  PageVector<SplatShape> shapes;
  PageVector<float> sh;  ///< of one Gaussian after the other
  SplatTree levels;
  /// Covariances of the Gaussians, in arrays like levels[0]: xx, xy, xz, yy, yz, zz.
  std::array<PageVector<float>, 6> covariance;

  /// Makes room for so many Gaussians: most_bytes().
  void reserve(std::size_t splats, std::uint32_t lobes);
  void clear();  ///< the room stays

  /// Bytes of a set of so many Gaussians, known from the index before it is read.
  static std::uint64_t most_bytes(std::uint64_t splats, std::uint32_t lobes);
};

/// Gaussians of all these sets.
inline std::size_t count_of(std::span<const SplatSet* const> sets) {
  std::size_t count = 0;
  for (const SplatSet* set : sets) count += set->shapes.size();
  return count;
}

/// A texel of unit normal n is looked at from the hemisphere around n. `normal`: from n itself.
/// `mean`: from everywhere, by cosine, which is `normal` with the coefficients of degree 1 times
/// 2/3, degree 2 times 1/4 and degree 3 times 0: a clamped cosine's share of each degree.
SplatSet make_splat_set(const store::SplatBlock& block,
                        SphericalHarmonics harmonics = SphericalHarmonics::mean);

/// The numbers of the Gaussians whose ellipsoids, out to the cut-off, some of the boxes may meet.
/// Of a block whose own box meets none of them, none.
void find_near(const store::SplatBlock& block, std::span<const Box3f> boxes,
               std::vector<std::uint16_t>& near);

/// The same from parts of several blocks, which have as many lobes: adds these Gaussians of a block
/// (by their numbers, in order); finish() makes the tree over all that were added.
void add_splats(const store::SplatBlock& block, std::span<const std::uint16_t> which,
                SphericalHarmonics harmonics, SplatSet& set);
void finish(SplatSet& set);

}  // namespace pounce::gaussian
