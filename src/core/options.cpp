// SPDX-License-Identifier: Apache-2.0
#include "pounce/options.h"

#include <array>
#include <cstddef>

#include "pounce/error.h"

namespace pounce {
namespace {

// In the order of the enumerations.
constexpr std::array<const char*, kChannelCount + kEvidenceCount + kShapeCount> kChannelNames = {
    "baseColor",  "metallicRoughness", "occlusion", "emissive", "normal",
    "confidence", "distance",          "height",    "position"};
constexpr std::array<const char*, 2> kNormalYNames = {"up", "down"};
constexpr std::array<const char*, 2> kMethodNames = {"surface", "gaussian"};
constexpr std::array<const char*, 3> kFilterNames = {"tent", "cubic", "sharp"};
constexpr std::array<const char*, 3> kHarmonicsNames = {"dc", "normal", "mean"};
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
  return kChannelNames[static_cast<std::size_t>(channel)];
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
