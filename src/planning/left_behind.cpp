// SPDX-License-Identifier: Apache-2.0
//
// What a source has and a transfer does not take: said, so that nobody has to find out from the
// result. Materials come by the hundred and names as long as a file likes: the first few are told.
//
// A channel that a user left out by name is not missed, and neither is one that nothing uses: only
// materials that triangles have count. The note is of bounded length, whatever a file has.
#include "planning/left_behind.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>

#include "planning/texture_factor.h"

namespace pounce::planning {
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
  // Back to the first byte of a character of UTF-8.
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

bool is_transferred(const SourcePlan& plan, Channel channel) {
  return std::any_of(plan.channels.begin(), plan.channels.end(),
                     [&](const ChannelPlan& made) { return made.channel == channel; });
}

Slots slots_left(const TransferOptions& options, const SourcePlan& plan, const mesh::Mesh& source) {
  Slots slots;
  for (const std::uint32_t m : used_materials(source)) {
    const mesh::Material& material = source.materials[m];
    for (const mesh::OtherTexture& other : material.other_textures)
      add_image(source.images[other.image], slots[other.slot]);
    // With channels by name the user has chosen. Else what was not chosen is told, and textures
    // that no channel takes in any case.
    for (int c = 0; options.channels.transferred.empty() && c < kChannelCount; ++c) {
      const auto& texture = material.textures[static_cast<std::size_t>(c)];
      const auto channel = static_cast<Channel>(c);
      if (texture && !is_transferred(plan, channel))
        add_image(source.images[texture->image], slots[channel_name(channel)]);
    }
  }
  for (const SourceTexture& given : options.material.textures) {
    if (!options.channels.transferred.empty() || is_transferred(plan, given.channel)) continue;
    std::vector<std::string>& images = slots[channel_name(options, given.channel)];
    images = {std::filesystem::path(given.path).filename().string()};
  }
  const bool shows_colours =
      std::any_of(plan.channels.begin(), plan.channels.end(), [](const ChannelPlan& channel) {
        return channel.channel == Channel::vertex_color || channel.is_tinted();
      });
  if (!source.colours.empty() && !shows_colours) slots["vertex colours"];
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

}  // namespace

std::string not_transferred(const TransferOptions& options, const SourcePlan& plan,
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

std::string factors_note(const TransferOptions& options, const SourcePlan& plan,
                         const mesh::Mesh& source) {
  std::map<std::string, std::size_t> counts;
  for (const std::uint32_t m : used_materials(source)) {
    for (const ChannelPlan& channel : plan.channels) {
      if (!is_of_material(channel.channel)) continue;
      // A factor without a texture is the constant itself, and always in the image.
      const auto& own = source.materials[m].textures[static_cast<std::size_t>(channel.channel)];
      if (own && texture_factor(source.materials[m], channel.channel)) ++counts[channel.name];
    }
  }
  if (counts.empty()) return "";
  return fmt::format(
      "{}: material factors {}: {}", source.path,
      options.material.apply_factors
          ? fmt::format("multiplied into the images (--factors {} disables this)",
                        options.material.apply_vertex_colours && !source.colours.empty()
                            ? "vertices"
                            : "ignore")
          : "not multiplied into the images",
      counted(counts));
}

}  // namespace pounce::planning
