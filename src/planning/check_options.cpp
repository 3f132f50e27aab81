// SPDX-License-Identifier: Apache-2.0
//
// What no transfer can do, whatever is in the files: said before any of them is opened.
//
// Ranges of single values and what applies to which kind of source are rows of the table of options
// and are checked from there (docs/decisions/052-option-table.md). Here is what depends on two
// options or more, and there should be little of it. What depends on files is found by the
// planners, later.
//
// C++ callers come here without a parser, so nothing may be taken for granted that the command line
// refuses. A user hears of one mistake at a time, in the order of the checks: the output comes
// early, since most of the others refer to it.
#include <fmt/format.h>

#include <algorithm>

#include "io/image/write.h"
#include "io/model/model_writer.h"
#include "options/table.h"
#include "planning/colour_spaces.h"
#include "planning/known_map.h"
#include "planning/load_mesh.h"
#include "planning/name_patterns.h"
#include "planning/plan.h"
#include "pounce/error.h"

namespace pounce::planning {

namespace {

/// The paper's method has one map: colour.
void check_method(const TransferOptions& o) {
  options::refuse_unsuitable(o, o.mesh.method);
  if (o.mesh.method == Method::surface) return;
  const auto& channels = o.channels.transferred;
  // "all" by an output that has <CHANNEL> is no request for a channel: the others are left out
  // then, with a warning (source.cpp).
  const bool only_colour = std::all_of(channels.begin(), channels.end(), [](Channel channel) {
    return channel == Channel::base_color;
  });
  if (o.channels.all || !only_colour) {
    throw Error(ErrorKind::usage,
                "--method gaussian transfers only baseColor; request only that channel, or use "
                "--method surface");
  }
}

/// How files are to hold their samples.
void check_layout(const TransferOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  options::refuse_formats(o);
  if (o.image.drop_alpha && o.splats.alpha)
    usage("--drop-alpha contradicts --alpha; use one of them");
  if (o.image.drop_alpha && !o.composite.onto.empty())
    usage(
        "--drop-alpha: an image that is painted over keeps its channels; remove --drop-alpha or "
        "--onto");
}

/// Images beside the output come in as many pages as it.
void check_pages(const TransferOptions& o, const std::string& path, const std::string& what) {
  for (const char* token : {"TARGET", "MATERIAL", "UDIM", "UVTILE"}) {
    // Pages follow from the tokens of -o. A pattern with fewer tokens would write several pages to
    // one file, and one with more would name pages that do not exist.
    if (has_token(path, token) == has_token(o.output, token)) continue;
    throw Error(ErrorKind::usage,
                fmt::format("{}: <{}> must appear both in this pattern and in -o {}, or in neither",
                            what, token, o.output));
  }
}

/// Channels with outputs of their own, which come in as many pages as the others.
void check_channel_outputs(const TransferOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  for (std::size_t k = 0; k < o.image.channel_outputs.size(); ++k) {
    const auto& [channel, path] = o.image.channel_outputs[k];
    const std::string what = fmt::format("--output-for {}={}", channel_name(o, channel), path);
    if (io::is_model_path(o.output)) {
      usage(fmt::format(
          "{}: {} is a model, which contains its images; write images, such as '<CHANNEL>.png'",
          what, o.output));
    }
    if (!io::is_image_path(path)) {
      usage(what +
            ": images are written as .png, .jpg, .jpeg, .tif, .tiff, .tx or .exr; choose one of "
            "these extensions");
    }
    for (std::size_t before = 0; before < k; ++before) {
      if (o.image.channel_outputs[before].channel == channel)
        usage(fmt::format("{}: this channel already has the output {}; specify one", what,
                          o.image.channel_outputs[before].path));
    }
    check_pages(o, path, what);
    // The image that is painted over decides size, depth and channels, and cannot be that of two
    // formats.
    if (!o.composite.onto.empty() && !has_token(o.composite.onto, "CHANNEL"))
      usage(what + ": --onto also needs <CHANNEL>: " + o.composite.onto + " names a single image");
    if (o.skip_existing && !o.composite.onto.empty() && o.composite.onto == path)
      usage(
          "--skip-existing cannot distinguish an image that was painted over in place from an old "
          "one; use one of --skip-existing and --onto");
  }
}

/// The hit map.
void check_map(const TransferOptions& o) {
  const std::string& path = o.image.map_output;
  if (path.empty()) return;
  const auto usage = [&](const std::string& text) {
    throw Error(ErrorKind::usage, fmt::format("--map {}: {}", path, text));
  };
  if (!io::is_exr(path, Depth::float32)) usage("a map has named float channels; write .exr");
  if (has_token(path, "CHANNEL")) usage("one map serves all channels; leave out <CHANNEL>");
  if (io::is_model_path(o.output))
    usage(o.output + " is a model; write images, such as '<CHANNEL>.png'");
  if (!o.composite.onto.empty()) usage("--onto paints textures, not maps; use a run without --map");
  check_pages(o, path, "--map " + path);
}

/// What is painted through a hit map.
void check_apply(const TransferOptions& o) {
  const auto usage = [&](const std::string& text) {
    throw Error(ErrorKind::usage, fmt::format("{}: {}", o.source, text));
  };
  if (!o.targets.empty())
    usage("is a hit map, which has its target in it: use pounce apply, without a target");
  options::refuse_unsuitable(o, options::Source::map);
  if (io::is_model_path(o.output))
    usage("a map does not hold the target's mesh, so no model can be written; write images");
  std::vector<std::string> patterns{o.output, o.image.coverage_output, o.composite.onto,
                                    o.composite.mask};
  for (const ChannelOutput& own : o.image.channel_outputs) patterns.push_back(own.path);
  for (const char* token : {"TARGET", "MATERIAL"}) {
    for (const std::string& pattern : patterns) {
      if (has_token(pattern, token))
        usage(fmt::format("a map knows no <{}>; remove it from {}", token, pattern));
    }
  }
  if (!o.composite.onto.empty() && o.image.padding_px.value_or(0) > 0)
    usage(
        "--padding contradicts --onto: padding must not run into other charts, and a map does not "
        "know which empty texels are theirs; remove --padding, or use pounce transfer");
  const auto has_tiles = [](const std::string& path) {
    return has_token(path, "UDIM") || has_token(path, "UVTILE");
  };
  if (has_tiles(o.source) != has_tiles(o.output))
    usage(fmt::format("<UDIM> or <UVTILE> must appear both in the map and in -o {}, or in neither",
                      o.output));
  if (o.material.textures.empty())
    usage("nothing to paint; name an image with --source-texture baseColor=FILE");
  const auto refuse = [&](Channel channel) {
    if (channel == Channel::normal || is_evidence(channel))
      usage(
          fmt::format("{} cannot be painted through a map: it depends on the meshes; use pounce "
                      "transfer",
                      channel_name(channel)));
  };
  for (const SourceTexture& texture : o.material.textures) refuse(texture.channel);
  for (const Channel channel : o.channels.transferred) refuse(channel);
}

/// Where evidence cannot go, whatever the source is.
void check_evidence(const TransferOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  for (const SourceTexture& texture : o.material.textures) {
    if (!is_evidence(texture.channel)) continue;
    usage(fmt::format("--source-texture: {} is not a material channel; it is computed, not read",
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
        fmt::format("--source-texture: {} is not a material channel; use --bake {} to create it "
                    "from the geometry",
                    channel_name(texture.channel), channel_name(texture.channel)));
  }
  for (const Channel channel : o.channels.transferred) {
    if (!is_shape(channel)) continue;
    usage(fmt::format(
        "--channels {}: not a material channel; use --bake {} to create it from the geometry",
        channel_name(channel), channel_name(channel)));
  }
  for (const Channel channel : o.channels.baked) {
    if (channel != Channel::normal && !is_shape(channel))
      usage(
          fmt::format("--bake {}: cannot be baked; choose normal, height, position or vertexColor",
                      channel_name(o, channel)));
    if (is_shape(channel) && io::is_model_path(o.output)) {
      usage(
          fmt::format("--bake {}: {} is a model, whose materials have no such texture; write "
                      "images, such as '<CHANNEL>.exr'",
                      channel_name(channel), o.output));
    }
  }
  // glTF has no way to state another direction, so its readers would light the model wrongly.
  if (o.image.normal_y == NormalY::down && io::is_model_path(o.output)) {
    usage(
        fmt::format("--output-normal-y down: {} is a glTF model, whose normal maps are always up "
                    "(+Y); write images",
                    o.output));
  }
}

std::vector<std::string> channel_names() {
  std::vector<std::string> names;
  for (int c = 0; c < static_cast<int>(Channel::other); ++c)
    names.emplace_back(channel_name(static_cast<Channel>(c)));
  return names;
}

/// Maps of the user's own: names, and where they come from and cannot go.
void check_other_maps(const TransferOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  if (o.channels.other_maps.size() > kMostOtherMaps)
    usage(fmt::format("{} custom maps; at most {} are allowed", o.channels.other_maps.size(),
                      kMostOtherMaps));
  for (std::size_t k = 0; k < o.channels.other_maps.size(); ++k) {
    const std::string& name = o.channels.other_maps[k].name;
    if (!is_map_name(name))
      usage(
          fmt::format("\"{}\" is not a valid map name; use up to 64 letters, digits, - and _, and "
                      "no channel's name",
                      name));
    const bool is_given = std::any_of(
        o.material.textures.begin(), o.material.textures.end(),
        [&](const SourceTexture& texture) { return texture.channel == other_channel(k); });
    if (!is_given) {
      // Any name that is no channel was taken for a custom map while it was parsed. Without an
      // image it is more likely a channel that is misspelt.
      const std::string meant = did_you_mean(name, channel_names());
      usage(fmt::format("{}: unknown channel{}{} a custom map needs --source-texture {}=FILE", name,
                        meant, meant.empty() ? ";" : "", name));
    }
    if (io::is_model_path(o.output)) {
      usage(
          fmt::format("{}: {} is a model, whose materials have no such texture; write images, "
                      "such as '<CHANNEL>.png'",
                      name, o.output));
    }
  }
  // Numbers of custom maps come from the parser. Only a C++ caller can have others.
  const auto is_known = [&](Channel channel) {
    return !is_other(channel) || other_index(channel) < o.channels.other_maps.size();
  };
  const bool all_known =
      std::all_of(o.channels.transferred.begin(), o.channels.transferred.end(), is_known) &&
      std::all_of(o.material.textures.begin(), o.material.textures.end(),
                  [&](const SourceTexture& texture) { return is_known(texture.channel); });
  if (!all_known) usage("a channel beyond ChannelOptions::other_maps");
}

/// What the one output can hold.
void check_output(const TransferOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  if (o.targets.size() > 1 && !has_token(o.output, "TARGET")) {
    usage(fmt::format("{} targets need <TARGET> in the output: {} names a single file",
                      o.targets.size(), o.output));
  }
  const bool is_model = io::is_model_path(o.output);
  if (!is_model && !io::is_image_path(o.output)) {
    usage(o.output +
          ": models are written as .glb or .gltf, images as .png, .jpg, .jpeg, .tif, .tiff, .tx or "
          ".exr; choose one of these extensions");
  }
  if (is_model && o.image.depth && *o.image.depth != Depth::u8 && *o.image.depth != Depth::u16) {
    usage(
        fmt::format("--depth {}: the images of a model are PNG, which supports u8 and u16; choose "
                    "one of these, or write images",
                    depth_name(*o.image.depth)));
  }
  if (is_model && !o.material.apply_factors) {
    usage(
        "--factors applies only to images: a model keeps the source's factors in its materials; "
        "remove it, or use --factors factors to leave out vertex colours only");
  }
  const bool by_tile = has_token(o.output, "UDIM") || has_token(o.output, "UVTILE");
  if (!o.image.tiles.empty() && !by_tile)
    usage("--tiles needs <UDIM> or <UVTILE> in the output: " + o.output + " names a single image");
}

/// Images that are painted over.
void check_composite(const TransferOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  const auto& [onto, mask] = o.composite;
  if (onto.empty() && !mask.empty())
    usage("--mask needs --onto: it limits where an image is painted over");
  if (!onto.empty() && has_token(o.output, "CHANNEL") && !has_token(onto, "CHANNEL"))
    usage("--onto needs <CHANNEL> because the output has it: " + onto + " names a single image");
  if (o.skip_existing && !onto.empty() && onto == o.output)
    usage(
        "--skip-existing cannot distinguish an image that was painted over in place from an old "
        "one; use one of --skip-existing and --onto");
}

}  // namespace

namespace {

/// What tasks of one job cannot do, each by itself.
void check_share(const TransferOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  const TaskShare& share = o.share;
  if (share.tasks < 1 || share.tasks > kMostTasks || share.task < 1 || share.task > share.tasks)
    usage(fmt::format("task {} of {}: tasks count from 1, and are {} at most", share.task,
                      share.tasks, kMostTasks));
  if (share.role == TaskRole::whole) return;
  if (o.min_coverage_percent > 0)
    usage(
        "--min-coverage: no task sees all texels of a target; leave it out, and compare the counts "
        "in the reports");
  if (o.skip_existing)
    usage("--skip-existing: tasks skip what this same job has made already; leave it out");
  if (!o.composite.onto.empty() && o.composite.onto == o.output)
    usage(fmt::format("--onto {}: tasks cannot paint over their own input; give -o another name",
                      o.composite.onto));
  if (share.role == TaskRole::prepare && !o.resources.use_cache)
    usage("--no-cache: what is prepared is kept in the cache; leave it out");
  const bool needs_folder = share.role == TaskRole::assemble ||
                            (share.role == TaskRole::share && io::is_model_path(o.output));
  if (needs_folder && share.folder.empty())
    usage(o.output + ": is assembled from parts, which need a job folder that all tasks see");
}

}  // namespace

void check_options(const TransferOptions& o) {
  const auto usage = [](const std::string& text) { throw Error(ErrorKind::usage, text); };
  const bool is_map = is_hit_map(o.source);
  if (o.source.empty() || o.output.empty()) usage("a source and an output are required");
  if (o.targets.empty() && !is_map)
    usage(o.source + ": is not a hit map (.exr); every other source needs a target");
  options::check_ranges(o);
  if (o.channels.all && !o.channels.transferred.empty())
    usage("--channels accepts either a list or all");
  check_output(o);
  if (is_map) check_apply(o);
  check_channel_outputs(o);
  check_map(o);
  check_composite(o);
  axes_of(o.source_use, "source");
  axes_of(o.target_use, "target");
  check_other_maps(o);
  check_method(o);
  check_evidence(o);
  check_colour_spaces(o);
  check_baked(o);
  check_layout(o);
  check_share(o);
}

}  // namespace pounce::planning
