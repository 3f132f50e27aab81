// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "pounce/options.h"

namespace pounce::options {

// From the text of one option's value to the value. `option` is the option's name for messages
// ("--size"). Every function throws Error(usage) that says what was given and what is expected;
// those that pounce/option_table.h declares are defined here, too.

/// Error(usage): "--size: got "x", expected ...".
[[noreturn]] void refuse_value(const std::string& option, const std::string& given,
                               const std::string& expected);

/// Letters of ASCII in lower case.
std::string lower(std::string text);
/// The parts of "a,b,c": at least one, which may be empty.
std::vector<std::string> split_at_commas(const std::string& text);

/// "true" or "false".
bool parse_switch(const std::string& option, const std::string& text);
/// A whole number of `lowest`..`highest` in decimal digits.
std::uint64_t parse_integer(const std::string& option, const std::string& text,
                            std::uint64_t lowest, std::uint64_t highest);
/// parse_bytes(), or "none": 0.
std::uint64_t parse_limit(const std::string& option, const std::string& text);
/// "N" (square) or "WxH", each side 1..65536 texels.
ImageSize parse_image_size(const std::string& option, const std::string& text);
/// "D" in the target's units, or "P%" of its diagonal, 0 < P <= 100.
Length parse_length(const std::string& option, const std::string& text);
/// What is multiplied into textures.
struct Factors {
  bool of_materials = false, of_vertices = false;
};
/// "apply" (both), "ignore" or "textures" (none), "factors" or "vertices".
Factors parse_factors(const std::string& option, const std::string& text);
/// "x0,y0,z0,x1,y1,z1": six numbers, the lower end of each side first.
AxisBox parse_box(const std::string& option, const std::string& text);
/// "x,y,z", or "middle".
AirPoint parse_air_point(const std::string& option, const std::string& text);
/// Channel names between commas, each at most once. What is no channel becomes one of `maps`.
std::vector<Channel> parse_channels(const std::string& option, const std::string& text,
                                    std::vector<OtherMap>& maps);
/// The same of what is baked, which has no maps.
std::vector<Channel> parse_baked(const std::string& option, const std::string& text);
/// "NAME=PATH"; NAME likewise, PATH may hold <UDIM> or <UVTILE>.
SourceTexture parse_source_texture(const std::string& option, const std::string& text,
                                   std::vector<OtherMap>& maps);
/// The name of one of `maps`, which is colour, or else data.
void parse_map_kind(const std::string& option, const std::string& name, bool is_colour,
                    std::vector<OtherMap>& maps);
/// "[NAME=]SPACE"; NAME likewise. The library knows which spaces there are.
SourceColourSpace parse_source_space(const std::string& option, const std::string& text,
                                     std::vector<OtherMap>& maps);
/// "CHANNEL=PATTERN": a channel's name as above, and an image pattern (below).
ChannelOutput parse_channel_output(const std::string& option, const std::string& text,
                                   std::vector<OtherMap>& maps);
/// "1001-1004,1011": UDIMs and ranges of them; sorted, each once.
std::vector<std::uint32_t> parse_udims(const std::string& option, const std::string& text);
/// Names of image formats between commas.
std::vector<ImageFormat> parse_formats(const std::string& option, const std::string& text);
/// A pattern for names: not empty, and not what looks like the next option.
std::string parse_name_pattern(const std::string& option, const std::string& text);
/// "x,-y,-z": x, y and z once each, with or without a sign.
std::string parse_axes(const std::string& option, const std::string& text);

// --- patterns of outputs -------------------------------------------------------------------------

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
