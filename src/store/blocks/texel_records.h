// SPDX-License-Identifier: Apache-2.0
//
// Covered texels of a dense target, one by one: where a block has about as many triangles as
// texels, these are smaller than the triangles and quicker to read.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/bytes.h"
#include "core/octahedral.h"

namespace pounce::store {

inline constexpr std::uint16_t kNoTriangle = 0xFFFF;

/// What a projection needs of one covered texel. Its length unit is the block's `step`.
struct TexelRecord {
  std::array<std::int32_t, 3> position{};  ///< in steps
  Octahedral normal{};
  std::uint16_t edge = 0;              ///< upper half of a float's bits: the texel's edge in space
  std::array<std::int8_t, 3> inset{};  ///< from the position to where the ray starts, in steps
  bool operator==(const TexelRecord&) const = default;
};

/// Positions are no larger: times the step they are exact floats.
inline constexpr std::int32_t kLargestPosition = 1 << 24;
inline constexpr float kSmallestStep = 0x1p-126F, kLargestStep = 0x1p100F;
/// Bytes of a record before compression.
inline constexpr std::size_t kRecordBytes = 3 * 4 + 2 * 2 + 2 + 3;

/// Appends step, coverage and records. `owner` has the record of each texel of the block, in raster
/// order, kNoTriangle where no texel is covered. Layout: docs/tile-format.md.
void put_records(std::vector<std::byte>& raw, float step, const std::vector<std::uint16_t>& owner,
                 const std::vector<TexelRecord>& records);
/// The inverse. Fails if the bytes are not what put_records() makes.
void get_records(ByteReader& in, float& step, std::vector<std::uint16_t>& owner,
                 std::vector<TexelRecord>& records);

}  // namespace pounce::store
