// SPDX-License-Identifier: Apache-2.0
//
// The names of choices, for options, reports and messages alike. Each enumeration has one list of
// names, in its own order, which both directions read. A new enumerator needs its name at the same
// place in its list.
#include "pounce/options.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <string_view>

#include "pounce/error.h"

namespace pounce {
namespace {

// In the order of the enumerations.
constexpr std::array<const char*, kChannelCount + kEvidenceCount + kShapeCount> kChannelNames = {
    "baseColor",  "metallicRoughness", "occlusion", "emissive", "normal",
    "confidence", "distance",          "height",    "position", "vertexColor"};
constexpr std::array<const char*, 2> kNormalYNames = {"up", "down"};
constexpr std::array<const char*, 2> kMethodNames = {"surface", "gaussian"};
constexpr std::array<const char*, 3> kFilterNames = {"tent", "cubic", "sharp"};
constexpr std::array<const char*, 3> kHarmonicsNames = {"dc", "normal", "mean"};
constexpr std::array kLookNames{"auto", "around", "normal"};
constexpr std::array<const char*, 2> kImageFormatNames = {"bmp", "tga"};
constexpr std::array<const char*, 3> kSandboxNames = {"auto", "on", "off"};
constexpr std::array<const char*, 4> kDepthNames = {"u8", "u16", "half", "float"};

template <class Enum, std::size_t N>
std::optional<Enum> find_name(const std::array<const char*, N>& names, const std::string& name) {
  for (std::size_t i = 0; i < N; ++i) {
    if (name == names[i]) return static_cast<Enum>(i);
  }
  return std::nullopt;
}

}  // namespace

const char* channel_name(Channel channel) noexcept {
  if (channel == Channel::hits) return "hits";  // which no option takes
  return is_other(channel) ? "other" : kChannelNames[static_cast<std::size_t>(channel)];
}

std::string channel_name(const TransferOptions& options, Channel channel) {
  return is_other(channel) ? options.channels.other_maps.at(other_index(channel)).name
                           : channel_name(channel);
}

bool is_map_name(const std::string& name) noexcept {
  constexpr std::size_t kLongest = 64;
  const auto is_letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); };
  const bool is_written = std::all_of(name.begin(), name.end(), [&](char c) {
    return is_letter(c) || (c >= '0' && c <= '9') || c == '-' || c == '_';
  });
  // A custom map's name becomes part of file names and of option values: no path, no separator,
  // nothing that looks like an option.
  if (name.empty() || name.size() > kLongest || !is_written || name.front() == '-') return false;
  const auto is_same = [&](std::string_view other) {
    // Letters differ in one bit from their other case, and no other sign that is allowed does.
    return name.size() == other.size() &&
           std::equal(name.begin(), name.end(), other.begin(),
                      [](char a, char b) { return (a | 0x20) == (b | 0x20); });
  };
  return !is_same("all") && std::none_of(kChannelNames.begin(), kChannelNames.end(), is_same);
}

std::optional<Channel> channel_from_name(const std::string& name) noexcept {
  return find_name<Channel>(kChannelNames, name);
}

const char* normal_y_name(NormalY direction) noexcept {
  return kNormalYNames[static_cast<std::size_t>(direction)];
}

std::optional<NormalY> normal_y_from_name(const std::string& name) noexcept {
  return find_name<NormalY>(kNormalYNames, name);
}

const char* depth_name(Depth depth) noexcept {
  return kDepthNames[static_cast<std::size_t>(depth)];
}

std::optional<Depth> depth_from_name(const std::string& name) noexcept {
  return find_name<Depth>(kDepthNames, name);
}

const char* image_format_name(ImageFormat format) noexcept {
  return kImageFormatNames[static_cast<std::size_t>(format)];
}

std::optional<ImageFormat> image_format_from_name(const std::string& name) noexcept {
  return find_name<ImageFormat>(kImageFormatNames, name);
}

const char* sandbox_name(Sandbox sandbox) noexcept {
  return kSandboxNames[static_cast<std::size_t>(sandbox)];
}

std::optional<Sandbox> sandbox_from_name(const std::string& name) noexcept {
  return find_name<Sandbox>(kSandboxNames, name);
}

const char* method_name(Method method) noexcept {
  return kMethodNames[static_cast<std::size_t>(method)];
}

std::optional<Method> method_from_name(const std::string& name) noexcept {
  return find_name<Method>(kMethodNames, name);
}

const char* filter_name(Filter filter) noexcept {
  return kFilterNames[static_cast<std::size_t>(filter)];
}

std::optional<Filter> filter_from_name(const std::string& name) noexcept {
  return find_name<Filter>(kFilterNames, name);
}

const char* harmonics_name(SphericalHarmonics harmonics) noexcept {
  return kHarmonicsNames[static_cast<std::size_t>(harmonics)];
}

std::optional<SphericalHarmonics> harmonics_from_name(const std::string& name) noexcept {
  return find_name<SphericalHarmonics>(kHarmonicsNames, name);
}

const char* look_name(Look look) noexcept { return kLookNames[static_cast<std::size_t>(look)]; }

std::optional<Look> look_from_name(const std::string& name) noexcept {
  return find_name<Look>(kLookNames, name);
}

const char* error_kind_name(ErrorKind kind) noexcept {
  switch (kind) {
    case ErrorKind::usage:
      return "usage";
    case ErrorKind::input:
      return "input";
    case ErrorKind::budget:
      return "budget";
    case ErrorKind::storage:
      return "storage";
    case ErrorKind::damaged_store:
      return "damaged_store";
    case ErrorKind::internal:
      return "internal";
    case ErrorKind::busy:
      return "busy";
    case ErrorKind::cancelled:
      return "cancelled";
  }
  return "internal";
}

}  // namespace pounce
