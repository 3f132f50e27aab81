// SPDX-License-Identifier: Apache-2.0
//
// The source's side of a plan where the source is a splat scene: one channel, one pass.
#include <fmt/format.h>

#include "flow/plan/plan.h"
#include "io/splats/format.h"

namespace pounce::flow {

bool is_splat_scene(const std::string& path) {
  const auto format = io::source_splat_format(path);
  if (!format) return false;
  if (!format->is_read()) throw Error(ErrorKind::input, io::why_not_read(path, *format));
  return true;
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
  ChannelPlan& channel = plan.channels.emplace_back();
  channel.channel = Channel::base_color;
  choose_output(options, SourceLook{}, channel, plan.warnings);
  plan.passes.push_back({{}, {}, channel.size, {0}});
  return plan;
}

}  // namespace pounce::flow
