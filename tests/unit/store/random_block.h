// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>

#include "store/blocks/geometry_block.h"
#include "support/random.h"

namespace pounce::test {

/// A block with any floats (NaN and infinity too, if `any_bits`) and, if asked for, shifts and
/// owners in runs.
inline store::GeometryBlock random_block(Random& random, bool shifts, bool owner, bool any_bits) {
  store::GeometryBlock block;
  block.page = static_cast<std::uint32_t>(random.below(4));
  block.x = static_cast<std::int32_t>(random.whole(-5, 1000));
  block.y = static_cast<std::int32_t>(random.whole(-5, 1000));
  const std::uint64_t triangles = 1 + random.below(300);
  const std::uint64_t vertices = 3 + random.below(3 * triangles - 2);
  const auto any = [&] {
    return any_bits ? std::bit_cast<float>(static_cast<std::uint32_t>(random.bits()))
                    : random.between(-1.0F, 1.0F);
  };
  const auto snorm = [&] { return static_cast<std::int16_t>(random.whole(-32767, 32767)); };
  for (std::uint64_t i = 0; i < vertices; ++i) {
    block.positions.push_back({any(), any(), any()});
    block.normals.push_back({any(), any(), any()});
    block.uvs.push_back({any(), any()});
    block.tangents.push_back({snorm(), snorm(), snorm(), snorm()});
  }
  for (std::uint64_t i = 0; shifts && i < vertices; ++i)  // both are rare
    block.colours.push_back({any(), any(), any(), any()});
  const auto vertex = [&] { return static_cast<std::uint16_t>(random.below(vertices)); };
  for (std::uint64_t i = 0; i < triangles; ++i) {
    block.triangles.push_back({vertex(), vertex(), vertex()});
    block.ids.push_back(static_cast<std::uint32_t>(random.bits()));
    if (shifts) {
      block.shifts.push_back({static_cast<std::int32_t>(random.whole(-9, 9)),
                              static_cast<std::int32_t>(random.whole(-9, 9))});
    }
  }
  if (shifts) block.shifts.back()[1] = 7;  // not all zero
  while (owner && block.owner.size() < store::kTexelsPerBlock) {
    const std::uint16_t value =
        random.one_in(4) ? store::kNoTriangle : static_cast<std::uint16_t>(random.below(triangles));
    const std::uint64_t room = store::kTexelsPerBlock - block.owner.size();
    block.owner.insert(block.owner.end(), std::min(room, 1 + random.below(100)), value);
  }
  return block;
}

}  // namespace pounce::test
