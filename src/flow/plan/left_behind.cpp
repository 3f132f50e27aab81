// SPDX-License-Identifier: Apache-2.0
//
// What a source has and a transfer does not take: said, so that nobody has to find out from the
// result. Materials come by the hundred and names as long as a file likes: the first few are told.
#include "flow/plan/left_behind.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>

namespace pounce::flow {
namespace {

std::set<std::uint32_t> used_materials(const mesh::Mesh& source) {
  return {source.triangle_material.begin(), source.triangle_material.end()};
}

/// Images by what they are in the file, each once, in the order of the materials.
using Slots = std::map<std::string, std::vector<std::string>>;

constexpr std::size_t kToldSlots = 16, kToldImages = 3;
constexpr std::size_t kLongestName = 64;

/// A name, cut where it is too long to be read, between two characters.
std::string shortened(const std::string& name) {
  if (name.size() <= kLongestName) return name;
  std::size_t end = kLongestName;
  while (end > 0 && (static_cast<unsigned char>(name[end]) & 0xC0U) == 0x80) --end;
  return name.substr(0, end) + "...";
}

/// A file by its name alone: its folder is said where it matters.
std::string image_name(const mesh::ImageRef& image) {
  const bool is_file = !image.path.empty() && image.size_bytes == 0;
  return is_file ? std::filesystem::path(image.path).filename().string() : image.label;
}

void add_image(const mesh::ImageRef& image, std::vector<std::string>& images) {
  const std::string name = image_name(image);
  if (std::find(images.begin(), images.end(), name) == images.end()) images.push_back(name);
}

bool is_transferred(const Plan& plan, Channel channel) {
  return std::any_of(plan.channels.begin(), plan.channels.end(),
                     [&](const ChannelPlan& made) { return made.channel == channel; });
}

Slots slots_left(const TransferOptions& options, const Plan& plan, const mesh::Mesh& source) {
  Slots slots;
  for (const std::uint32_t m : used_materials(source)) {
    const mesh::Material& material = source.materials[m];
    for (const mesh::OtherTexture& other : material.other_textures)
      add_image(source.images[other.image], slots[other.slot]);
    for (int c = 0; options.channels.empty() && c < kChannelCount; ++c) {
      const auto& texture = material.textures[static_cast<std::size_t>(c)];
      const auto channel = static_cast<Channel>(c);
      if (texture && !is_transferred(plan, channel))
        add_image(source.images[texture->image], slots[channel_name(channel)]);
    }
  }
  if (source.has_vertex_colours) slots["vertex colours"];
  return slots;
}

/// "a.png, b.png, c.png and 97 more".
std::string listed(const std::vector<std::string>& names, std::size_t most) {
  std::string text;
  for (std::size_t i = 0; i < std::min(names.size(), most); ++i)
    text += (i > 0 ? ", " : "") + names[i];
  if (names.size() > most) text += fmt::format(" and {} more", names.size() - most);
  return text;
}

/// "baseColor (3 materials), emissive (1)".
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

std::string not_transferred(const TransferOptions& options, const Plan& plan,
                            const mesh::Mesh& source) {
  std::vector<std::string> told;
  for (const auto& [slot, images] : slots_left(options, plan, source)) {
    std::vector<std::string> names;
    for (const std::string& image : images) names.push_back(shortened(image));
    const std::string within = listed(names, kToldImages);
    told.push_back(shortened(slot) + (within.empty() ? "" : " (" + within + ")"));
  }
  if (told.empty()) return "";
  return fmt::format("{}: not transferred: {}", source.path, listed(told, kToldSlots));
}

std::vector<std::string> left_behind(const Plan& plan, const mesh::Mesh& source, bool is_model) {
  std::map<std::string, std::size_t> factors;
  for (const std::uint32_t m : used_materials(source)) {
    const mesh::Material& material = source.materials[m];
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
  if (!is_model && !factors.empty()) {
    lines.push_back(fmt::format(
        "{}: factors left behind, an image holds the texture alone: {}; a model output (-o "
        "NAME.glb) has them",
        source.path, counted(factors)));
  }
  return lines;
}

}  // namespace pounce::flow
