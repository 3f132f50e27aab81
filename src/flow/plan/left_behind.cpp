// SPDX-License-Identifier: Apache-2.0
//
// What a source has and a transfer does not take: said, so that nobody has to find out from the
// result.
#include "flow/plan/left_behind.h"

#include <fmt/format.h>

#include <map>
#include <set>

namespace pounce::flow {
namespace {

std::set<std::uint32_t> used_materials(const mesh::Mesh& source) {
  return {source.triangle_material.begin(), source.triangle_material.end()};
}

/// "map_Ks (3 materials), normal (1)".
std::string counted(const std::map<std::string, std::size_t>& counts) {
  std::string text;
  for (const auto& [name, count] : counts) {
    text += text.empty() ? fmt::format("{} ({} material{})", name, count, count == 1 ? "" : "s")
                         : fmt::format(", {} ({})", name, count);
  }
  return text;
}

/// Does the material's texture need a factor to look as it does?
bool has_factor(const mesh::Material& material, Channel channel) {
  const auto& f = material.factors[static_cast<std::size_t>(channel)];
  switch (channel) {
    case Channel::base_color:
      return f != std::array<float, 4>{1, 1, 1, 1};
    case Channel::metallic_roughness:
      return f[1] != 1 || f[2] != 1;
    case Channel::occlusion:
      return material.occlusion_strength != 1;
    case Channel::normal:  // a scale counts in the vectors themselves
      return false;
    case Channel::emissive:
    case Channel::confidence:  // no material has these
    case Channel::distance:
    case Channel::height:
    case Channel::position:
      break;
  }
  return f[0] != 1 || f[1] != 1 || f[2] != 1 || material.emissive_strength != 1;
}

}  // namespace

std::vector<std::string> left_behind(const Plan& plan, const mesh::Mesh& source, bool is_model) {
  std::map<std::string, std::size_t> textures, factors;
  for (const std::uint32_t m : used_materials(source)) {
    const mesh::Material& material = source.materials[m];
    std::set<std::string> slots;
    for (const mesh::OtherTexture& other : material.other_textures) slots.insert(other.slot);
    if (material.textures[static_cast<std::size_t>(Channel::normal)] && !plan.makes_normals())
      slots.insert(channel_name(Channel::normal));
    for (const std::string& slot : slots) ++textures[slot];
    for (const ChannelPlan& channel : plan.channels) {
      if (is_shape(channel.channel)) continue;
      const PageTexture& page = channel.pages[m];
      const bool is_textured = page.column >= 0 || page.tile_set >= 0;
      const bool own = material.textures[static_cast<std::size_t>(channel.channel)].has_value();
      if (is_textured && own && has_factor(material, channel.channel))
        ++factors[channel_name(channel.channel)];
    }
  }
  std::vector<std::string> lines;
  if (!textures.empty())
    lines.push_back(fmt::format("{}: textures left behind: {}", source.path, counted(textures)));
  if (!is_model && !factors.empty()) {
    lines.push_back(fmt::format(
        "{}: factors left behind, an image holds the texture alone: {}; a model output (-o "
        "NAME.glb) has them",
        source.path, counted(factors)));
  }
  if (source.has_vertex_colours)
    lines.push_back(fmt::format("{}: vertex colours left behind", source.path));
  return lines;
}

}  // namespace pounce::flow
