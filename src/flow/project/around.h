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
#include "surface/target_block.h"
#include "views/gather.h"

namespace pounce::flow {

/// A piece's texels and what they have seen.
struct AroundWork {
  PageVector<surface::TexelPacket> packets;
  PageVector<views::SightPacket> sights;  ///< one per packet
  std::vector<std::uint32_t> ray;  ///< of each packet: the one that looks for its unseen texels
};

/// Looks the packets up in all views: tile by tile, each of which is read once for all of them.
void look_around(job::JobContext& job, const SceneViews& views, AroundWork& work);

}  // namespace pounce::flow
