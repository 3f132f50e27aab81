// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <vector>

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

}  // namespace pounce::planning
