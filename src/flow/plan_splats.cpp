// SPDX-License-Identifier: Apache-2.0
//
// The source's side of a plan where the source is a splat scene: one channel, one pass.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>

#include "flow/plan.h"

namespace pounce::flow {

bool is_splat_scene(const std::string& path) {
  std::string ending = std::filesystem::path(path).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  if (ending == ".ply") return true;
  constexpr std::array kOthers{".spz", ".splat", ".ksplat", ".sog"};
  if (std::find(kOthers.begin(), kOthers.end(), ending) != kOthers.end()) {
    throw Error(ErrorKind::input,
                fmt::format("{}: splat scenes are read from 3DGS PLY files; convert it with "
                            "splat-transform {} {}.ply",
                            path, path, std::filesystem::path(path).stem().string()));
  }
  return false;
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
  choose_output(options, SourceLook{}, channel);
  plan.passes.push_back({{}, channel.size, {0}});
  return plan;
}

}  // namespace pounce::flow
