// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>

#include "core/bounds.h"
#include "core/page_pool.h"
#include "gaussian/splat_set.h"
#include "surface/target_block.h"

namespace pounce::projection {

using surface::kLanes;
using surface::TexelPacket;

/// Bins of a texel's depth profile, from the outermost depth inwards. A depth between two is shared
/// by them, so the last two are only met by what lies at the other end.
inline constexpr int kDepthBins = 24;
inline constexpr int kProfileBins = kDepthBins + 2;
/// Profiles count in steps of 2^-22.
inline constexpr float kSplatSteps = 1 << 22;
/// Sums count in steps of 2^-36: a texel of which little is seen has a colour as exact as others.
inline constexpr double kSumSteps = 68719476736.0;
/// A Gaussian of which a texel sees less is hidden.
inline constexpr float kLeastSeen = 0x1p-24F;
/// A bin is full at an optical depth of 16: nothing is seen through a millionth of that, and no sum
/// of bins overflows.
inline constexpr std::int32_t kFullBin = 1 << 26;
/// The footprint of a fine texel, added to every Gaussian's 2D marginal, as a viewer's pixel does:
/// of a squared texel edge.
inline constexpr float kFootprint = 0.3F;
/// What a coarse texel adds to that: of how much its squared edge is more than a fine one's. That
/// of a box.
inline constexpr float kBoxVariance = 1.0F / 12;

/// A texel with less of a surface than that (SplatFinding::opacity) stays empty.
inline constexpr double kLeastOpacity = 0.1;

/// What counts when splats are blended (splat_blend.cpp says how). Lengths are in space.
struct SplatLimits {
  float reach = 0;           ///< how far along its normal, both ways, a texel looks
  float min_cosine = 0;      ///< between the texel's normal and that of a Gaussian that has one
  float window = 0;          ///< width of the depth window; half a texel at least
  float discness = 0;        ///< 0..1: are the scene's Gaussians the discs of a surface?
  bool antialiased = false;  ///< the scene was trained with opacity x sqrt(det / det')
  int rays = 0;              ///< beside each texel's normal: tilted()
  double least_opacity = kLeastOpacity;  ///< what texels find with less is not taken
  double least_confidence = 0;           ///< nor with less of SplatFinding::confidence
  float expected = 0;   ///< where along the normals the scene's surface is thought to lie
  float deviation = 0;  ///< from there; 0: nothing is known, a third of the reach
  /// Texels with longer edges are coarse: they show the mean of what they cover.
  float fine_edge = std::numeric_limits<float>::infinity();
};

/// What a texel adds to the variance of every Gaussian, in space.
inline float footprint_of(float edge, const SplatLimits& limits) {
  const float square = edge * edge, fine = std::min(square, limits.fine_edge * limits.fine_edge);
  return kFootprint * fine + kBoxVariance * (square - fine);
}

/// What one Gaussian gives to sixteen texels.
struct SplatResponse {
  float alpha[kLanes];               ///< opacity x response; 0: nothing
  float at[kLanes];                  ///< where in the profile, in bins
  std::int32_t first = 0, last = 0;  ///< bins of the lanes that get anything
  const gaussian::SplatShape* shape = nullptr;
};

/// Where sixteen texels look and what they have seen: structure of arrays.
struct alignas(64) DepthPacket {
  float per_bin[kLanes];           ///< 1 / width of a bin, > 0
  float per_window[kLanes];        ///< 1 / width of the window, > 0
  float anchor[kLanes];            ///< what lies farther out than this depth fades
  float focus[kLanes];             ///< depth of the window's middle
  std::int64_t weight[kLanes];     ///< sums of weights, in steps
  std::int64_t colour[3][kLanes];  ///< of weight x colour
  std::int64_t depth[kLanes];      ///< of weight x place in the profile, 0..1
  std::int32_t passed[kLanes];     ///< what the profile has from the anchor on
  std::int64_t square[kLanes];     ///< of weight x squared colour, all channels, each at most 1
  float footprint = 0;             ///< of the packet's largest texel: footprint_of()
  unsigned used = 0;               ///< bit per lane
};

/// What sixteen texels have met on their rays: the plain blend of a mesh's texels (splat_blend.h).
/// All sums are in steps of 2^-36. Lengths are in space.
struct alignas(64) RayPacket {
  std::int64_t weight[kLanes];     ///< of alpha x response x cosine
  std::int64_t colour[3][kLanes];  ///< of that x colour
  std::int64_t plain[kLanes];      ///< of response x cosine
  std::int64_t away[kLanes];       ///< of weight x distance / reach
  float reach[kLanes];             ///< how far a lane looks; 0: it has what it wants
};

/// What counts when the texels of a mesh are blended.
struct RayLimits {
  float max_distance = 0;  ///< along the ray, both ways
  float first_reach = 0;   ///< half the edge of a cell of the paper's grid
  float min_cosine = 0;    ///< of the angle between the two normals
};

/// Blurred optical depth, in steps: bin by bin, and once the surface is found, all until the end of
/// each bin.
struct alignas(64) ProfilePacket {
  std::int32_t bins[kProfileBins][kLanes];
};

/// Gaussians that a group of packets may meet, in arrays: their spheres and covariances.
class SplatCandidates {
 public:
  /// No more than `most` will be added.
  explicit SplatCandidates(std::size_t most);
  void clear() { count_ = 0; }
  std::size_t size() const { return count_; }
  void add(const gaussian::SplatSet& set, std::size_t i);
  const float* x(std::size_t i) const { return centre_[0].data() + i; }
  const float* y(std::size_t i) const { return centre_[1].data() + i; }
  const float* z(std::size_t i) const { return centre_[2].data() + i; }
  const float* radius(std::size_t i) const { return radius_.data() + i; }
  const float* covariance(std::size_t c, std::size_t i) const { return covariance_[c].data() + i; }
  const gaussian::SplatShape& shape(std::size_t i) const { return *shapes_[i]; }
  /// Bytes per Gaussian, with one of the arrays there twice while it grows, and of whole pages and
  /// registers beside them.
  static constexpr std::uint64_t kBytes = 10 * sizeof(float) + 2 * sizeof(void*);
  static constexpr std::uint64_t kFixedBytes = 12 * kPageBytes;

 private:
  std::size_t most_ = 0, count_ = 0;
  std::array<PageVector<float>, 3> centre_;
  PageVector<float> radius_;
  std::array<PageVector<float>, 6> covariance_;
  PageVector<const gaussian::SplatShape*> shapes_;
};

/// Candidates that respond() takes at once, at most.
inline constexpr std::size_t kMostResponses = 256;

/// The kernels, one build per instruction set; all give the same bits. Thread-safe.
struct SplatKernels {
  const char* isa;  ///< "sse2", "avx2", "avx512"
  /// Appends what the bundle may meet within `height` with so much of a footprint (its variance).
  void (*gather)(std::span<const gaussian::SplatSet* const> sets, const RayBundle& bundle,
                 float height, float footprint, SplatCandidates& out);
  /// Writes the responses of candidates [first, last) that reach some lane and returns their
  /// number; `first` is a multiple of 16, last - first at most kMostResponses. Writes nothing
  /// beyond last - first responses. Adds them to `profile`, if there is one.
  std::size_t (*respond)(const SplatCandidates& candidates, std::size_t first, std::size_t last,
                         const RayBundle& bundle, const TexelPacket& packet,
                         const DepthPacket& depths, const SplatLimits& limits, SplatResponse* out,
                         ProfilePacket* profile);
  /// Finds the lanes' surface: the anchor and the focus. The profile becomes sums from the
  /// outermost bin inwards, without what lies before the anchor.
  void (*find_surface)(const SplatLimits& limits, ProfilePacket& profile, DepthPacket& depths);
  /// Adds responses to the sums, as far as the profile lets them be seen, with the colours
  /// that the packet's normals see.
  void (*accumulate)(std::span<const SplatResponse> responses, const TexelPacket& packet,
                     const ProfilePacket& profile, const SplatLimits& limits, DepthPacket& depths);
  /// Adds all candidates that the packet's rays meet within their reach, none of which is beyond
  /// `height`.
  void (*add_met)(const SplatCandidates& candidates, const RayBundle& bundle, float height,
                  const TexelPacket& packet, const RayLimits& limits, RayPacket& sums);
};

/// The kernels for `isa`, as instruction_set() chooses.
const SplatKernels& splat_kernels(const std::string& isa);

}  // namespace pounce::projection
