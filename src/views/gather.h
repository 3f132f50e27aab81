// SPDX-License-Identifier: Apache-2.0
//
// What the views that see a texel show there.
//
// A view sees a texel that faces its eye, where the target's own surface is met about where the
// texel is and the scene is there. Of the views that do, those count in which the scene does not
// lie before the texel, if there are any: a target may be a part of its scene. The colour is their
// mean, weighed by a power of the cosine. All sums are integers, so views and tiles come in any
// order. The rule's figures: docs/decisions/061-views.md.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/page_pool.h"
#include "projection/splat_blend.h"
#include "surface/target_block.h"
#include "views/grid.h"
#include "views/kernels.h"

namespace pounce::views {

using surface::kLanes;
using surface::TexelPacket;

/// Weights are squares of the cosine in so many steps: sums of kMostViews stay in 32 bits.
inline constexpr float kWeightSteps = 255;

inline constexpr float kLeastCosine = 0.1F;  ///< of a texel that faces a view

/// Of the target's diagonal: how near the target's surface in a view a texel that it sees lies, and
/// how far before it the scene may be and not hide it.
inline constexpr double kOnTarget = 0.012, kHidden = 0.04;
/// The same: where the near walls of a room are taken away, the scene begins so far before the
/// first surface that faces the eye (docs/decisions/063-rooms.md).
inline constexpr double kBeforeInside = 0.01;

inline constexpr float kLeastSeen = 0.5F;  ///< alpha of what is seen

/// Brightness is the mean of red, twice green and blue: 0..1 in so many steps.
inline constexpr float kLumaSteps = 255;

/// What sixteen texels have seen: structure of arrays. Sums of numbers below 2^16 with weights of
/// at most kWeightSteps.
struct alignas(64) SightPacket {
  /// Of the views in which the scene does not hide the texel, and of the others.
  struct Sums {
    std::int32_t weight[kLanes];
    std::int32_t colour[3][kLanes];  ///< of weight x colour, in its steps
    std::int32_t alpha[kLanes];      ///< of weight x alpha, in its steps
    std::int32_t away[kLanes];       ///< of weight x how far outside the scene lies, in depth steps
    // For the confidence alone.
    std::int32_t off[kLanes];           ///< as `away`, whichever side
    std::int32_t luma[kLanes];          ///< of weight x brightness, in kLumaSteps
    std::int32_t luma_squares[kLanes];  ///< of weight x its square
  };
  Sums clear, hidden;
  std::int32_t facing[kLanes];  ///< weights of all views that a texel faces
};

/// What is seen at all is a colour of the scene: no view's texel is less sure than that.
inline constexpr double kLeastConfidence = 0.1;

/// What decides which views see a texel, beside the grid: in depth steps.
struct SightLimits {
  float on_target = 0, hidden = 0;
  /// False: nobody asks how sure a texel is. Sums that tell it alone are left out, and its
  /// confidence is kLeastConfidence.
  bool tells_confidence = true;
};

/// A tile of a view.
struct ViewTiles {
  std::uint32_t tile_x = 0, tile_y = 0;
  const std::uint16_t* scene = nullptr;   ///< kStoredEdge rows of kSceneSamples each
  const std::uint16_t* target = nullptr;  ///< kStoredEdge rows
};

/// Tiles of a view in which some texel of a packet lies that faces the eye: a range, ends included.
struct TileRange {
  std::uint16_t x0 = 1, x1 = 0, y0 = 1, y1 = 0;
  bool empty() const { return x0 > x1; }
  bool operator==(const TileRange&) const = default;
};

/// Sixteen texels in a view.
struct alignas(64) PlacePacket {
  float x[kLanes], y[kLanes], depth[kLanes];  ///< as in Seen
  float cosine[kLanes];                       ///< of the normal with the way to the eye
  std::int32_t weight[kLanes];                ///< 0: it does not face the eye
  TileRange tiles;                            ///< in which those lie that face it
  /// How many packets, from this one on, have that range. Of the first of them alone; else unset.
  std::uint32_t alike;
};

/// Where packets lie in a view; counts in `sights` how much they face it.
void place(const Grid& grid, std::uint32_t view, const ViewKernels& kernels,
           std::span<const TexelPacket> packets, std::vector<PlacePacket>& places,
           std::span<SightPacket> sights);

/// Takes texels that nothing hides out of packets, and what the others have counted of facing
/// views: these look again. False: there are none.
bool drop_clear(std::span<TexelPacket> packets, std::span<SightPacket> sights);

/// How many of these packets have texels that no view sees.
std::size_t count_unseen(std::span<const TexelPacket> packets, std::span<const SightPacket> sights);

/// The texels of these groups that no view sees become packets of `rays`, in their groups. `places`
/// says of each packet of the groups which one there has its unseen texels.
void leave_unseen(std::span<const surface::PacketGroup> groups,
                  std::span<const TexelPacket> packets, std::span<const SightPacket> sights,
                  std::span<std::uint32_t> places, projection::SplatState& rays);

/// What the texels of a packet have seen, lane by lane: nothing where no view sees them. Opacity is
/// the alpha of what is there.
projection::SplatFindings sights_of(const Grid& grid, const SightLimits& limits,
                                    const SightPacket& packet);

}  // namespace pounce::views
