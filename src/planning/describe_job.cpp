// SPDX-License-Identifier: Apache-2.0
//
// What a report says of a job before the job has done anything. It is written first, so that the
// report of any failure shows what was asked for.
#include "planning/describe_job.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include "planning/known_map.h"
#include "planning/texture_meaning.h"
#include "pounce/option_table.h"

namespace pounce::planning {

void describe(const TransferOptions& options, bool plan_only, Report& report) {
  const bool is_map = is_hit_map(options.source);  // of whose files its plan knows
  report.command = job_command_name(is_map ? JobCommand::apply : JobCommand::transfer);
  report.method = method_name(options.mesh.method);
  if (!is_map) add_input(options.source, report);
  for (const std::string& target : options.targets) add_input(target, report);
  report.options = option_texts(options);
  if (plan_only) report.options.push_back({"plan", {"true"}, false});
}

void describe(const MapsOptions& options, Report& report) {
  report.command = job_command_name(JobCommand::maps);
  add_input(options.target, report);
  report.options = option_texts(options);
}

void describe(const GaussiansOptions& options, Report& report) {
  report.command = job_command_name(JobCommand::gaussians);
  add_input(options.source, report);
  report.options = option_texts(options);
}

void describe(const ProxyOptions& options, Report& report) {
  report.command = job_command_name(JobCommand::proxy);
  add_input(options.source, report);
  report.options = option_texts(options);
}

void describe(const TexturedMeshOptions& options, Report& report) {
  report.command = job_command_name(JobCommand::mesh);
  report.method = method_name(options.transfer.mesh.method);
  add_input(options.transfer.source, report);
  report.options = option_texts(options);
}

void add_input(const std::string& path, Report& report) {
  std::vector<std::string>& inputs = report.inputs;
  if (!path.empty() && std::find(inputs.begin(), inputs.end(), path) == inputs.end())
    inputs.push_back(path);
}

// --- what is left behind -------------------------------------------------------------------------
//
// What a source has and a transfer does not take: said, so that nobody has to find out from the
// result. Materials come by the hundred and names as long as a file likes: the first few are told.
//
// A channel that a user left out by name is not missed, and neither is one that nothing uses: only
// materials that triangles have count. The note is of bounded length, whatever a file has.

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

// --- UVs that repeat -----------------------------------------------------------------------------
//
// A transfer does not mind: an image that repeats is stored once. As Gaussians each repetition is
// written again, so one triangle with a stray coordinate can ask for more than a disk holds. Both
// conditions must hold for a warning, since repeating is usual and large images are, too.

namespace {

/// Images that are laid this often over a surface are seen on purpose (bricks, grass) ...
constexpr double kUsualRepeats = 64;
/// ... and as long as the texels are no more than those of an image of 8192 x 8192, who cares.
constexpr double kUsualTexels = 8192.0 * 8192.0;

/// The texels that the triangles of a page cover, and the most that one of them does.
struct Covered {
  double texels = 0, most = 0;
  std::size_t triangle = 0;  ///< that one
};

}  // namespace

void warn_of_repeats(const surface::GeometryRequest& request, std::vector<std::string>& warnings) {
  const mesh::Mesh& mesh = *request.mesh;
  std::vector<Covered> pages(request.pages.size());
  for (std::size_t page = 0; page < pages.size(); ++page) {
    const mesh::Lattice& lattice = request.pages[page];
    if (lattice.width == 0) continue;
    Covered& sum = pages[page];
    for (const std::uint32_t t : request.triangles->of(page)) {
      const auto corner = [&](std::size_t i) {
        return to_texel(lattice, mesh.uv_sets[lattice.uv_set][mesh.triangles[t][i]]);
      };
      const double texels = std::abs(mesh::doubled_area(corner(0), corner(1), corner(2))) / 2;
      sum.texels += texels;
      if (texels > sum.most) sum.most = texels, sum.triangle = t;
    }
  }
  // Pages beyond the materials are those of triangles without UVs, which repeat nothing.
  for (std::size_t page = 0; page < std::min(pages.size(), mesh.materials.size()); ++page) {
    const mesh::Lattice& lattice = request.pages[page];
    const double image = double{1} * lattice.width * lattice.height;
    const Covered& sum = pages[page];
    if (sum.texels <= kUsualTexels || sum.texels <= kUsualRepeats * image) continue;
    warnings.push_back(
        fmt::format("{}: the UVs of material \"{}\" repeat its image {:.0f} times, triangle {} "
                    "alone {:.0f} times, which gives {:.0f} million Gaussians; repair the texture "
                    "coordinates if this is not intended",
                    mesh.path, mesh.materials[page].name, sum.texels / image, sum.triangle,
                    sum.most / image, sum.texels / 1e6));
  }
}

}  // namespace pounce::planning
