// SPDX-License-Identifier: Apache-2.0
//
// The source's side of a plan where the source is a splat scene: one channel, one pass.
#include <fmt/format.h>

#include "flow/load_mesh.h"
#include "flow/plan/plan.h"
#include "io/splats/format.h"

namespace pounce::flow {
namespace {

/// With room for the footprints of texels.
constexpr double kReachOverDistance = 1.1;
/// What is near more targets is not known: 32 KiB each would add up.
constexpr std::size_t kMostNearTargets = 8;

}  // namespace

SplatRequest splat_request(const TransferOptions& options) {
  SplatRequest request;
  request.path = options.source;
  request.axes = axes_of(options.source_use, "source");
  request.harmonics = options.harmonics;
  const auto value = [](double v) { return static_cast<float>(v); };
  if (options.min_opacity) request.keep.min_alpha = value(*options.min_opacity);
  if (options.max_scale) request.keep.max_sigma = value(*options.max_scale);
  if (options.box) {
    const auto& [low, high] = *options.box;
    request.keep.box = {{value(low[0]), value(low[1]), value(low[2])},
                        {value(high[0]), value(high[1]), value(high[2])}};
  }
  request.near_is_asked = options.near_target.has_value();
  return request;
}

bool is_splat_scene(const std::string& path) {
  const auto format = io::source_splat_format(path);
  if (!format) return false;
  if (!format->is_read()) throw Error(ErrorKind::input, io::why_not_read(path, *format));
  return true;
}

void keep_near(const TransferOptions& options, const TargetPlan& target, const mesh::Mesh& mesh,
               SplatRequest& splats) {
  if (options.everywhere || options.targets.size() > kMostNearTargets) return;
  double distance = kReachOverDistance * static_cast<double>(target.max_distance);
  if (options.near_target) {
    distance = options.near_target->is_percent ? options.near_target->value / 100 * target.diagonal
                                               : options.near_target->value;
  }
  splats.keep.near.push_back(std::make_shared<NearSurface>(mesh, distance));
}

void refuse_splat_options(const TransferOptions& options) {
  const char* const given = options.harmonics != TransferOptions{}.harmonics ? "--sh"
                            : options.min_opacity                            ? "--min-opacity"
                            : options.max_scale                              ? "--max-scale"
                            : options.box                                    ? "--box"
                            : options.near_target || options.everywhere      ? "--near-target"
                                                                             : nullptr;
  if (given == nullptr) return;
  throw Error(ErrorKind::usage,
              fmt::format("{} is about the Gaussians of a splat scene; {} is a mesh", given,
                          options.source));
}

Plan plan_splats(const TransferOptions& options) {
  if (!options.source_textures.empty()) {
    throw Error(ErrorKind::usage,
                fmt::format("--source-texture: {} is a splat scene; its Gaussians have their own "
                            "colours and no UVs",
                            options.source));
  }
  const MeshUse& use = options.source_use;
  if (!use.meshes.empty() || !use.materials.empty() || use.uv_set) {
    throw Error(ErrorKind::usage,
                fmt::format("--source-mesh, --source-material, --source-uv-set: {} is a splat "
                            "scene, which has no meshes, materials and UVs",
                            options.source));
  }
  if (options.sigma_texels || options.densify) {
    throw Error(
        ErrorKind::usage,
        fmt::format("{}: {} is a splat scene, whose Gaussians have their own sizes; this is "
                    "for the texels of a mesh",
                    options.sigma_texels ? "--sigma" : "--densify", options.source));
  }
  for (const Channel channel : options.channels) {
    if (channel == Channel::base_color) continue;
    throw Error(ErrorKind::input,
                fmt::format("{}: a splat scene has colours only, no {}; ask for baseColor",
                            options.source, channel_name(channel)));
  }
  Plan plan;
  plan.from_splats = true;
  plan.splats = splat_request(options);
  plan.scene = scene_facts(plan.splats);
  ChannelPlan& channel = plan.channels.emplace_back();
  channel.channel = Channel::base_color;
  SourceLook look;
  look.linear = plan.scene.is_linear;
  choose_output(options, look, channel, plan.warnings);
  plan.passes.push_back({{}, {}, channel.size, {0}});
  return plan;
}

}  // namespace pounce::flow
