// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "job/job_context.h"
#include "pounce/options.h"
#include "store/blocks/hit_store.h"

namespace pounce::flow {

/// One image of a hit map (projection/hit_map.h).
struct MapRequest {
  std::string path;
  ImageSize size;
  std::uint64_t decoder_bytes = 0;
  std::size_t source_pages = 0;
  float max_distance = 0;  ///< of the search that found them: for the report's distances
};

/// The hits of an image as a store, as a search leaves them; or as the cache has them by the
/// image's content. Throws Error(input) for what no map has.
std::unique_ptr<store::HitStore> map_hits(job::JobContext& job, const MapRequest& request,
                                          bool* cached);
/// What that takes at once.
std::uint64_t map_hits_bytes(const MapRequest& request);

}  // namespace pounce::flow
