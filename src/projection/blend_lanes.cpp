// SPDX-License-Identifier: Apache-2.0
//
// Finds the lanes' kernels, and places the lookups that leave an image: those few are done one by
// one, by the wrap mode, where all others are placed sixteen at once.
#include "projection/blend_lanes.h"

#include <algorithm>

#include "core/instruction_set.h"

namespace pounce::projection {

namespace sse2 {
extern const BlendLanes kBlendLanes;
}
namespace avx2 {
extern const BlendLanes kBlendLanes;
}
namespace avx512 {
extern const BlendLanes kBlendLanes;
}

const BlendLanes& blend_lanes(const std::string& isa) {
  const std::string chosen = instruction_set(isa);
  return chosen == "avx512" ? avx512::kBlendLanes
         : chosen == "avx2" ? avx2::kBlendLanes
                            : sse2::kBlendLanes;
}

void PlacesLanes::settle() {
  for (auto* const rests : {&rest_x, &rest_y}) {
    for (double& rest : *rests) rest = settled(rest);
  }
}

void PlacesLanes::set_place(std::size_t lane, Coordinate at_x, Coordinate at_y) {
  // Texel -1 belongs to the first tile's apron.
  const std::int32_t tile_x = std::max(at_x.texel, 0) / mesh::kBlockEdge,
                     tile_y = std::max(at_y.texel, 0) / mesh::kBlockEdge;
  constexpr std::int32_t kFirst = store::kApron - 1;
  // The first of the 4x4 texels is one before the hit's own, and a tile begins with its apron.
  const std::int32_t column = at_x.texel - tile_x * mesh::kBlockEdge + kFirst,
                     row = at_y.texel - tile_y * mesh::kBlockEdge + kFirst;
  rest_x[lane] = at_x.rest;
  rest_y[lane] = at_y.rest;
  tile[lane] = tile_y * 65536 + tile_x;
  offset[lane] = row * store::kColourTileEdge + column;
}

}  // namespace pounce::projection
