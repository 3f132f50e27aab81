// SPDX-License-Identifier: Apache-2.0
//
// The texels of a piece in the views of a scene: what of them is seen, and what is left for rays.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/page_pool.h"
#include "flow/stores/views.h"
#include "job/job_context.h"
#include "projection/splat_blend.h"
#include "surface/target_block.h"
#include "views/gather.h"

namespace pounce::flow {

/// A piece's texels and what they have seen.
struct AroundWork {
  PageVector<surface::TexelPacket> packets;
  PageVector<views::SightPacket> sights;  ///< one per packet
  std::vector<std::uint32_t> ray;  ///< of each packet: the one that looks for its unseen texels
  std::vector<surface::PacketGroup> groups;
  // Whose turn it is to look along their normals: packets of whole blocks, which are those of
  // groups[.., next_group).
  std::size_t first = 0, end = 0, next_group = 0;

  bool is_last_turn() const { return end == packets.size(); }
};

/// The turn goes to the blocks behind: their texels that no view sees become the packets of `rays`.
/// Of several turns each has a share of all packets (kTurns), or those of the largest block.
void take_turn(AroundWork& work, bool several, projection::SplatState& rays);

/// Looks the packets up in all views: tile by tile, each of which is read once for `at_once` of
/// them. `limits`: those of the views, and whether a texel's confidence is asked for. `backwards`:
/// from the last view on. Pieces that alternate find the tiles that the one before has left
/// decoded.
void look_around(job::JobContext& job, const SceneViews& views, const views::SightLimits& limits,
                 std::size_t at_once, bool backwards, AroundWork& work);

}  // namespace pounce::flow
