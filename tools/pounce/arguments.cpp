// SPDX-License-Identifier: Apache-2.0
#include "arguments.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <system_error>

#include "pounce/error.h"

namespace pounce::cli {
namespace {

constexpr std::uint32_t kLargestSide = 65536;  // ImageSize's own limit
constexpr double kLargestBytes = 0x1p62;       // fits every signed 64-bit file offset
constexpr double kLongestTimeS = 1e10;         // 300 years
constexpr double kLargestDistance = 1e30;      // squares still fit a double and a float's exponent

[[noreturn]] void refuse(const std::string& option, const std::string& given,
                         const std::string& expected) {
  throw Error(ErrorKind::usage,
              fmt::format("{}: got \"{}\", expected {}", option, given, expected));
}

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

bool ends_with(const std::string& text, const std::string& ending) {
  return text.size() >= ending.size() &&
         text.compare(text.size() - ending.size(), ending.size(), ending) == 0;
}

/// The number at the start of `text`; `rest` becomes what follows it. False if there is none or it
/// is not finite. from_chars: the same in every locale.
bool leading_number(const std::string& text, double& value, std::string& rest) {
  const char* const end = text.data() + text.size();
  const auto [stop, failure] = std::from_chars(text.data(), end, value);
  if (failure != std::errc() || !std::isfinite(value)) return false;
  rest.assign(stop, end);
  return true;
}

bool whole_number(const std::string& text, std::uint64_t& value) {
  const char* const end = text.data() + text.size();
  const auto [stop, failure] = std::from_chars(text.data(), end, value);
  return failure == std::errc() && stop == end;
}

/// Bytes in a unit (already lower case); 0 if there is no such unit.
double unit_bytes(const std::string& unit) {
  if (unit.empty() || unit == "b") return 1;
  constexpr std::string_view kPrefixes = "kmgt";
  const std::size_t power = kPrefixes.find(unit[0]);
  if (power == std::string_view::npos) return 0;
  const std::string ending = unit.substr(1);
  const double exponent = static_cast<double>(power) + 1;
  if (ending.empty() || ending == "ib") return std::pow(1024.0, exponent);
  return ending == "b" ? std::pow(1000.0, exponent) : 0;
}

/// The number of the map with this name, which may be new.
std::size_t map_of(const std::string& name, std::vector<OtherMap>& maps) {
  const auto at =
      std::find_if(maps.begin(), maps.end(), [&](const OtherMap& map) { return map.name == name; });
  if (at != maps.end()) return static_cast<std::size_t>(at - maps.begin());
  maps.push_back({name, std::nullopt});
  return maps.size() - 1;
}

/// The channel that has this name in other cases of its letters; "" if none has.
std::string name_in_its_case(const std::string& name) {
  for (int c = 0; c < static_cast<int>(Channel::other); ++c) {
    const std::string known = channel_name(static_cast<Channel>(c));
    if (lower(known) == lower(name)) return known;
  }
  return "";
}

Channel parse_channel(const std::string& option, const std::string& name,
                      std::vector<OtherMap>& maps) {
  if (const std::optional<Channel> channel = channel_from_name(name)) return *channel;
  if (const std::string known = name_in_its_case(name); !known.empty())
    refuse(option, name, fmt::format("{}, from which it differs in case only", known));
  if (!is_map_name(name) || maps.size() >= kMostOtherMaps) {
    refuse(
        option, name,
        "baseColor, metallicRoughness, occlusion, emissive or normal; of splat scenes baseColor, "
        "confidence or distance; or a name of your own in letters, digits, - and _");
  }
  return other_channel(map_of(name, maps));
}

}  // namespace

std::uint64_t parse_integer(const std::string& option, const std::string& text,
                            std::uint64_t lowest, std::uint64_t highest) {
  std::uint64_t value = 0;
  if (!whole_number(text, value) || value < lowest || value > highest) {
    refuse(option, text, fmt::format("a whole number from {} to {}", lowest, highest));
  }
  return value;
}

double parse_number(const std::string& option, const std::string& text, double lowest,
                    double highest) {
  double value = 0;
  std::string rest;
  if (!leading_number(text, value, rest) || !rest.empty() || value < lowest || value > highest) {
    refuse(option, text, fmt::format("a number from {:g} to {:g}", lowest, highest));
  }
  return value;
}

std::uint64_t parse_bytes(const std::string& option, const std::string& text) {
  double value = 0;
  std::string unit;
  const bool is_number = leading_number(text, value, unit);
  // "34.5 MiB", as messages write it, may be copied.
  if (unit.size() > 1 && unit[0] == ' ') unit.erase(0, 1);
  const double scale = is_number ? unit_bytes(lower(unit)) : 0;
  const double bytes = std::floor(value * scale);
  if (!(bytes >= 1 && bytes <= kLargestBytes)) {
    refuse(option, text, "an amount of memory such as 512MiB, 1.5G or 4096 (bytes)");
  }
  return static_cast<std::uint64_t>(bytes);
}

std::uint64_t parse_limit(const std::string& option, const std::string& text) {
  return text == "none" ? 0 : parse_bytes(option, text);
}

double parse_duration(const std::string& option, const std::string& text) {
  double value = 0;
  std::string unit;
  const bool is_number = leading_number(text, value, unit);
  double scale = 0;
  for (const auto& [name, seconds] :
       {std::pair{"s", 1.0}, {"min", 60.0}, {"h", 3600.0}, {"d", 86400.0}, {"w", 604800.0}}) {
    if (unit == name) scale = seconds;
  }
  const double time_s = value * scale;
  if (!is_number || !(scale > 0 && time_s >= 0 && time_s <= kLongestTimeS)) {
    refuse(option, text, "a time such as 30d, 12h, 90min or 45s (w is weeks)");
  }
  return time_s;
}

ImageSize parse_image_size(const std::string& option, const std::string& text) {
  const std::size_t cross = text.find_first_of("xX");
  const std::string first = text.substr(0, cross);
  const std::string second = cross == std::string::npos ? first : text.substr(cross + 1);
  std::uint64_t width = 0;
  std::uint64_t height = 0;
  const bool fits = whole_number(first, width) && whole_number(second, height) && width >= 1 &&
                    height >= 1 && width <= kLargestSide && height <= kLargestSide;
  if (!fits) {
    refuse(option, text,
           fmt::format("texels as N or WxH (1024, 2048x1024), each from 1 to {}", kLargestSide));
  }
  return {static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height)};
}

Length parse_length(const std::string& option, const std::string& text) {
  Length length;
  std::string rest;
  const bool is_number = leading_number(text, length.value, rest);
  length.is_percent = rest == "%";
  const double highest = length.is_percent ? 100 : kLargestDistance;
  if (!is_number || !(rest.empty() || length.is_percent) || !(length.value > 0) ||
      length.value > highest) {
    refuse(option, text,
           "a length above 0 in the target's units (0.25), or up to 100% of its diagonal (5%)");
  }
  return length;
}

Factors parse_factors(const std::string& option, const std::string& text) {
  if (text == "apply") return {true, true};
  if (text == "ignore" || text == "textures") return {false, false};
  if (text == "factors") return {true, false};
  if (text == "vertices") return {false, true};
  refuse(option, text, "apply, ignore, textures, factors or vertices");
}

Method parse_method(const std::string& option, const std::string& text) {
  const std::optional<Method> method = method_from_name(text);
  if (!method) refuse(option, text, "surface or gaussian");
  return *method;
}

Filter parse_filter(const std::string& option, const std::string& text) {
  const std::optional<Filter> filter = filter_from_name(text);
  if (!filter) refuse(option, text, "tent, cubic or sharp");
  return *filter;
}

SphericalHarmonics parse_harmonics(const std::string& option, const std::string& text) {
  const auto harmonics = harmonics_from_name(text);
  if (!harmonics) refuse(option, text, "dc, normal or mean");
  return *harmonics;
}

AxisBox parse_box(const std::string& option, const std::string& text) {
  AxisBox box;
  std::string rest = "," + text;
  for (std::size_t i = 0; i < 6; ++i) {
    double& value = i < 3 ? box.lowest[i] : box.highest[i - 3];
    const bool is_next = rest.starts_with(",");
    std::string after;
    if (!is_next || !leading_number(rest.substr(1), value, after) || (i == 5 && !after.empty()))
      refuse(option, text, "six numbers, lowest x,y,z before highest x,y,z (-1,-1,0,1,1,2)");
    rest = after;
  }
  return box;
}

NormalY parse_normal_y(const std::string& option, const std::string& text) {
  const std::optional<NormalY> direction = normal_y_from_name(text);
  if (!direction) refuse(option, text, "up or down");
  return *direction;
}

Depth parse_depth(const std::string& option, const std::string& text) {
  const std::optional<Depth> depth = depth_from_name(text);
  if (!depth) refuse(option, text, "u8, u16, half or float");
  return *depth;
}

std::vector<Channel> parse_channels(const std::string& option, const std::string& text,
                                    std::vector<OtherMap>& maps) {
  std::vector<Channel> channels;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string name = text.substr(begin, end - begin);
    if (name == "all")
      refuse(option, text, "all by itself, or the channels by name: baseColor,confidence");
    const Channel channel = parse_channel(option, name, maps);
    if (std::find(channels.begin(), channels.end(), channel) != channels.end()) {
      refuse(option, text, fmt::format("{} only once", name));
    }
    channels.push_back(channel);
    begin = end + 1;
  }
  return channels;
}

std::vector<Channel> parse_baked(const std::string& option, const std::string& text) {
  std::vector<Channel> channels;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string name = text.substr(begin, end - begin);
    const std::optional<Channel> channel = channel_from_name(name);
    if (!channel) refuse(option, name, "normal, height, position or vertexColor");
    if (std::find(channels.begin(), channels.end(), *channel) != channels.end())
      refuse(option, text, fmt::format("{} only once", name));
    channels.push_back(*channel);
    begin = end + 1;
  }
  return channels;
}

namespace {

/// The end of the run of characters from `at` on that are of a kind.
template <class Kind>
std::size_t run_end(const std::string& text, std::size_t at, Kind kind) {
  while (at < text.size() && kind(static_cast<unsigned char>(text[at]))) ++at;
  return at;
}

/// The end of a token of another program that begins here; 0 if none does. `is_tile`: it stands for
/// a tile of UV space, not for a number of any kind.
std::size_t foreign_token_end(const std::string& text, std::size_t at, bool& is_tile) {
  const auto is_digit = [](unsigned char c) { return std::isdigit(c) != 0; };
  const auto is_letter = [](unsigned char c) { return std::isalpha(c) != 0; };
  const auto next = [&](std::size_t i) { return i < text.size() ? text[i] : '\0'; };
  is_tile = false;
  if (text[at] == '%') {  // %(UDIM)d, %04d; a %d alone may be a word's ("100%done")
    const std::size_t close = next(at + 1) == '(' ? text.find(')', at) : at;
    is_tile = close != at;
    if (close == std::string::npos) return 0;
    const std::size_t end = run_end(text, close + 1, is_digit);
    const bool is_number = next(end) == 'd' && (is_tile || end > close + 1);
    return is_number || (is_tile && next(end) == 's') ? end + 1 : 0;
  }
  if (text[at] == '$') {  // $F, $F4, ${F}, $UDIM
    const std::size_t begin = at + (next(at + 1) == '{' ? 2 : 1);
    const std::size_t end = run_end(text, begin, is_letter);
    const std::string name = lower(text.substr(begin, end - begin));
    is_tile = name == "udim";
    if (!is_tile && name != "f" && name != "ff") return 0;
    const std::size_t digits = run_end(text, end, is_digit);
    return begin == at + 2 && next(digits) == '}' ? digits + 1 : digits;
  }
  if (text[at] == '#') {
    const std::size_t end = run_end(text, at, [](unsigned char c) { return c == '#'; });
    return end - at > 1 ? end : 0;
  }
  for (const std::string name : {"<udim>", "<uvtile>", "{udim}", "[udim]", "_mapid_"}) {
    const std::string found = text.substr(at, name.size());
    is_tile = lower(found) == name && found != "<UDIM>" && found != "<UVTILE>";
    if (is_tile) return at + name.size();
  }
  // A bare word between separators: skin.UDIM.png.
  const auto separates = [](char c) { return c == '.' || c == '_' || c == '-'; };
  if (at > 0 && separates(text[at - 1]) && text.compare(at, 4, "UDIM") == 0 &&
      separates(next(at + 4))) {
    is_tile = true;
    return at + 4;
  }
  return 0;
}

/// Refuses what stands for a tile, or unless `tiles_only` for a frame, in other programs: here it
/// would be a name like any. `text` is looked at from `at` on.
void check_foreign_tokens(const std::string& option, const std::string& text, std::size_t at,
                          bool tiles_only) {
  for (; at < text.size(); ++at) {
    bool is_tile = false;
    const std::size_t end = foreign_token_end(text, at, is_tile);
    if (end == 0 || (tiles_only && !is_tile)) continue;
    const std::string token = text.substr(at, end - at);
    refuse(option, text,
           is_tile
               ? fmt::format("<UDIM> (1001) or <UVTILE> (u1_v1) for a tile's number, not {}", token)
               : fmt::format("no {}: pounce has no frames, and writes a UDIM tile's number as "
                             "<UDIM>",
                             token));
  }
}

/// Refuses anything between < and > that is not one of `tokens`.
void check_tokens(const std::string& option, const std::string& text,
                  const std::vector<std::string>& tokens) {
  for (std::size_t begin = text.find('<'); begin != std::string::npos;
       begin = text.find('<', begin + 1)) {
    const std::size_t end = text.find('>', begin);
    if (end == std::string::npos) break;
    const std::string token = text.substr(begin, end + 1 - begin);
    if (std::find(tokens.begin(), tokens.end(), token) == tokens.end()) {
      refuse(option, text,
             fmt::format("one of {} between < and >, not {}", fmt::join(tokens, ", "), token));
    }
  }
}

/// Of an output. Folders may be called what they like: they are there already.
void check_file_name(const std::string& option, const std::string& text) {
  check_foreign_tokens(option, text, text.rfind('/') + 1, false);  // npos + 1 is 0
}

}  // namespace

void parse_map_kind(const std::string& option, const std::string& name, bool is_colour,
                    std::vector<OtherMap>& maps) {
  if (channel_from_name(name) || !is_map_name(name) || maps.size() >= kMostOtherMaps)
    refuse(option, name, "the name of a map of your own; what channels of materials are is fixed");
  OtherMap& map = maps[map_of(name, maps)];
  if (map.is_colour && *map.is_colour != is_colour)
    refuse(option, name, "either --data or --color for it");
  map.is_colour = is_colour;
}

SourceTexture parse_source_texture(const std::string& option, const std::string& text,
                                   std::vector<OtherMap>& maps) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals + 1 == text.size()) {
    refuse(option, text, "NAME=PATH, for example baseColor=skin.png");
  }
  SourceTexture texture{parse_channel(option, text.substr(0, equals), maps),
                        text.substr(equals + 1)};
  std::error_code unknown;
  if (!std::filesystem::exists(texture.path, unknown))
    check_foreign_tokens(option, text, equals + 1, true);
  check_tokens(option, text, {"<UDIM>", "<UVTILE>"});
  return texture;
}

SourceColourSpace parse_source_space(const std::string& option, const std::string& text,
                                     std::vector<OtherMap>& maps) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos) return {std::nullopt, text};
  return {parse_channel(option, text.substr(0, equals), maps), text.substr(equals + 1)};
}

std::string parse_image_pattern(const std::string& option, const std::string& text) {
  parse_path(option, text);
  for (const char* ending : {".glb", ".gltf"}) {
    if (ends_with(lower(text), ending)) {
      refuse(option, text, "an image (.png, .jpg, .tif, .tx, .exr)");
    }
  }
  check_file_name(option, text);
  check_tokens(option, text, {"<CHANNEL>", "<MATERIAL>", "<TARGET>", "<UDIM>", "<UVTILE>"});
  return text;
}

std::string parse_output(const std::string& option, const std::string& text) {
  const bool is_model = ends_with(lower(text), ".glb") || ends_with(lower(text), ".gltf");
  if (!is_model) return parse_image_pattern(option, text);
  parse_path(option, text);
  check_file_name(option, text);
  check_tokens(option, text, {"<TARGET>"});
  return text;
}

ChannelOutput parse_channel_output(const std::string& option, const std::string& text,
                                   std::vector<OtherMap>& maps) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals + 1 == text.size())
    refuse(option, text, "CHANNEL=PATTERN, for example height=height.exr");
  const Channel channel = parse_channel(option, text.substr(0, equals), maps);
  return {channel, parse_image_pattern(option, text.substr(equals + 1))};
}

std::vector<std::uint32_t> parse_udims(const std::string& option, const std::string& text) {
  constexpr const char* kExpected = "UDIMs of 1001 to 9999, such as 1001-1004,1011";
  std::vector<std::uint32_t> udims;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string part = text.substr(begin, end - begin);
    const std::size_t dash = part.find('-');
    const auto number = [&](const std::string& digits) -> std::uint32_t {
      const bool valid = digits.size() == 4 && digits >= "1001" &&
                         digits.find_first_not_of("0123456789") == std::string::npos;
      if (!valid) refuse(option, text, kExpected);
      return static_cast<std::uint32_t>(std::stoul(digits));
    };
    const std::uint32_t first = number(part.substr(0, dash));
    const std::uint32_t last = dash == std::string::npos ? first : number(part.substr(dash + 1));
    if (last < first) refuse(option, text, kExpected);
    for (std::uint32_t udim = first; udim <= last; ++udim) udims.push_back(udim);
    begin = end + 1;
  }
  std::sort(udims.begin(), udims.end());
  udims.erase(std::unique(udims.begin(), udims.end()), udims.end());
  return udims;
}

std::string parse_pattern(const std::string& option, const std::string& text) {
  if (text.empty() || text.starts_with("--")) refuse(option, text, "a name or pattern (* ? [a-c])");
  return text;
}

std::string parse_axes_text(const std::string& option, const std::string& text) {
  std::string letters;
  bool valid = true;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    std::string name = text.substr(begin, end - begin);
    if (name.starts_with('-') || name.starts_with('+')) name.erase(0, 1);
    valid = valid && name.size() == 1;
    letters += name;
    begin = end + 1;
  }
  std::sort(letters.begin(), letters.end());
  if (!valid || letters != "xyz") refuse(option, text, "x, y and z once each, such as x,-y,-z");
  return text;
}

std::string parse_path(const std::string& option, const std::string& text) {
  if (text.empty() || (text.size() > 1 && text[0] == '-')) {
    refuse(option, text, "a path (write ./-name for a file whose name begins with -)");
  }
  return text;
}

std::string parse_report_path(const std::string& option, const std::string& text) {
  static constexpr const char* kNotReports[] = {
      ".glb", ".gltf", ".bin", ".obj", ".mtl", ".ply",  ".png",  ".jpg", ".jpeg", ".tif", ".tiff",
      ".tx",  ".exr",  ".ppm", ".pgm", ".pnm", ".webp", ".ktx2", ".bmp", ".tga",  ".hdr"};
  const std::string path = lower(parse_path(option, text));
  for (const char* ending : kNotReports) {
    if (ends_with(path, ending))
      refuse(option, text, "a name for JSON (such as report.json), not for a mesh or an image");
  }
  return text;
}

}  // namespace pounce::cli
