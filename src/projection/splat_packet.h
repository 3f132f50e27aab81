// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "core/ray_bundle.h"
#include "source/splat_set.h"
#include "target/target_block.h"

namespace pounce::projection {

using target::kLanes;
using target::TexelPacket;

/// Bins of a texel's depth profile: the middle one at the texel itself, kDepthBins on each side
/// that may be the window's centre, and what their neighbourhood takes.
inline constexpr int kDepthBins = 16;
inline constexpr int kMiddleBin = kDepthBins + 3;
inline constexpr int kProfileBins = 2 * kMiddleBin + 1;
/// Profiles count weights in steps of 2^-22, sums in steps of 2^-36.
inline constexpr float kProfileSteps = 1 << 22;
/// A bin is full at 64 opaque Gaussians: no scene is told apart above that, and nothing overflows.
inline constexpr std::int32_t kFullBin = 1 << 28;
/// Half the window, in units of its width: beyond it a Gaussian weighs exactly nothing.
inline constexpr float kWindowReach = 3;
/// The texel's own footprint, added to every Gaussian's 2D marginal: of a squared texel edge.
inline constexpr float kFootprint = 0.3F;

/// What counts when splats are blended.
struct SplatLimits {
  float max_distance = 0;    ///< of the window's centre from the texel
  float min_cosine = 0;      ///< of the angle between the texel's and the Gaussian's normals
  float window = 0;          ///< width of the depth window in space; half a texel at least
  bool antialiased = false;  ///< the scene was trained with opacity x sqrt(det / det')
};

/// What one Gaussian gives to sixteen texels before the depth window. Lengths are in texels.
struct SplatResponse {
  float weight[kLanes];  ///< without the needle factor; 0: nothing
  float depth[kLanes];   ///< of the best hit along the texel's normal
  const source::SplatShape* shape = nullptr;
};

/// Where sixteen texels stand: structure of arrays. Lengths are in texels.
struct alignas(64) DepthPacket {
  float per_width[kLanes];         ///< 1 / width of a bin at the height of the search, > 0
  float centre[kLanes];            ///< the window's, once found
  float take[kLanes];              ///< 1: found at this height, 0: already blended or still open
  std::int64_t weight[kLanes];     ///< sum of weights, in steps of 2^-36
  std::int64_t colour[3][kLanes];  ///< sums of weight x colour, in the same steps
  std::uint32_t open = 0;          ///< bit per lane: no centre yet
};

/// What sixteen texels have met on their rays: the plain blend of a mesh's texels (ray_blend.h).
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

/// Weights by depth, in steps, bin by bin.
struct alignas(64) ProfilePacket {
  std::int32_t bins[kProfileBins][kLanes];
};

/// Gaussians that a group of packets may meet: spheres in arrays.
class SplatCandidates {
 public:
  void clear() { count_ = 0; }
  std::size_t size() const { return count_; }
  void add(const source::SplatSet& set, std::size_t i);
  const float* x(std::size_t i) const { return centre_[0].data() + i; }
  const float* y(std::size_t i) const { return centre_[1].data() + i; }
  const float* z(std::size_t i) const { return centre_[2].data() + i; }
  const float* radius(std::size_t i) const { return radius_.data() + i; }
  const source::SplatShape& shape(std::size_t i) const { return *shapes_[i]; }
  /// Bytes per Gaussian, at most.
  static constexpr std::uint64_t kBytes = 2 * (4 * sizeof(float) + sizeof(void*));

 private:
  std::size_t count_ = 0;
  std::array<PageVector<float>, 3> centre_;
  PageVector<float> radius_;
  PageVector<const source::SplatShape*> shapes_;
};

/// Candidates that respond() takes at once, at most.
inline constexpr std::size_t kMostResponses = 256;

/// The kernels, one build per instruction set; all give the same bits. Thread-safe.
struct SplatKernels {
  const char* isa;  ///< "sse2", "avx2", "avx512"
  /// Appends what the bundle may meet within `height`.
  void (*gather)(const source::SplatSet& set, const RayBundle& bundle, float height,
                 SplatCandidates& out);
  /// Writes the responses of candidates [first, last) that reach some lane and returns their
  /// number; `first` is a multiple of 16, last - first at most kMostResponses. Writes nothing
  /// beyond last - first responses.
  std::size_t (*respond)(const SplatCandidates& candidates, std::size_t first, std::size_t last,
                         const RayBundle& bundle, float height, const TexelPacket& packet,
                         const SplatLimits& limits, SplatResponse* out);
  /// Adds responses to the depth profiles.
  void (*deposit)(std::span<const SplatResponse> responses, const DepthPacket& depths,
                  ProfilePacket& profile);
  /// Adds responses inside the windows to the sums of the lanes that take, with the colours that
  /// the packet's normals see.
  void (*accumulate)(std::span<const SplatResponse> responses, const TexelPacket& packet,
                     DepthPacket& depths);
  /// Adds all candidates that the packet's rays meet within their reach, none of which is beyond
  /// `height`.
  void (*add_met)(const SplatCandidates& candidates, const RayBundle& bundle, float height,
                  const TexelPacket& packet, const RayLimits& limits, RayPacket& sums);
};

/// The kernels for `isa`, or the best that this processor has for "". Throws Error(usage) if it
/// lacks them.
const SplatKernels& splat_kernels(const std::string& isa);

}  // namespace pounce::projection
