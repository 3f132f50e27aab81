// SPDX-License-Identifier: Apache-2.0
//
// What no transfer can do, whatever is in the files: said before any of them is opened.
#include "flow/plan/check_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "flow/plan/colour_spaces.h"
#include "flow/plan/load_mesh.h"
#include "flow/plan/output_names.h"
#include "io/image/write.h"
#include "io/model/model_writer.h"
#include "mesh/uv_tiles.h"
#include "pounce/error.h"
#include "texture/pad_seams.h"

namespace pounce::flow {

namespace {

constexpr std::uint32_t kLargestTile = 1024;
constexpr double kLeastOpacity = 0.0039;  // what people write for 1/255

void check_method(const TransferOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  if (o.mesh.method == Method::surface) {
    const bool has_width = o.mesh.sigma_texels.value_or(kDefaultSigma) != kDefaultSigma;
    if (has_width || o.mesh.densify) {
      usage(fmt::format("{} is about texels as Gaussians: it needs --method gaussian",
                        has_width ? "--sigma" : "--densify"));
    }
    return;
  }
  if (o.mesh.filter.value_or(kDefaultFilter) != kDefaultFilter)
    usage("--filter is of --method surface: Gaussians have a width, which --sigma says");
  if (o.mesh.sigma_texels && !(*o.mesh.sigma_texels >= 0.1 && *o.mesh.sigma_texels <= 4))
    usage(fmt::format("--sigma {:g}: from 0.1 to 4 texels", *o.mesh.sigma_texels));
  const bool only_colour =
      std::all_of(o.channels.transferred.begin(), o.channels.transferred.end(),
                  [](Channel channel) { return channel == Channel::base_color; });
  if (!o.channels.baked.empty())
    usage("--bake is of the surface itself: it needs --method surface");
  if (o.channels.all || !only_colour) {
    usage(
        "--method gaussian transfers baseColor alone; ask for that, or use --method surface for "
        "other channels");
  }
}

}  // namespace

void check_splat_options(const TransferOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  if (o.splats.filter.min_opacity &&
      !(*o.splats.filter.min_opacity >= kLeastOpacity && *o.splats.filter.min_opacity <= 1)) {
    usage(fmt::format("--min-opacity {:g}: from 1/255, below which nothing is seen, to 1",
                      *o.splats.filter.min_opacity));
  }
  if (o.splats.filter.max_scale &&
      !(*o.splats.filter.max_scale > 0 && std::isfinite(*o.splats.filter.max_scale)))
    usage(fmt::format("--max-scale {:g}: must be above 0", *o.splats.filter.max_scale));
  for (std::size_t k = 0; o.splats.filter.box && k < 3; ++k) {
    const double low = o.splats.filter.box->lowest[k], high = o.splats.filter.box->highest[k];
    if (!(low <= high && std::isfinite(low) && std::isfinite(high))) {
      usage(fmt::format("--box: from {:g} to {:g} along {} is no range: the lower end comes first",
                        low, high, "xyz"[k]));
    }
  }
  if (o.splats.rays > kMostRays)
    usage(fmt::format("--rays {}: at most {}", o.splats.rays, kMostRays));
  if (!(o.splats.min_confidence >= 0 && o.splats.min_confidence <= 1))
    usage(fmt::format("--min-confidence {:g}: from 0 to 1", o.splats.min_confidence));
  if (o.splats.near_target &&
      !(o.splats.near_target->value > 0 && std::isfinite(o.splats.near_target->value)))
    usage(fmt::format("--near-target {:g}: must be above 0", o.splats.near_target->value));
}

namespace {

/// How files are to hold their samples.
void check_layout(const TransferOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  std::vector<std::string> outputs{o.output};
  for (const ChannelOutput& own : o.image.channel_outputs) outputs.push_back(own.path);
  const auto is_any = [&outputs](const auto& holds) {
    return std::any_of(outputs.begin(), outputs.end(), holds);
  };
  const bool tiled =
      is_any([](const auto& path) { return io::format_look(path, Depth::u8).tiled; });
  const Depth depth = o.image.depth.value_or(Depth::u8);  // of what no source has a say in
  if (!o.image.exr_compression.empty()) {
    if (const std::string why = io::why_no_exr_compression(o.image.exr_compression); !why.empty())
      usage("--exr-compression: " + why);
    if (!is_any([&](const auto& path) { return io::is_exr(path, depth); }))
      usage(fmt::format("--exr-compression needs an .exr output: {} is none", o.output));
  }
  if (o.image.tile_size % 16 != 0 || o.image.tile_size > kLargestTile)
    usage(
        fmt::format("--tile-size {}: a multiple of 16, 16 to {}", o.image.tile_size, kLargestTile));
  for (const auto& [name, given] :
       {std::pair{"--tile-size", o.image.tile_size != 0}, std::pair{"--mipmap", o.image.mipmap}}) {
    if (given && !tiled)
      usage(fmt::format("{} needs an .exr, .tif or .tx output: {} has rows only", name, o.output));
  }
  if (o.image.drop_alpha && o.splats.alpha)
    usage("--drop-alpha leaves out what --alpha asks for; give one of them");
  if (o.image.drop_alpha && !o.composite.onto.empty())
    usage(
        "--drop-alpha: an image that is painted over keeps its channels; leave it out, or --onto");
}

/// Channels with outputs of their own, which come in as many pages as the others.
void check_channel_outputs(const TransferOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  for (std::size_t k = 0; k < o.image.channel_outputs.size(); ++k) {
    const auto& [channel, path] = o.image.channel_outputs[k];
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
      if (o.image.channel_outputs[before].channel == channel)
        usage(fmt::format("{}: the channel has {} already; give it once", what,
                          o.image.channel_outputs[before].path));
    }
    for (const char* token : {"TARGET", "MATERIAL", "UDIM", "UVTILE"}) {
      if (has_token(path, token) == has_token(o.output, token)) continue;
      usage(fmt::format("{}: <{}> must be in this pattern as in -o {}: in both or in neither", what,
                        token, o.output));
    }
    if (!o.composite.onto.empty() && !has_token(o.composite.onto, "CHANNEL"))
      usage(what + ": --onto needs <CHANNEL> then: " + o.composite.onto +
            " is one channel's image");
    if (o.skip_existing && !o.composite.onto.empty() && o.composite.onto == path)
      usage("--skip-existing cannot tell an image that was painted over in place from an old one");
  }
}

/// Where evidence cannot go, whatever the source is.
void check_evidence(const TransferOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  for (const SourceTexture& texture : o.material.textures) {
    if (!is_evidence(texture.channel)) continue;
    usage(fmt::format("--source-texture: {} is no channel of a material; it is found, not read",
                      channel_name(texture.channel)));
  }
  for (const Channel channel : o.channels.transferred) {
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
  for (const SourceTexture& texture : o.material.textures) {
    if (!is_shape(texture.channel)) continue;
    usage(
        fmt::format("--source-texture: {} is no channel of a material; it is made of the shape, "
                    "by --bake {}",
                    channel_name(texture.channel), channel_name(texture.channel)));
  }
  for (const Channel channel : o.channels.transferred) {
    if (!is_shape(channel)) continue;
    usage(fmt::format("--channels {}: it is made of the shape, by --bake {}", channel_name(channel),
                      channel_name(channel)));
  }
  for (const Channel channel : o.channels.baked) {
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
  if (o.image.normal_y == NormalY::down && io::is_model_path(o.output)) {
    usage(fmt::format("--output-normal-y down: {} is a glTF model, whose normal maps have y up",
                      o.output));
  }
}

/// Maps of the user's own: names, and where they come from and cannot go.
void check_other_maps(const TransferOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  if (o.channels.other_maps.size() > kMostOtherMaps)
    usage(fmt::format("{} maps of your own: at most {}", o.channels.other_maps.size(),
                      kMostOtherMaps));
  for (std::size_t k = 0; k < o.channels.other_maps.size(); ++k) {
    const std::string& name = o.channels.other_maps[k].name;
    if (!is_map_name(name)) usage(fmt::format("\"{}\" is no name for a map", name));
    const bool is_given = std::any_of(
        o.material.textures.begin(), o.material.textures.end(),
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
    return !is_other(channel) || other_index(channel) < o.channels.other_maps.size();
  };
  const bool all_known =
      std::all_of(o.channels.transferred.begin(), o.channels.transferred.end(), is_known) &&
      std::all_of(o.material.textures.begin(), o.material.textures.end(),
                  [&](const SourceTexture& texture) { return is_known(texture.channel); });
  if (!all_known) usage("a channel beyond ChannelOptions::other_maps");
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
  if (io::is_model_path(o.output) && o.image.depth && *o.image.depth != Depth::u8 &&
      *o.image.depth != Depth::u16) {
    usage(
        fmt::format("--depth {}: the images of a model are PNG, which holds u8 and u16; ask for "
                    "one of these, or write images",
                    depth_name(*o.image.depth)));
  }
  if (io::is_model_path(o.output) && !o.material.apply_factors) {
    usage(
        "--factors is about images: a model has the factors of the source in its materials; leave "
        "it out, or leave out the colours of vertices alone: --factors factors");
  }
  check_channel_outputs(o);
  const bool by_tile = has_token(o.output, "UDIM") || has_token(o.output, "UVTILE");
  if (!o.image.tiles.empty() && !by_tile)
    usage("--tiles needs <UDIM> or <UVTILE> in the output: " + o.output + " is one image");
  for (const std::uint32_t udim : o.image.tiles) {
    if (udim < mesh::kFirstUdim || udim > mesh::kLastUdim)
      usage(fmt::format("--tiles {}: UDIMs go from 1001 to 9999", udim));
  }
  if (o.composite.onto.empty() && !o.composite.mask.empty())
    usage("--mask needs --onto: it says where an image is painted over");
  if (!o.composite.onto.empty() && has_token(o.output, "CHANNEL") &&
      !has_token(o.composite.onto, "CHANNEL"))
    usage("--onto needs <CHANNEL> when the output has it: " + o.composite.onto +
          " is one channel's image");
  if (o.skip_existing && !o.composite.onto.empty() && o.composite.onto == o.output)
    usage("--skip-existing cannot tell an image that was painted over in place from an old one");
  axes_of(o.source_use, "source");
  axes_of(o.target_use, "target");
  if (o.search.max_distance &&
      (!(o.search.max_distance->value > 0) || !std::isfinite(o.search.max_distance->value)))
    usage(fmt::format("--max-distance {:g}: must be above 0", o.search.max_distance->value));
  if (!(o.search.max_angle_deg >= 0 && o.search.max_angle_deg < 90))
    usage(fmt::format("--max-angle {:g}: at least 0 and below 90 degrees", o.search.max_angle_deg));
  check_other_maps(o);
  check_method(o);
  check_splat_options(o);
  check_evidence(o);
  check_colour_spaces(o);
  check_baked(o);
  check_layout(o);
  if (o.channels.all && !o.channels.transferred.empty())
    usage("--channels takes either a list or all");
  if (o.image.size && (o.image.size->width == 0 || o.image.size->height == 0))
    usage("--size must be at least 1");
  if (o.image.padding_px && *o.image.padding_px > texture::SeamPadder::kLargestRadius)
    usage(fmt::format("--padding {}: at most {}", *o.image.padding_px,
                      texture::SeamPadder::kLargestRadius));
  if (!(o.min_coverage_percent >= 0 && o.min_coverage_percent <= 100))
    usage(fmt::format("--min-coverage {:g}: from 0 to 100 percent", o.min_coverage_percent));
}

}  // namespace pounce::flow
