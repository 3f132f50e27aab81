// SPDX-License-Identifier: Apache-2.0
#include "gaussian/splat_columns.h"

#include <algorithm>
#include <utility>

namespace pounce::gaussian {

std::uint64_t SplatColumns::most_bytes(std::uint64_t splats, std::uint32_t lobes) {
  constexpr std::uint64_t kBesideTree = 3 + 4 + 1 + 3;  // sigma, rotation, alpha, colour
  return sizeof(SplatColumns) + kBesideTree * round_to_pages(splats * sizeof(float)) +
         round_to_pages(splats * store::lobe_bytes(lobes)) + tree_bytes(splats);
}

SplatColumns make_splat_columns(store::SplatBlock block) {
  const std::size_t count = block.size();
  const auto take = [&](PageVector<float>& column) {
    column.resize(whole_registers(count));  // decoding has left the room
    return std::move(column);
  };
  SplatColumns out;
  SplatSpheres& spheres = out.levels[0];
  spheres.count = count;
  for (std::size_t k = 0; k < 3; ++k) {
    spheres.centre[k] = take(block.mean[k]);
    out.sigma[k] = take(block.sigma[k]);
    out.colour[k] = take(block.colour[k]);
  }
  for (std::size_t k = 0; k < 4; ++k) out.rotation[k] = take(block.rotation[k]);
  out.alpha = take(block.alpha);
  out.lobes = block.lobes;
  out.sh = std::move(block.sh);
  spheres.radius.resize(whole_registers(count));
  for (std::size_t i = 0; i < count; ++i) {
    const float sigma = std::max({out.sigma[0][i], out.sigma[1][i], out.sigma[2][i]});
    spheres.radius[i] = kSplatCutOff * sigma * kSphereMargin;
  }
  make_levels(out.levels);
  return out;
}

}  // namespace pounce::gaussian
