// SPDX-License-Identifier: Apache-2.0
//
// Colour or data: only colour is converted between sRGB coding and linear light. Nothing in a file
// says reliably which of the two a custom map is, so its name does where it is a usual one. The
// default is data: a mask that is converted is wrong everywhere, a colour that is not is right
// wherever source and output have one coding.
#include "planning/map_kind.h"

#include <algorithm>
#include <array>
#include <string_view>

namespace pounce::planning {
namespace {

// What texture sets of the field call them. docs/maps.md has the same lists.
constexpr std::array<std::string_view, 16> kColours{
    "albedo",        "color",           "colour",        "coatcolor",        "col",  "diff",
    "diffuse",       "emission",        "emissioncolor", "sheencolor",       "spec", "specular",
    "specularcolor", "subsurfacecolor", "tint",          "transmissioncolor"};
constexpr std::array<std::string_view, 34> kData{"alpha",          "ambientocclusion",
                                                 "anisotropy",     "ao",
                                                 "bump",           "cavity",
                                                 "clearcoat",      "coat",
                                                 "curvature",      "depth",
                                                 "disp",           "displacement",
                                                 "gloss",          "glossiness",
                                                 "height",         "id",
                                                 "mask",           "metallic",
                                                 "metalness",      "normal",
                                                 "normals",        "opacity",
                                                 "position",       "roughness",
                                                 "rough",          "sheenroughness",
                                                 "smoothness",     "specularlevel",
                                                 "specularweight", "thickness",
                                                 "transmission",   "vdm",
                                                 "vector",         "weight"};

template <std::size_t N>
bool holds(const std::array<std::string_view, N>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

}  // namespace

std::optional<bool> usually_colour(const std::string& name) {
  std::string letters;
  for (const char c : name) {
    if (c == '-' || c == '_') continue;
    letters += c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
  }
  if (holds(kColours, letters)) return true;
  if (holds(kData, letters)) return false;
  return std::nullopt;
}

bool is_colour(const TransferOptions& options, Channel channel) {
  if (!is_other(channel)) {
    return channel == Channel::base_color || channel == Channel::emissive ||
           channel == Channel::vertex_color;
  }
  const OtherMap& map = options.channels.other_maps.at(other_index(channel));
  return map.is_colour.value_or(usually_colour(map.name).value_or(false));
}

}  // namespace pounce::planning
