// SPDX-License-Identifier: Apache-2.0
//
// A target's side of a plan: pages, output names, the least memory.
//
// Lengths that are relative become lengths of this target, by the diagonal of its box. Names of all
// images are expanded even for pages that may turn out empty, since two images with one name must
// be found before any work.
#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <set>

#include "io/image/write.h"
#include "planning/known_map.h"
#include "planning/load_mesh.h"
#include "planning/name_patterns.h"
#include "planning/plan.h"

namespace pounce::planning {
namespace {

constexpr std::uint32_t kPaddingShare = 128;

/// The file name without folder and ending.
std::string stem(const std::string& path) { return std::filesystem::path(path).stem().string(); }

bool by_tile(const std::string& pattern) {
  return has_token(pattern, "UDIM") || has_token(pattern, "UVTILE");
}

// Whether a scene lies at a target shows farther away than texels look
// (docs/decisions/026-evidence.md).
constexpr double kFitPercent = 6, kFitOverReach = 2;

/// How files of this ending and depth are laid out. Means of places are none: a map has no levels.
ImageLayout layout_of(const TransferOptions& options, const std::string& path, Depth depth,
                      bool is_map = false) {
  constexpr std::uint32_t kLevelTiles = 64;  // as maketx
  ImageLayout layout = options.image.layout;
  const bool is_tiled = io::format_look(path, depth).tiled;
  if (!io::is_exr(path, depth)) layout.exr_compression.clear();
  layout.mipmap = is_tiled && !is_map && (layout.mipmap || io::is_tx_path(path));
  if (!is_tiled) layout.tile_size = 0;
  if (layout.tile_size == 0 && layout.mipmap) layout.tile_size = kLevelTiles;
  return layout;
}

class TargetPlanner {
 public:
  TargetPlanner(const TransferOptions& options, const SourcePlan& plan, const mesh::Mesh& target)
      : options_(options), source_(plan), target_(target) {}

  TargetPlan make(const std::string& path) {
    plan_.path = path;
    const double diag = diagonal(target_);
    plan_.diagonal = diag;
    const Length usual{source_.reach_percent, true};
    const Length reach = options_.search.max_distance.value_or(usual);
    const double distance = reach.is_percent ? reach.value / 100 * diag : reach.value;
    using Float = std::numeric_limits<float>;
    // Kept within what single precision can hold, and above 0, so that divisions by it are safe.
    plan_.max_distance =
        static_cast<float>(std::clamp<double>(distance, Float::min(), Float::max()));
    plan_.usual_distance = options_.search.max_distance && distance == usual.value / 100 * diag;
    set_fit_reach(distance);
    plan_.smallest_edge = static_cast<float>(std::max(diag * 1e-7, 1e-30));
    PageRequest request;
    request.by_material = has_token(options_.output, "MATERIAL");
    request.by_tile = by_tile(options_.output);
    request.selected = options_.image.tiles;
    request.uv_set = options_.target_use.uv_set.value_or(0);
    TargetPages pages = target_pages(target_, request, plan_.warnings);
    plan_.pages = pages.pages;
    plan_.by_tile = request.by_tile;
    plan_.all_tiles = options_.image.tiles.empty();
    plan_.uv_set = request.uv_set;
    plan_.axes = axes_of(options_.target_use, "target");
    plan_.in_part = !options_.target_use.meshes.empty() || !options_.target_use.materials.empty();
    plan_.painted_over = !options_.composite.onto.empty();
    // Keys of all pages and passes share the mesh's hash.
    const auto hashes = std::make_shared<surface::MeshHashes>(target_);
    for (const PassPlan& pass : source_.passes) {
      plan_.requests.emplace_back();
      for (std::uint32_t p = 0; p < plan_.pages.size(); ++p)
        plan_.requests.back().push_back(target_request(pass, pages, p, hashes));
    }
    for (std::size_t c = 0; c < source_.channels.size(); ++c) name_images(c);
    return std::move(plan_);
  }

 private:
  /// Not farther than --near-target: beyond, the scene's store may lack what lies there.
  void set_fit_reach(double max_distance) {
    const auto length_of = [&](const Length& length) {
      return length.is_percent ? length.value / 100 * plan_.diagonal : length.value;
    };
    const auto to_float = [](double length) {
      using Float = std::numeric_limits<float>;
      return static_cast<float>(std::clamp<double>(length, Float::min(), Float::max()));
    };
    const double usual = std::max(length_of({kFitPercent, true}), kFitOverReach * max_distance);
    plan_.usual_fit_reach = to_float(usual);
    plan_.fit_reach = to_float(options_.splats.near_target
                                   ? std::min(usual, length_of(*options_.splats.near_target))
                                   : usual);
  }

  surface::GeometryRequest target_request(
      const PassPlan& pass, const TargetPages& pages, std::uint32_t page,
      const std::shared_ptr<surface::MeshHashes>& hashes) const {
    surface::GeometryRequest request;
    request.mesh = &target_;
    request.hashes = hashes;
    request.is_target = true;
    request.exact = pass.has_shape;  // tangents are the triangles'
    request.pages.push_back({pass.size.width, pass.size.height, plan_.uv_set, {}});
    request.triangles = pages.triangles;
    request.first_page = page;
    if (plan_.by_tile) request.tile = mesh::udim_tile(pages.pages[page].udim);
    return request;
  }

  void name_images(std::size_t c) {
    const ChannelPlan& channel = source_.channels[c];
    plan_.images.emplace_back();
    for (const TargetPage& page : plan_.pages) {
      std::map<std::string, std::string> values = page.tokens();
      values["CHANNEL"] = channel.name;
      values["TARGET"] = stem(plan_.path);
      if (!by_tile(options_.output)) {  // one image: a tile's number would mean nothing
        values.erase("UDIM");
        values.erase("UVTILE");
      }
      ImageOutput image;
      image.path = expand_pattern(output_of(options_, channel.channel), values);
      plan_.outputs.push_back(image.path);
      // Without <CHANNEL> one mask stands for all channels: that of the first.
      if (!options_.image.coverage_output.empty() && channel.channel != Channel::hits &&
          (c == 0 || has_token(options_.image.coverage_output, "CHANNEL"))) {
        image.coverage_path = expand_pattern(options_.image.coverage_output, values);
        check_mask(image.coverage_path, channel.size);
        plan_.outputs.push_back(image.coverage_path);
      }
      const Depth depth = channel.format.depth;
      const bool is_map = channel.channel == Channel::hits;
      image.layout = layout_of(options_, image.path, depth, is_map);
      image.coverage_layout = layout_of(options_, image.coverage_path, Depth::u8);
      image.usual_tiles = options_.image.layout.tile_size != 0 &&
                          is_laid_out_by(without_tiles(), depth, is_map, image);
      image.usual_levels =
          options_.image.layout.mipmap && is_laid_out_by(without_levels(), depth, is_map, image);
      image.channel_names = channel.names;
      if (is_map) image.hits_note = with_distance(channel.hits_note, double{plan_.max_distance});
      image.chromaticities = channel.chromaticities;
      image.tagged = channel.colour_space.empty();
      image.lattice = {channel.size.width, channel.size.height, 0, {}};
      image.padding = padding_of(channel);
      image.is_normal_map = channel.channel == Channel::normal && channel.format.channels >= 3;
      if (!options_.composite.onto.empty()) {
        image.onto = plan_onto(options_, image.path, values, channel.size, channel.format,
                               {channel.source_colours, channel.source_alpha});
        keep_from_harm(*image.onto, image.path);
      }
      plan_.images.back().push_back(image);
    }
  }

  TransferOptions without_tiles() const {
    TransferOptions options = options_;
    options.image.layout.tile_size = 0;
    return options;
  }
  TransferOptions without_levels() const {
    TransferOptions options = options_;
    options.image.layout.mipmap = false;
    return options;
  }
  static bool is_laid_out_by(const TransferOptions& options, Depth depth, bool is_map,
                             const ImageOutput& image) {
    // The option says what holds without it, for the image and its mask alike.
    return layout_of(options, image.path, depth, is_map) == image.layout &&
           layout_of(options, image.coverage_path, Depth::u8) == image.coverage_layout;
  }

  /// No texel is sure because its neighbour is. A distance is padded: meshes are displaced by it.
  std::uint32_t padding_of(const ChannelPlan& channel) const {
    if (channel.channel == Channel::confidence || channel.channel == Channel::hits) return 0;
    return options_.image.padding_px.value_or(std::max(channel.size.width, channel.size.height) /
                                              kPaddingShare);
  }

  /// An image may be painted over in place, but not be what another one is painted onto; a mask is
  /// never an output.
  void keep_from_harm(OntoImage& onto, const std::string& output) {
    if (!onto.mask_path.empty()) plan_.inputs.push_back(onto.mask_path);
    // In place, the old image is read while the new one is written beside it, under another name
    // until it is complete.
    std::error_code ignored;
    onto.in_place = std::filesystem::equivalent(onto.path, output, ignored);
    if (!onto.in_place) plan_.inputs.push_back(onto.path);
  }

  static void check_mask(const std::string& path, ImageSize size) {
    const io::ImageWriteSpec mask{size.width, size.height, 1, io::writable_depth(path, Depth::u8),
                                  false,      false};
    if (const std::string why = io::why_not_writable(path, mask); !why.empty())
      throw Error(ErrorKind::usage, why);
  }

  const TransferOptions& options_;
  const SourcePlan& source_;
  const mesh::Mesh& target_;
  TargetPlan plan_;
};

}  // namespace

namespace {

/// Device and number: the same for every name of a file.
using FileId = std::pair<dev_t, ino_t>;

std::optional<FileId> file_id(const std::string& path) {
  struct stat found = {};
  if (path.empty() || stat(path.c_str(), &found) != 0) return std::nullopt;
  return FileId{found.st_dev, found.st_ino};
}

/// Why two images may get one name, and what to do about it.
std::string how_to_tell_apart(const TransferOptions& options, const SourcePlan& plan) {
  // The likeliest reason first, so that the message names one thing to change.
  std::map<std::string, std::string> targets;  // by stem
  for (const std::string& path : options.targets) {
    const auto [at, fresh] = targets.try_emplace(stem(path), path);
    if (fresh) continue;
    return fmt::format(
        "<TARGET> is the file name without folder and extension, which is the same for {} and {}; "
        "rename one, or transfer it in a separate run",
        at->second, path);
  }
  for (const char* token : {"TARGET", "UDIM", "UVTILE", "MATERIAL"}) {
    if (!options.image.coverage_output.empty() && has_token(options.output, token) &&
        !has_token(options.image.coverage_output, token))
      return fmt::format("add <{}> to --coverage, as in -o", token);
  }
  if (plan.channels.size() > 1 && !has_token(options.output, "CHANNEL"))
    return "add <CHANNEL> to the pattern";
  if (has_token(options.output, "MATERIAL")) {
    return "<MATERIAL> replaces / and \\ by _; rename one of the materials with the same result";
  }
  return "choose different names for -o and --coverage";
}

}  // namespace

TargetPlan plan_target(const TransferOptions& options, const SourcePlan& plan,
                       const std::string& path, const mesh::Mesh& target) {
  return TargetPlanner(options, plan, target).make(path);
}

void check_channel_outputs(const TransferOptions& options, const SourcePlan& plan) {
  for (const ChannelOutput& own : options.image.channel_outputs) {
    const bool is_made =
        std::any_of(plan.channels.begin(), plan.channels.end(),
                    [&](const ChannelPlan& channel) { return channel.channel == own.channel; });
    if (is_made) continue;
    const std::string name = channel_name(options, own.channel);
    throw Error(
        ErrorKind::usage,
        fmt::format("--output-for {}={}: this job writes no {}; add it to --channels{}, or remove "
                    "this option",
                    name, own.path, name,
                    is_shape(own.channel) || own.channel == Channel::normal ? " or --bake" : ""));
  }
}

std::string own_colours_note(const SourcePlan& plan, const mesh::Mesh& target) {
  const bool has_base =
      std::any_of(plan.channels.begin(), plan.channels.end(),
                  [](const ChannelPlan& c) { return c.channel == Channel::base_color; });
  if (!target.has_vertex_colours || !has_base) return {};
  return fmt::format(
      "{}: its vertex colours stay in the model, and renderers multiply the new "
      "baseColor by them; remove them if this is not intended",
      target.path);
}

void check_all_outputs(const TransferOptions& options, const SourcePlan& plan,
                       const std::vector<std::string>& outputs,
                       const std::vector<std::string>& more_inputs) {
  check_outputs(outputs, how_to_tell_apart(options, plan));
  // The source and what it is made of are never written over; the targets' own textures may be.
  std::vector<std::string> inputs = more_inputs;
  inputs.push_back(options.source);
  inputs.insert(inputs.end(), options.targets.begin(), options.targets.end());
  for (const ColumnPlan& column : plan.columns) inputs.push_back(column.image.path);
  // By identity: a link or another spelling of the path is the same file.
  std::set<FileId> read;
  for (const std::string& input : inputs) {
    if (const auto id = file_id(input)) read.insert(*id);
  }
  for (const std::string& output : outputs) {
    const auto id = file_id(output);
    if (id && read.count(*id) > 0) {
      throw Error(ErrorKind::usage,
                  fmt::format("{}: is also an input; write to another file", output));
    }
  }
}

double diagonal(const mesh::Mesh& mesh) {
  const Box3f box = box_of(mesh);
  return box.empty() ? 0 : length(Vec3d(box.hi) - Vec3d(box.lo));
}

}  // namespace pounce::planning
