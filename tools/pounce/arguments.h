// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pounce/options.h"

namespace pounce::cli {

// From the text of one option's value to what the library takes. `option` is the option's name for
// messages ("--size"). Every function throws Error(usage) that says what was given and what is
// expected.

/// A whole number of `lowest`..`highest` in decimal digits.
std::uint64_t parse_integer(const std::string& option, const std::string& text,
                            std::uint64_t lowest, std::uint64_t highest);
/// A finite decimal number of `lowest`..`highest`.
double parse_number(const std::string& option, const std::string& text, double lowest,
                    double highest);
/// An amount of memory: a number >= 1 byte with an optional unit. K, M, G, T and KiB, MiB, GiB, TiB
/// count in 1024s; kB, MB, GB, TB in 1000s; upper and lower case are the same.
std::uint64_t parse_bytes(const std::string& option, const std::string& text);
/// The same, or "none": 0.
std::uint64_t parse_limit(const std::string& option, const std::string& text);
/// A time in seconds: a number with s, min, h, d or w.
double parse_duration(const std::string& option, const std::string& text);
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
/// "surface" or "gaussian".
Method parse_method(const std::string& option, const std::string& text);
/// "tent", "cubic" or "sharp".
Filter parse_filter(const std::string& option, const std::string& text);
/// "dc", "normal" or "mean".
SphericalHarmonics parse_harmonics(const std::string& option, const std::string& text);
/// "x0,y0,z0,x1,y1,z1": six numbers, the lower end of each side first.
AxisBox parse_box(const std::string& option, const std::string& text);
NormalY parse_normal_y(const std::string& option, const std::string& text);
Depth parse_depth(const std::string& option, const std::string& text);
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
/// An image path that may hold <CHANNEL>, <MATERIAL>, <TARGET>, <UDIM> and <UVTILE>; nothing else
/// between < and >, and no ending of a model.
std::string parse_image_pattern(const std::string& option, const std::string& text);
/// The same, or a model (.glb, .gltf), whose name may hold <TARGET>.
std::string parse_output(const std::string& option, const std::string& text);
/// "CHANNEL=PATTERN": a channel's name as above, and an image pattern.
ChannelOutput parse_channel_output(const std::string& option, const std::string& text,
                                   std::vector<OtherMap>& maps);
/// "1001-1004,1011": UDIMs and ranges of them; sorted, each once.
std::vector<std::uint32_t> parse_udims(const std::string& option, const std::string& text);
/// A pattern for names: not empty, and not what looks like the next option.
std::string parse_pattern(const std::string& option, const std::string& text);
/// "x,-y,-z": x, y and z once each, with or without a sign.
std::string parse_axes_text(const std::string& option, const std::string& text);
/// A path: not empty, and not what looks like the next option.
std::string parse_path(const std::string& option, const std::string& text);
/// A path for a report: one that ends as meshes, splats or images do is refused, since writing
/// there would replace an input or a result.
std::string parse_report_path(const std::string& option, const std::string& text);

}  // namespace pounce::cli
