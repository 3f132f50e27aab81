// SPDX-License-Identifier: Apache-2.0
//
// What no transfer can do, whatever is in the files: said before any of them is opened.
#include "flow/plan/check_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "flow/load_mesh.h"
#include "flow/plan/colour_spaces.h"
#include "flow/plan/output_names.h"
#include "io/image/write.h"
#include "io/model/write.h"
#include "mesh/uv_tiles.h"
#include "pounce/error.h"
#include "texture/pad_seams.h"

namespace pounce::flow {

namespace {

constexpr std::uint32_t kLargestTile = 1024;
constexpr double kLeastOpacity = 0.0039;  // what people write for 1/255

void check_method(const TransferOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  if (o.method == Method::surface) {
    const bool has_width = o.sigma_texels.value_or(kDefaultSigma) != kDefaultSigma;
    if (has_width || o.densify) {
      usage(fmt::format("{} is about texels as Gaussians: it needs --method gaussian",
                        has_width ? "--sigma" : "--densify"));
    }
    return;
  }
  if (o.filter.value_or(kDefaultFilter) != kDefaultFilter)
    usage("--filter is of --method surface: Gaussians have a width, which --sigma says");
  if (o.sigma_texels && !(*o.sigma_texels >= 0.1 && *o.sigma_texels <= 4))
    usage(fmt::format("--sigma {:g}: from 0.1 to 4 texels", *o.sigma_texels));
  const bool only_colour = std::all_of(o.channels.begin(), o.channels.end(), [](Channel channel) {
    return channel == Channel::base_color;
  });
  if (!o.baked.empty()) usage("--bake is of the surface itself: it needs --method surface");
  if (o.all_channels || !only_colour) {
    usage(
        "--method gaussian transfers baseColor alone; ask for that, or use --method surface for "
        "other channels");
  }
}

}  // namespace

void check_splat_options(const TransferOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  if (o.min_opacity && !(*o.min_opacity >= kLeastOpacity && *o.min_opacity <= 1)) {
    usage(fmt::format("--min-opacity {:g}: from 1/255, below which nothing is seen, to 1",
                      *o.min_opacity));
  }
  if (o.max_scale && !(*o.max_scale > 0 && std::isfinite(*o.max_scale)))
    usage(fmt::format("--max-scale {:g}: must be above 0", *o.max_scale));
  for (std::size_t k = 0; o.box && k < 3; ++k) {
    const double low = o.box->lowest[k], high = o.box->highest[k];
    if (!(low <= high && std::isfinite(low) && std::isfinite(high))) {
      usage(fmt::format("--box: from {:g} to {:g} along {} is no range: the lower end comes first",
                        low, high, "xyz"[k]));
    }
  }
  if (o.rays > kMostRays) usage(fmt::format("--rays {}: at most {}", o.rays, kMostRays));
  if (!(o.min_confidence >= 0 && o.min_confidence <= 1))
    usage(fmt::format("--min-confidence {:g}: from 0 to 1", o.min_confidence));
  if (o.near_target && !(o.near_target->value > 0 && std::isfinite(o.near_target->value)))
    usage(fmt::format("--near-target {:g}: must be above 0", o.near_target->value));
}

namespace {

/// How files are to hold their samples.
void check_layout(const TransferOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  std::vector<std::string> outputs{o.output};
  for (const ChannelOutput& own : o.channel_outputs) outputs.push_back(own.path);
  const auto is_any = [&outputs](const auto& holds) {
    return std::any_of(outputs.begin(), outputs.end(), holds);
  };
  const bool tiled =
      is_any([](const auto& path) { return io::format_look(path, Depth::u8).tiled; });
  const Depth depth = o.depth.value_or(Depth::u8);  // of what no source has a say in
  if (!o.exr_compression.empty()) {
    if (const std::string why = io::why_no_exr_compression(o.exr_compression); !why.empty())
      usage("--exr-compression: " + why);
    if (!is_any([&](const auto& path) { return io::is_exr(path, depth); }))
      usage(fmt::format("--exr-compression needs an .exr output: {} is none", o.output));
  }
  if (o.tile_size % 16 != 0 || o.tile_size > kLargestTile)
    usage(fmt::format("--tile-size {}: a multiple of 16, 16 to {}", o.tile_size, kLargestTile));
  for (const auto& [name, given] :
       {std::pair{"--tile-size", o.tile_size != 0}, std::pair{"--mipmap", o.mipmap}}) {
    if (given && !tiled)
      usage(fmt::format("{} needs an .exr, .tif or .tx output: {} has rows only", name, o.output));
  }
  if (o.drop_alpha && o.alpha)
    usage("--drop-alpha leaves out what --alpha asks for; give one of them");
  if (o.drop_alpha && !o.onto.empty())
    usage(
        "--drop-alpha: an image that is painted over keeps its channels; leave it out, or --onto");
}

/// Channels with outputs of their own, which come in as many pages as the others.
void check_channel_outputs(const TransferOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  for (std::size_t k = 0; k < o.channel_outputs.size(); ++k) {
    const auto& [channel, path] = o.channel_outputs[k];
    const std::string what = fmt::format("--output-for {}={}", channel_name(o, channel), path);
    if (io::is_model_path(o.output)) {
      usage(
          fmt::format("{}: {} is a model, which holds its images itself; write images, such as "
                      "'<CHANNEL>.png'",
                      what, o.output));
    }
    if (!io::is_image_path(path)) {
      usage(what +
            ": images are written as .png, .jpg, .jpeg, .tif, .tiff, .tx or .exr; choose "
            "one of these endings");
    }
    for (std::size_t before = 0; before < k; ++before) {
      if (o.channel_outputs[before].channel == channel)
        usage(fmt::format("{}: the channel has {} already; give it once", what,
                          o.channel_outputs[before].path));
    }
    for (const char* token : {"TARGET", "MATERIAL", "UDIM", "UVTILE"}) {
      if (has_token(path, token) == has_token(o.output, token)) continue;
      usage(fmt::format("{}: <{}> must be in this pattern as in -o {}: in both or in neither", what,
                        token, o.output));
    }
    if (!o.onto.empty() && !has_token(o.onto, "CHANNEL"))
      usage(what + ": --onto needs <CHANNEL> then: " + o.onto + " is one channel's image");
    if (o.skip_existing && !o.onto.empty() && o.onto == path)
      usage("--skip-existing cannot tell an image that was painted over in place from an old one");
  }
}

/// Where evidence cannot go, whatever the source is.
void check_evidence(const TransferOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  for (const SourceTexture& texture : o.source_textures) {
    if (!is_evidence(texture.channel)) continue;
    usage(fmt::format("--source-texture: {} is no channel of a material; it is found, not read",
                      channel_name(texture.channel)));
  }
  for (const Channel channel : o.channels) {
    if (!is_evidence(channel) || !io::is_model_path(o.output)) continue;
    usage(
        fmt::format("--channels {}: {} is a model, whose materials have no such texture; write "
                    "images, such as '<CHANNEL>.exr'",
                    channel_name(channel), o.output));
  }
}

/// What is made of the source's shape.
void check_baked(const TransferOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  for (const SourceTexture& texture : o.source_textures) {
    if (!is_shape(texture.channel)) continue;
    usage(
        fmt::format("--source-texture: {} is no channel of a material; it is made of the shape, "
                    "by --bake {}",
                    channel_name(texture.channel), channel_name(texture.channel)));
  }
  for (const Channel channel : o.channels) {
    if (!is_shape(channel)) continue;
    usage(fmt::format("--channels {}: it is made of the shape, by --bake {}", channel_name(channel),
                      channel_name(channel)));
  }
  for (const Channel channel : o.baked) {
    if (channel != Channel::normal && !is_shape(channel))
      usage(fmt::format("--bake {}: it takes normal, height, position and vertexColor",
                        channel_name(o, channel)));
    if (is_shape(channel) && io::is_model_path(o.output)) {
      usage(
          fmt::format("--bake {}: {} is a model, whose materials have no such texture; write "
                      "images, such as '<CHANNEL>.exr'",
                      channel_name(channel), o.output));
    }
  }
  if (o.output_normal_y == NormalY::down && io::is_model_path(o.output)) {
    usage(fmt::format("--output-normal-y down: {} is a glTF model, whose normal maps have y up",
                      o.output));
  }
}

/// Maps of the user's own: names, and where they come from and cannot go.
void check_other_maps(const TransferOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  if (o.other_maps.size() > kMostOtherMaps)
    usage(fmt::format("{} maps of your own: at most {}", o.other_maps.size(), kMostOtherMaps));
  for (std::size_t k = 0; k < o.other_maps.size(); ++k) {
    const std::string& name = o.other_maps[k].name;
    if (!is_map_name(name)) usage(fmt::format("\"{}\" is no name for a map", name));
    const bool is_given = std::any_of(
        o.source_textures.begin(), o.source_textures.end(),
        [&](const SourceTexture& texture) { return texture.channel == other_channel(k); });
    if (!is_given) {
      usage(
          fmt::format("{}: no material has such a channel (baseColor, metallicRoughness, "
                      "occlusion, emissive); a map of your own needs --source-texture {}=FILE",
                      name, name));
    }
    if (io::is_model_path(o.output)) {
      usage(
          fmt::format("{}: {} is a model, whose materials have no such texture; write images, "
                      "such as '<CHANNEL>.png'",
                      name, o.output));
    }
  }
  const auto is_known = [&](Channel channel) {
    return !is_other(channel) || other_index(channel) < o.other_maps.size();
  };
  const bool all_known =
      std::all_of(o.channels.begin(), o.channels.end(), is_known) &&
      std::all_of(o.source_textures.begin(), o.source_textures.end(),
                  [&](const SourceTexture& texture) { return is_known(texture.channel); });
  if (!all_known) usage("a channel beyond TransferOptions::other_maps");
}

}  // namespace

void check_options(const TransferOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  if (o.source.empty() || o.targets.empty() || o.output.empty())
    usage("a source, a target and an output are needed");
  if (o.targets.size() > 1 && !has_token(o.output, "TARGET")) {
    usage(fmt::format("{} targets need <TARGET> in the output: {} is one name", o.targets.size(),
                      o.output));
  }
  if (!io::is_model_path(o.output) && !io::is_image_path(o.output)) {
    usage(o.output +
          ": models are written as .glb or .gltf, images as .png, .jpg, .jpeg, .tif, .tiff, .tx or "
          ".exr; choose one of these endings");
  }
  if (io::is_model_path(o.output) && o.depth && *o.depth != Depth::u8 && *o.depth != Depth::u16) {
    usage(
        fmt::format("--depth {}: the images of a model are PNG, which holds u8 and u16; ask for "
                    "one of these, or write images",
                    depth_name(*o.depth)));
  }
  if (io::is_model_path(o.output) && !o.apply_factors) {
    usage(
        "--factors is about images: a model has the factors of the source in its materials; leave "
        "it out, or leave out the colours of vertices alone: --factors factors");
  }
  check_channel_outputs(o);
  const bool by_tile = has_token(o.output, "UDIM") || has_token(o.output, "UVTILE");
  if (!o.tiles.empty() && !by_tile)
    usage("--tiles needs <UDIM> or <UVTILE> in the output: " + o.output + " is one image");
  for (const std::uint32_t udim : o.tiles) {
    if (udim < mesh::kFirstUdim || udim > mesh::kLastUdim)
      usage(fmt::format("--tiles {}: UDIMs go from 1001 to 9999", udim));
  }
  if (o.onto.empty() && !o.mask.empty())
    usage("--mask needs --onto: it says where an image is painted over");
  if (!o.onto.empty() && has_token(o.output, "CHANNEL") && !has_token(o.onto, "CHANNEL"))
    usage("--onto needs <CHANNEL> when the output has it: " + o.onto + " is one channel's image");
  if (o.skip_existing && !o.onto.empty() && o.onto == o.output)
    usage("--skip-existing cannot tell an image that was painted over in place from an old one");
  axes_of(o.source_use, "source");
  axes_of(o.target_use, "target");
  if (o.max_distance && (!(o.max_distance->value > 0) || !std::isfinite(o.max_distance->value)))
    usage(fmt::format("--max-distance {:g}: must be above 0", o.max_distance->value));
  if (!(o.max_angle_deg >= 0 && o.max_angle_deg < 90))
    usage(fmt::format("--max-angle {:g}: at least 0 and below 90 degrees", o.max_angle_deg));
  check_other_maps(o);
  check_method(o);
  check_splat_options(o);
  check_evidence(o);
  check_colour_spaces(o);
  check_baked(o);
  check_layout(o);
  if (o.all_channels && !o.channels.empty()) usage("--channels takes either a list or all");
  if (o.size && (o.size->width == 0 || o.size->height == 0)) usage("--size must be at least 1");
  if (o.padding_px && *o.padding_px > texture::SeamPadder::kLargestRadius)
    usage(fmt::format("--padding {}: at most {}", *o.padding_px,
                      texture::SeamPadder::kLargestRadius));
  if (!(o.min_coverage_percent >= 0 && o.min_coverage_percent <= 100))
    usage(fmt::format("--min-coverage {:g}: from 0 to 100 percent", o.min_coverage_percent));
}

}  // namespace pounce::flow
