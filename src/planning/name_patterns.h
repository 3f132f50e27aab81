// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "mesh/uv_tiles.h"
#include "pounce/options.h"

namespace pounce::planning {

/// The pattern with its tokens replaced: "a.<CHANNEL>.png" and {{"CHANNEL", "baseColor"}} ->
/// "a.baseColor.png". Throws Error(usage) naming a token that is not in `values`.
std::string expand_pattern(const std::string& pattern,
                           const std::map<std::string, std::string>& values);
bool has_token(const std::string& pattern, const std::string& token);
/// A name as part of a file name: separators and control characters become '_'.
std::string file_name_part(const std::string& name);

/// The pattern of this channel's images.
const std::string& output_of(const TransferOptions& options, Channel channel);

/// Throws Error(usage) when two of the images would get one name, saying `cure`, or when a name is
/// too long for the file system; Error(storage) where no file can be made: a folder that may not be
/// written or made, a link that leads nowhere, something that is no file.
void check_outputs(const std::vector<std::string>& paths,
                   const std::string& cure = "add <CHANNEL> or <MATERIAL> to the pattern");

/// Throws Error(usage) where the output is one of these files, under whatever name.
void refuse_over_input(const std::string& output, const std::vector<std::string>& inputs);

/// What the images of a model output would be called, as a pattern: one per material and channel.
/// Throws Error(usage) for tokens that a model has no use for.
std::string model_image_pattern(const std::string& output);

// --- sets of UDIM tiles --------------------------------------------------------------------------

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
