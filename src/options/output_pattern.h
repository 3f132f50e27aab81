// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace pounce::options {

/// An image path that may hold <CHANNEL>, <MATERIAL>, <TARGET>, <UDIM> and <UVTILE>; nothing else
/// between < and >, and no ending of a model. Throws Error(usage), as do all of these.
std::string parse_image_pattern(const std::string& option, const std::string& text);
/// The same, or a model (.glb, .gltf), whose name may hold <TARGET>.
std::string parse_output(const std::string& option, const std::string& text);

/// Refuses what stands for a tile, or unless `tiles_only` for a frame, in other programs: here it
/// would be a name like any. `text` is looked at from `at` on.
void check_foreign_tokens(const std::string& option, const std::string& text, std::size_t at,
                          bool tiles_only);
/// Refuses anything between < and > that is not one of `tokens`.
void check_tokens(const std::string& option, const std::string& text,
                  const std::vector<std::string>& tokens);

}  // namespace pounce::options
