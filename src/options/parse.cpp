// SPDX-License-Identifier: Apache-2.0
//
// From text to values: what the command line, job files and set_option() have in common.
//
// A parser refuses what makes no sense by itself and says what would: the option, the text as it
// was given, and what is expected with an example. What depends on other options or on files is
// checked later (planning/check_options.cpp and the planners), so a parser never needs more than
// its text. The one exception are custom maps, whose names get numbers as they appear.
//
// Numbers are read by from_chars, which knows no locale: "0,5" is not a number anywhere, and a job
// file means the same on every machine. Not finite is not a number. Limits keep byte offsets, and
// squares of lengths in double precision, finite: code behind this need not check again.
//
// Letters are compared as ASCII. Names of channels have one spelling, and one that differs in the
// case of its letters is refused with the right one, since it would otherwise become a custom map.
#include "options/parse.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <numeric>
#include <optional>
#include <string_view>
#include <system_error>

#include "pounce/error.h"
#include "pounce/option_table.h"

namespace pounce {

namespace options {
namespace {

constexpr std::uint32_t kLargestSide = 65536;  // ImageSize's own limit
constexpr double kLargestBytes = 0x1p62;       // fits every signed 64-bit file offset
constexpr double kLongestTimeS = 1e10;         // 300 years
constexpr double kLargestDistance = 1e30;      // a float holds it, a double its square

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
  // K and KiB are powers of 1024, only kB is one of 1000; the same holds for larger units.
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
  // Whether it is colour is not known yet, and may never be stated: then its name decides.
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
  // The order matters: first what is a channel, then what is nearly one, and only the rest may be a
  // map.
  if (const std::optional<Channel> channel = channel_from_name(name)) return *channel;
  if (const std::string known = name_in_its_case(name); !known.empty())
    refuse_value(option, name, fmt::format("{} (names are case-sensitive)", known));
  // A name that cannot be a map's is more likely a mistake: the message lists the channels.
  if (!is_map_name(name) || maps.size() >= kMostOtherMaps) {
    refuse_value(
        option, name,
        "baseColor, metallicRoughness, occlusion, emissive or normal; for splat scenes baseColor, "
        "confidence or distance; or a custom map's name of letters, digits, - and _");
  }
  return other_channel(map_of(name, maps));
}

}  // namespace

[[noreturn]] void refuse_value(const std::string& option, const std::string& given,
                               const std::string& expected) {
  throw Error(ErrorKind::usage,
              fmt::format("{}: got \"{}\", expected {}", option, given, expected));
}

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return text;
}

std::vector<std::string> split_at_commas(const std::string& text) {
  std::vector<std::string> parts;
  // A comma at the end gives an empty last part, which every caller refuses as a value.
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    parts.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

bool parse_switch(const std::string& option, const std::string& text) {
  if (text != "true" && text != "false") refuse_value(option, text, "true or false");
  return text == "true";
}

std::uint64_t parse_integer(const std::string& option, const std::string& text,
                            std::uint64_t lowest, std::uint64_t highest) {
  std::uint64_t value = 0;
  if (!whole_number(text, value) || value < lowest || value > highest) {
    refuse_value(option, text, fmt::format("a whole number from {} to {}", lowest, highest));
  }
  return value;
}

std::uint64_t parse_limit(const std::string& option, const std::string& text) {
  // 0 stands for no limit inside. It cannot be typed: parse_bytes() refuses less than a byte.
  return text == "none" ? 0 : parse_bytes(option, text);
}

ImageSize parse_image_size(const std::string& option, const std::string& text) {
  // Without a cross the whole text is both sides: substr() up to npos.
  const std::size_t cross = text.find_first_of("xX");
  const std::string first = text.substr(0, cross);
  const std::string second = cross == std::string::npos ? first : text.substr(cross + 1);
  std::uint64_t width = 0;
  std::uint64_t height = 0;
  const bool fits = whole_number(first, width) && whole_number(second, height) && width >= 1 &&
                    height >= 1 && width <= kLargestSide && height <= kLargestSide;
  if (!fits) {
    refuse_value(
        option, text,
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
    refuse_value(
        option, text,
        "a length above 0 in the target's units (0.25), or up to 100% of its diagonal (5%)");
  }
  return length;
}

Factors parse_factors(const std::string& option, const std::string& text) {
  if (text == "apply") return {true, true};
  if (text == "ignore" || text == "textures") return {false, false};
  if (text == "factors") return {true, false};
  if (text == "vertices") return {false, true};
  refuse_value(option, text, "apply, ignore, textures, factors or vertices");
}

namespace {

/// Exactly so many numbers with commas between them.
template <std::size_t count>
std::array<double, count> parse_numbers(const std::string& option, const std::string& text,
                                        const char* expected) {
  std::array<double, count> numbers{};
  // With a comma in front all are alike: a comma, then a number.
  std::string rest = "," + text;
  for (double& value : numbers) {
    std::string after;
    if (!rest.starts_with(",") || !leading_number(rest.substr(1), value, after))
      refuse_value(option, text, expected);
    rest = after;
  }
  if (!rest.empty()) refuse_value(option, text, expected);
  return numbers;
}

}  // namespace

AxisBox parse_box(const std::string& option, const std::string& text) {
  constexpr const char* kExpected =
      "six numbers, lowest x,y,z before highest x,y,z (-1,-1,0,1,1,2)";
  const auto numbers = parse_numbers<6>(option, text, kExpected);
  AxisBox box;
  for (std::size_t k = 0; k < 3; ++k) {
    box.lowest[k] = numbers[k];
    box.highest[k] = numbers[k + 3];
    if (box.lowest[k] > box.highest[k]) refuse_value(option, text, kExpected);
  }
  return box;
}

AirPoint parse_air_point(const std::string& option, const std::string& text) {
  if (text == "middle") return {};
  return {parse_numbers<3>(option, text, "x,y,z (0,1.5,0.2), or middle")};
}

std::vector<Channel> parse_channels(const std::string& option, const std::string& text,
                                    std::vector<OtherMap>& maps) {
  std::vector<Channel> channels;
  // "all" among names is refused: it would say less, or more, than the names beside it.
  for (const std::string& name : split_at_commas(text)) {
    if (name == "all")
      refuse_value(option, text, "all alone, or the channels by name: baseColor,confidence");
    const Channel channel = parse_channel(option, name, maps);
    if (std::find(channels.begin(), channels.end(), channel) != channels.end()) {
      refuse_value(option, text, fmt::format("{} only once", name));
    }
    channels.push_back(channel);
  }
  return channels;
}

// No custom map can be baked, so other names are refused at once. Which channels can be is known in
// planning/check_options.cpp.
std::vector<Channel> parse_baked(const std::string& option, const std::string& text) {
  std::vector<Channel> channels;
  for (const std::string& name : split_at_commas(text)) {
    const std::optional<Channel> channel = channel_from_name(name);
    if (!channel) refuse_value(option, name, "normal, height, position or vertexColor");
    if (std::find(channels.begin(), channels.end(), *channel) != channels.end())
      refuse_value(option, text, fmt::format("{} only once", name));
    channels.push_back(*channel);
  }
  return channels;
}

void parse_map_kind(const std::string& option, const std::string& name, bool is_colour,
                    std::vector<OtherMap>& maps) {
  if (channel_from_name(name) || !is_map_name(name) || maps.size() >= kMostOtherMaps)
    refuse_value(option, name,
                 "the name of a custom map; the kinds of material channels are fixed");
  // The map may be named here before any option gives it an image.
  OtherMap& map = maps[map_of(name, maps)];
  if (map.is_colour && *map.is_colour != is_colour)
    refuse_value(option, name, "either --data or --color for it, not both");
  map.is_colour = is_colour;
}

SourceTexture parse_source_texture(const std::string& option, const std::string& text,
                                   std::vector<OtherMap>& maps) {
  // At the first "=": a path may have more of them, a name has none.
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals + 1 == text.size()) {
    refuse_value(option, text, "NAME=PATH, such as baseColor=skin.png");
  }
  SourceTexture texture{parse_channel(option, text.substr(0, equals), maps),
                        text.substr(equals + 1)};
  std::error_code unknown;
  // Whoever names a file that exists means it, whatever it is called. Tokens of frames are no
  // business of a texture: reading it reports that there is no such file.
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

ChannelOutput parse_channel_output(const std::string& option, const std::string& text,
                                   std::vector<OtherMap>& maps) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals + 1 == text.size())
    refuse_value(option, text, "CHANNEL=PATTERN, such as height=height.exr");
  const Channel channel = parse_channel(option, text.substr(0, equals), maps);
  return {channel, parse_image_pattern(option, text.substr(equals + 1))};
}

std::vector<std::uint32_t> parse_udims(const std::string& option, const std::string& text) {
  constexpr const char* kExpected = "UDIMs of 1001 to 9999, such as 1001-1004,1011";
  std::vector<std::uint32_t> udims;
  for (const std::string& part : split_at_commas(text)) {
    const std::size_t dash = part.find('-');
    const auto number = [&](const std::string& digits) -> std::uint32_t {
      // Four digits from 1001 on compare as text as they do as numbers.
      const bool valid = digits.size() == 4 && digits >= "1001" &&
                         digits.find_first_not_of("0123456789") == std::string::npos;
      if (!valid) refuse_value(option, text, kExpected);
      return static_cast<std::uint32_t>(std::stoul(digits));
    };
    const std::uint32_t first = number(part.substr(0, dash));
    const std::uint32_t last = dash == std::string::npos ? first : number(part.substr(dash + 1));
    if (last < first) refuse_value(option, text, kExpected);
    for (std::uint32_t udim = first; udim <= last; ++udim) udims.push_back(udim);
  }
  // Sorted and each once, which planning relies on (std::binary_search in target_pages.cpp).
  std::sort(udims.begin(), udims.end());
  udims.erase(std::unique(udims.begin(), udims.end()), udims.end());
  return udims;
}

std::vector<ImageFormat> parse_formats(const std::string& option, const std::string& text) {
  std::vector<ImageFormat> formats;
  for (const std::string& name : split_at_commas(text)) {
    const std::optional<ImageFormat> format = image_format_from_name(name);
    if (!format) {
      throw Error(ErrorKind::usage, fmt::format("{}: got \"{}\", expected bmp or tga; other "
                                                "formats need no permission or are not supported{}",
                                                option, name, did_you_mean(name, {"bmp", "tga"})));
    }
    formats.push_back(*format);
  }
  return formats;
}

std::string parse_name_pattern(const std::string& option, const std::string& text) {
  // A name that begins with two dashes is an option whose predecessor lacks its value.
  if (text.empty() || text.starts_with("--"))
    refuse_value(option, text, "a name or pattern (* ? [a-c])");
  return text;
}

std::string parse_axes(const std::string& option, const std::string& text) {
  std::string letters;
  bool valid = true;
  for (std::string name : split_at_commas(text)) {
    if (name.starts_with('-') || name.starts_with('+')) name.erase(0, 1);
    valid = valid && name.size() == 1;
    letters += name;
  }
  // The text stays as it is; core/job_space.h reads it where it is used.
  std::sort(letters.begin(), letters.end());
  if (!valid || letters != "xyz")
    refuse_value(option, text, "x, y and z once each, such as x,-y,-z");
  return text;
}

}  // namespace options

double parse_number(const std::string& option, const std::string& text, double lowest,
                    double highest) {
  double value = 0;
  std::string rest;
  if (!options::leading_number(text, value, rest) || !rest.empty() || value < lowest ||
      value > highest) {
    options::refuse_value(option, text, fmt::format("a number from {:g} to {:g}", lowest, highest));
  }
  return value;
}

std::uint64_t parse_bytes(const std::string& option, const std::string& text) {
  double value = 0;
  std::string unit;
  const bool is_number = options::leading_number(text, value, unit);
  // "34.5 MiB", as messages write it, may be copied.
  if (unit.size() > 1 && unit[0] == ' ') unit.erase(0, 1);
  const double scale = is_number ? options::unit_bytes(options::lower(unit)) : 0;
  // A fraction of a unit is common (1.5G), a fraction of a byte is dropped.
  const double bytes = std::floor(value * scale);
  if (!(bytes >= 1 && bytes <= options::kLargestBytes)) {
    options::refuse_value(option, text, "an amount of memory such as 512MiB, 1.5G or 4096 (bytes)");
  }
  return static_cast<std::uint64_t>(bytes);
}

double parse_duration(const std::string& option, const std::string& text) {
  double value = 0;
  std::string unit;
  const bool is_number = options::leading_number(text, value, unit);
  double scale = 0;
  // No default unit: "30" could be seconds or days, and a cache is pruned by it.
  for (const auto& [name, seconds] :
       {std::pair{"s", 1.0}, {"min", 60.0}, {"h", 3600.0}, {"d", 86400.0}, {"w", 604800.0}}) {
    if (unit == name) scale = seconds;
  }
  const double time_s = value * scale;
  if (!is_number || !(scale > 0 && time_s >= 0 && time_s <= options::kLongestTimeS)) {
    options::refuse_value(option, text, "a time such as 30d, 12h, 90min or 45s (w is weeks)");
  }
  return time_s;
}

std::string parse_path(const std::string& option, const std::string& text) {
  // "-" alone is a path: where it makes sense it stands for standard output.
  if (text.empty() || (text.size() > 1 && text[0] == '-')) {
    options::refuse_value(option, text,
                          "a path (write ./-name for a file whose name begins with -)");
  }
  return text;
}

// --- misspelt words ------------------------------------------------------------------------------
//
// Which known word a misspelt one probably means: the one with the fewest edits between them, if
// these are few for its length. An edit inserts, removes or replaces a letter, or exchanges two
// neighbours (Damerau's distance, by the usual table of which three rows are needed at a time).
//
// A wrong proposal is worse than none, since it sends its reader the wrong way. Hence the limit,
// which grows with the length of the word: a short one is near to everything.

namespace {

constexpr std::size_t kLettersPerEdit = 3;  // "basecolour" has two edits; unrelated words have more
constexpr std::size_t kClearBeginning = 5;  // letters that mean a name by its beginning: --max-dist

std::size_t edits_between(const std::string& a, const std::string& b) {
  // row[j] counts the edits between the first i letters of `a` and the first j of `b`; `last` and
  // `before` are the rows of i - 1 and i - 2.
  std::vector<std::size_t> before, last(b.size() + 1), row(b.size() + 1);
  std::iota(last.begin(), last.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = last[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      row[j] = std::min({replaced, last[j] + 1, row[j - 1] + 1});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        row[j] = std::min(row[j], before[j - 2] + 1);
    }
    before = last;
    last = row;
  }
  return last.back();
}

}  // namespace

std::string did_you_mean(const std::string& word, const std::vector<std::string>& known) {
  std::string best;
  std::size_t least = std::max<std::size_t>(1, word.size() / kLettersPerEdit) + 1;
  for (const std::string& name : known) {
    // A beginning is one edit, however much is missing: whoever types half of a name knows which
    // one.
    const bool begins = word.size() >= kClearBeginning && name.starts_with(word);
    const std::size_t edits =
        begins ? 1 : edits_between(options::lower(word), options::lower(name));
    // Of equals the first, in the order of the table: it must be the same one every time.
    if (edits >= least) continue;
    least = edits;
    best = name;
  }
  return best.empty() ? "" : fmt::format("; did you mean {}?", best);
}

}  // namespace pounce
