// SPDX-License-Identifier: Apache-2.0
//
// Colour or data: only colour is converted between sRGB coding and linear light. Nothing in a file
// says reliably which of the two a custom map is, so its name does where it is a usual one. The
// default is data: a mask that is converted is wrong everywhere, a colour that is not is right
// wherever source and output have one coding.
#include "planning/texture_meaning.h"

#include <algorithm>
#include <array>
#include <cmath>
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

// --- factors -------------------------------------------------------------------------------------
//
// A material's factors, for two kinds of outputs. texture_factor() is what an image must be
// multiplied by, since nothing else will do it; its values are as the file has them.
// material_factor() is what the material of a model keeps, within what glTF allows: numbers of 0 to
// 1, and light beyond 1 as emissive strength (docs/decisions/032-factors.md).
//
// A factor that changes nothing is none, so that texels without one keep their bits.

namespace {

bool changes(const shading::Factor& factor) {
  const shading::Factor none;
  return factor.scale != none.scale || factor.offset != none.offset;
}

}  // namespace

std::optional<shading::Factor> texture_factor(const mesh::Material& material, Channel channel) {
  if (static_cast<int>(channel) >= kChannelCount) return std::nullopt;
  const auto& f = material.factors[static_cast<std::size_t>(channel)];
  const double light = static_cast<double>(material.emissive_strength);
  const double strength = static_cast<double>(material.occlusion_strength);
  shading::Factor factor;
  switch (channel) {
    case Channel::base_color:
      factor.scale = {f[0], f[1], f[2], f[3]};
      break;
    case Channel::metallic_roughness:  // roughness is green, metallic blue
      factor.scale = {1, f[1], f[2], 1};
      break;
    case Channel::occlusion:  // red: 1 + strength (v - 1)
      factor.scale[0] = strength;
      factor.offset[0] = std::isfinite(strength) ? 1 - strength : 0;
      break;
    case Channel::emissive:
      factor.scale = {f[0], f[1], f[2], 1};
      for (std::size_t c = 0; c < 3; ++c) factor.scale[c] *= light;
      break;
    case Channel::normal:      // its scale counts in the vectors themselves
    case Channel::confidence:  // no material has these
    case Channel::distance:
    case Channel::height:
    case Channel::position:
    case Channel::vertex_color:
    case Channel::hits:
    case Channel::other:
      return std::nullopt;
  }
  for (double& scale : factor.scale) {  // a number beyond floats says nothing
    if (!std::isfinite(scale)) scale = 1;
  }
  if (!changes(factor)) return std::nullopt;
  factor.is_colour = channel == Channel::base_color || channel == Channel::emissive;
  // A grey image gets three channels where the factor differs between them.
  factor.spreads = channel != Channel::occlusion &&
                   (factor.scale[0] != factor.scale[1] || factor.scale[1] != factor.scale[2]);
  return factor;
}

std::array<float, 4> material_factor(const mesh::Material& material, Channel channel) {
  std::array<float, 4> factor = material.factors[static_cast<std::size_t>(channel)];
  if (channel == Channel::occlusion) factor = {material.occlusion_strength, 1, 1, 1};
  if (channel == Channel::emissive) {
    const float most = std::max({factor[0], factor[1], factor[2]});
    const float over = std::isfinite(most) ? std::max(most, 1.0F) : 1.0F;
    for (std::size_t i = 0; i < 3; ++i) factor[i] /= over;
    factor[3] = material.emissive_strength * over;
  }
  for (std::size_t i = 0; i < factor.size(); ++i) {
    const bool is_strength = channel == Channel::emissive && i == 3;
    if (!std::isfinite(factor[i])) factor[i] = 1;
    if (!is_strength) factor[i] = std::clamp(factor[i], 0.0F, 1.0F);
  }
  return factor;
}

std::array<float, 4> merged_factor(const mesh::Material& material, Channel channel) {
  std::array<float, 4> factor = material_factor(material, channel);
  if (channel == Channel::base_color) {
    if (material.is_opaque) factor[3] = 1;
    if (material.alpha_cutoff) factor[3] = factor[3] >= *material.alpha_cutoff ? 1.0F : 0.0F;
  }
  // By default glTF's materials are metal, which nobody means who says nothing.
  if (channel == Channel::metallic_roughness && !material.is_pbr) factor[2] = 0;
  const bool shines = factor[0] > 0 || factor[1] > 0 || factor[2] > 0;
  if (channel == Channel::emissive && !shines) factor[3] = 1;
  return factor;
}

}  // namespace pounce::planning
