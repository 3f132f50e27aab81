// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/vec.h"

namespace pounce::mesh {

/// A unit square of UV space. Columns count to the right from u = 0, rows upwards from v = 0 (v
/// up): UDIM 1001 is (0, 0), 1002 is (1, 0), 1011 is (0, 1).
struct UvTile {
  std::int32_t column = 0, row = 0;
  auto operator<=>(const UvTile&) const = default;
};

inline constexpr std::int32_t kUdimColumns = 10;
inline constexpr std::uint32_t kFirstUdim = 1001, kLastUdim = 9999;  ///< four digits

/// 1001 + column + 10 row; nothing for tiles that have no such number of four digits.
std::optional<std::uint32_t> udim_number(UvTile tile);
/// The tile of a UDIM number.
UvTile udim_tile(std::uint32_t udim);
/// The tile as <UVTILE> spells it: "u1_v1" is UDIM 1001.
std::string uvtile_name(UvTile tile);

/// {1001, 1002, 1003, 1011} -> "1001-1003, 1011".
std::string udim_list(const std::vector<std::uint32_t>& sorted);

/// How many periods below v = 0 (v down, as in Mesh) the tile begins: what an instance's shift_y
/// and a texture's row count.
inline std::int32_t period_y(UvTile tile) { return -tile.row; }
inline UvTile tile_of_period(std::int32_t x, std::int32_t y) { return {x, -y}; }

/// Calls visit(tile) for every tile that a triangle (UVs with v down) shares some area with, and
/// returns how many. A triangle that only touches a tile's border is not in it; one without UV area
/// is in none. Visits at most 65536; beyond that it returns the larger count without visiting any.
std::uint64_t visit_uv_tiles(const std::array<Vec2d, 3>& uvs,
                             const std::function<void(UvTile)>& visit);

}  // namespace pounce::mesh
