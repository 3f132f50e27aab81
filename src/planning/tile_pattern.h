// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "mesh/uv_tiles.h"

namespace pounce::planning {

/// Does the path name a set of UDIM tiles: has it <UDIM> or <UVTILE>?
bool is_tile_pattern(const std::string& path);
/// The image of a tile in such a set.
std::string tile_path(const std::string& pattern, mesh::UvTile tile);

/// The set that "skin.1002.png" or "skin_u2_v1.png" is called one of, and its tile in it.
struct NamedTile {
  std::string pattern;
  mesh::UvTile tile;
};
/// By the last number in the file's name, its ending aside, that has four digits and is a UDIM's;
/// else by the last "u2_v1". Nothing: it is called like no tile. A year is a UDIM's number, too:
/// what else is in the folder, and where UVs lie, must say whether a set is meant.
std::optional<NamedTile> named_tile(const std::string& path);

}  // namespace pounce::planning
