// SPDX-License-Identifier: Apache-2.0
//
// The source's side of a plan where the source is a splat scene: colours and evidence, which share
// one pass where their images are of one size.
//
// Nothing of the scene is decoded: headers say how many Gaussians there are, how they are coded and
// what unpacking takes. There are no images, so no size follows from the source.
#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "io/splats/scene.h"
#include "options/table.h"
#include "planning/colour_spaces.h"
#include "planning/load_mesh.h"
#include "planning/plan.h"

namespace pounce::planning {
namespace {

/// How far texels look where nobody says, of the target's diagonal: three deviations of where a
/// proxy's surface lies (docs/decisions/023-splat-blend.md).
constexpr double kSceneReachPercent = 3;
/// With room for the footprints of texels.
constexpr double kReachOverDistance = 1.1;
/// What is near more targets is not known: 32 KiB each would add up.
constexpr std::size_t kMostNearTargets = 8;

}  // namespace

SplatRequest splat_request(const TransferOptions& options) {
  SplatRequest request;
  request.path = options.source;
  request.axes = axes_of(options.source_use, "source");
  request.harmonics = options.splats.harmonics;
  request.from_around = options.splats.look != Look::normal;
  request.fades = options.splats.look == Look::normal   ? gaussian::FadeIsolated::of_all_scenes
                  : options.splats.look == Look::around ? gaussian::FadeIsolated::of_no_scene
                                                        : gaussian::FadeIsolated::of_made_scenes;
  const auto value = [](double v) { return static_cast<float>(v); };
  // What removes nothing is no filter: the scene then shares its store with jobs that state none.
  if (options.splats.filter.min_opacity && *options.splats.filter.min_opacity > kDefaultMinOpacity)
    request.keep.min_alpha = value(*options.splats.filter.min_opacity);
  if (options.splats.filter.max_scale)
    request.keep.max_sigma = value(*options.splats.filter.max_scale);
  if (options.splats.filter.box) {
    const auto& [low, high] = *options.splats.filter.box;
    request.keep.box = {{value(low[0]), value(low[1]), value(low[2])},
                        {value(high[0]), value(high[1]), value(high[2])}};
  }
  request.near_is_asked = options.splats.near_target.has_value();
  return request;
}

namespace {

/// `all` is what a scene looks like; how sure that is must be asked for.
std::vector<Channel> channels_of(const TransferOptions& options) {
  if (options.channels.transferred.empty()) return {Channel::base_color};
  for (const Channel channel : options.channels.transferred) {
    if (channel == Channel::base_color || is_evidence(channel)) continue;
    throw Error(
        ErrorKind::input,
        fmt::format("{}: a splat scene has no {} channel; choose baseColor, confidence or distance",
                    options.source, channel_name(options, channel)));
  }
  return options.channels.transferred;
}

SourceLook look_of(Channel channel, const SceneFacts& scene) {
  SourceLook look;
  look.linear = scene.is_linear;
  look.of_scene = true;
  if (is_evidence(channel)) look.colours = 1;
  if (channel == Channel::distance) look.depth = Depth::float32;
  return look;
}

/// Channels whose images have one size share a pass.
void add_channel(const TransferOptions& options, const SceneFacts& scene, Channel channel,
                 ColourSpaces& spaces, SourcePlan& plan) {
  ChannelPlan& added = plan.channels.emplace_back();
  added.channel = channel;
  added.name = channel_name(channel);
  SourceLook look = look_of(channel, scene);
  look.alpha = options.splats.alpha && channel == Channel::base_color;
  added.shows_alpha = look.alpha;
  choose_output(options, look, spaces, added, plan.warnings, plan.notes);
  if (is_evidence(channel)) check_numbers(options, added, "--channels");
  if (look.alpha && !added.format.has_alpha) {
    throw Error(
        ErrorKind::usage,
        fmt::format(
            "--alpha: {} has no alpha channel; paint over an image with alpha, or remove --alpha",
            options.composite.onto));
  }
  const std::size_t c = plan.channels.size() - 1;
  for (PassPlan& pass : plan.passes) {
    // One blend gives colour, confidence and distance at once.
    if (pass.size == added.size) return pass.channels.push_back(c);
  }
  plan.passes.push_back({{}, added.size, {c}, false});
  plan.passes.back().keeps_results = options.splats.look != Look::around;
}

}  // namespace

bool is_splat_scene(const std::string& path) {
  const auto format = io::source_splat_format(path);
  if (!format) return false;
  if (!format->is_read()) throw Error(ErrorKind::input, io::why_not_read(path, *format));
  return true;
}

void move_to_origin(Vec3d origin, SplatRequest& splats) {
  if (auto& box = splats.keep.box; box && origin != Vec3d{})
    box = Box3f{Vec3f(Vec3d(box->lo) - origin), Vec3f(Vec3d(box->hi) - origin)};
}

void keep_near(const TransferOptions& options, const TargetPlan& target, const mesh::Mesh& mesh,
               SplatRequest& splats) {
  if (options.splats.everywhere || options.targets.size() > kMostNearTargets) return;
  // What texels see, and what says whether the scene lies here at all.
  // By default an upper bound of how far anything is looked for: what is left out could not be met.
  // With --near-target the fit looks no farther than that (TargetPlanner::set_fit_reach()).
  double distance =
      kReachOverDistance * static_cast<double>(std::max(target.max_distance, target.fit_reach));
  if (options.splats.near_target) {
    distance = options.splats.near_target->is_percent
                   ? options.splats.near_target->value / 100 * target.diagonal
                   : options.splats.near_target->value;
  }
  splats.keep.near.push_back(std::make_shared<gaussian::NearSurface>(mesh, distance));
}

TransferOptions as_transfer(const GaussiansOptions& o) {
  TransferOptions transfer;
  transfer.source = o.source;
  transfer.material.textures = o.source_textures;
  transfer.colour = o.colour;
  transfer.source_use.axes = o.axes;
  transfer.channels.transferred = {Channel::base_color};
  transfer.output = "colours.exr";  // a format that holds any image: nothing is written there
  // Planning refuses a mesh without textures if no size is given. No image is written here, so any
  // size will do.
  transfer.image.size = ImageSize{1, 1};
  transfer.image.colour_space = "lin_rec709";  // the primaries of Gaussians
  transfer.splats.filter = o.filter;
  transfer.allow_external = o.allow_external;
  transfer.trust = o.trust;
  transfer.resources = o.resources;
  return transfer;
}

TransferOptions as_transfer(const ProxyOptions& o) {
  TransferOptions transfer;
  transfer.source = o.source;
  transfer.source_use.axes = o.axes;
  transfer.output = o.output;
  transfer.splats.filter = o.filter;
  transfer.resources = o.resources;
  return transfer;
}

void refuse_splat_options(const TransferOptions& options) {
  for (const Channel channel : options.channels.transferred) {
    if (!is_evidence(channel)) continue;
    throw Error(ErrorKind::usage,
                fmt::format("--channels {0}: {0} applies only to splat scenes; {1} is a mesh",
                            channel_name(channel), options.source));
  }
  options::refuse_unsuitable(options, options::Source::mesh);
}

void refuse_mesh_options(const TransferOptions& options) {
  options::refuse_unsuitable(options, options::Source::splats);
  const std::vector<Channel> channels = channels_of(options);
  if (options.splats.alpha &&
      std::find(channels.begin(), channels.end(), Channel::base_color) == channels.end()) {
    throw Error(ErrorKind::usage,
                "--alpha applies to colours: add baseColor to --channels, or remove --alpha");
  }
}

SourcePlan plan_scene(const TransferOptions& options, const SceneFacts& scene, bool for_model) {
  SourcePlan plan;
  plan.origin = scene.origin;
  plan.reach_percent = kSceneReachPercent;
  ColourSpaces spaces(options, for_model);
  for (const Channel channel : channels_of(options))
    add_channel(options, scene, channel, spaces, plan);
  spaces.finish(plan);
  return plan;
}

}  // namespace pounce::planning
