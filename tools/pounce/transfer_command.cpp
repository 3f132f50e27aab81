// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "arguments.h"
#include "bad_line.h"
#include "commands.h"
#include "pounce/error.h"
#include "pounce/transfer.h"
#include "shared_options.h"

namespace pounce::cli {
namespace {

constexpr const char* kUsage =
    "Usage: pounce transfer SOURCE TARGET... -o OUTPUT [options]\n"
    "\n"
    "Examples:\n"
    "  # Give an avatar the skin of a scan, at the size of the scan's texture.\n"
    "  pounce transfer scan.glb avatar.glb -o avatar.png\n"
    "\n"
    "  # Every channel the source has, 8192 x 8192 texels each, in one GiB of memory.\n"
    "  pounce transfer scan.glb avatar.glb -o 'maps/<CHANNEL>.png' --size 8192 --memory 1GiB\n"
    "\n"
    "  # A finished model to open: the avatar with its new textures.\n"
    "  pounce transfer scan.glb avatar.glb -o finished.glb\n"
    "\n"
    "  # A mesh without materials, its texture beside it, and a mask of what was found.\n"
    "  pounce transfer scan.obj avatar.obj --source-texture baseColor=scan.exr \\\n"
    "      -o avatar.exr --coverage avatar.mask.png\n"
    "\n"
    "  # UDIMs in and out: an image per tile of UV space, two of them again later.\n"
    "  pounce transfer scan.obj hero.obj -o 'hero.<UDIM>.exr' \\\n"
    "      --source-texture 'baseColor=scan.<UDIM>.exr'\n"
    "  pounce transfer scan.obj hero.obj -o 'hero.<UDIM>.exr' --tiles 1003,1011 \\\n"
    "      --source-texture 'baseColor=scan.<UDIM>.exr'\n"
    "\n"
    "  # A trained splat scene onto a mesh with UVs that lies where its surface is; the second\n"
    "  # time only one chair of the room, without haze (more: docs/splats.md).\n"
    "  pounce transfer room.ply proxy.glb -o proxy.png --size 4096\n"
    "  pounce transfer room.ply chair.glb -o chair.png --size 2048 --min-opacity 0.1 \\\n"
    "      --max-distance 1% --box 0,0,0,1.5,1,1\n"
    "\n"
    "  # One scan onto many avatars: the source is prepared once.\n"
    "  pounce transfer scan.glb avatars/*.glb -o 'skins/<TARGET>.png'";

constexpr std::uint32_t kMostPadding =
    4096;                               // texels; half of this is the default at the largest size
constexpr double kLargestAngle = 89.9;  // a grazing source surface is not seen at all

struct Settings {
  TransferOptions options;
  JobSettings job;
};

/// A map of the user's own that has no image may be a channel that is spelled otherwise.
void check_channel_names(const TransferOptions& options) {
  std::vector<std::string> known;
  for (int c = 0; c < static_cast<int>(Channel::other); ++c)
    known.emplace_back(channel_name(static_cast<Channel>(c)));
  for (std::size_t k = 0; k < options.channels.other_maps.size(); ++k) {
    const bool is_given = std::any_of(
        options.material.textures.begin(), options.material.textures.end(),
        [&](const SourceTexture& texture) { return texture.channel == other_channel(k); });
    const std::string& name = options.channels.other_maps[k].name;
    const std::string meant = is_given ? "" : did_you_mean(name, known);
    if (meant.empty()) continue;
    throw Error(ErrorKind::usage, name + ": no channel has this name" + meant +
                                      " A map of your own needs --source-texture " + name +
                                      "=FILE");
  }
}

void add_picture_options(CLI::App& command, TransferOptions& options) {
  const char* const group = "Picture";
  add_value(command, "-o,--output", "OUTPUT", group,
            "Model or image to write. A model (.glb .gltf) is TARGET with its new\n"
            "textures, a PNG per material and channel, everything else as it was;\n"
            "its name may hold <TARGET>.\n"
            "An image (.png .jpg .tif .tx .exr) may hold <CHANNEL>,\n"
            "<MATERIAL>, <TARGET>, and <UDIM> (1001) or <UVTILE> (u1_v1).\n"
            "Without <MATERIAL> all materials of the target share one image;\n"
            "without <UDIM> UVs outside the image wrap around into it.\n"
            "Folders that are not there are made",
            [&options](const std::string& text) { options.output = parse_output("-o", text); })
      ->required();
  command
      .add_option_function<std::vector<std::string>>(
          "--output-for",
          [&options](const std::vector<std::string>& texts) {
            for (const std::string& text : texts) {
              options.image.channel_outputs.push_back(
                  parse_channel_output("--output-for", text, options.channels.other_maps));
            }
          },
          "Write this channel to images of its own name and format, such as\n"
          "height=height.exr beside PNGs. PATTERN accepts the tokens of OUTPUT.\n"
          "May be given once per channel")
      ->type_name("CHANNEL=PATTERN")
      ->option_text("CHANNEL=PATTERN")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
      ->group(group);
  add_value(command, "--coverage", "PATTERN", group,
            "Also write a mask: 255 where the source was found. Same tokens",
            [&options](const std::string& text) {
              options.image.coverage_output = parse_image_pattern("--coverage", text);
            });
  add_value(
      command, "--tiles", "LIST", group,
      "Only these UDIMs, such as 1001-1004,1011. Default: all that the\n"
      "target's UVs lie in",
      [&options](const std::string& text) { options.image.tiles = parse_udims("--tiles", text); });
  add_value(command, "--size", "N|WxH", group,
            "Texels of each image, each side 1 to 65536. Time grows with their number.\n"
            "Default: per channel the largest source image",
            [&options](const std::string& text) {
              options.image.size = parse_image_size("--size", text);
            });
  add_value(
      command, "--depth", "TYPE", group, "u8, u16, half or float. Default: the source image's",
      [&options](const std::string& text) { options.image.depth = parse_depth("--depth", text); });
  add_value(command, "--padding", "PX", group,
            "Fill this many texels around every chart with the nearest colour,\n"
            "0 to 4096. Memory grows with it. Default: larger side / 128",
            [&options](const std::string& text) {
              options.image.padding_px =
                  static_cast<std::uint32_t>(parse_integer("--padding", text, 0, kMostPadding));
            });
}

void add_file_options(CLI::App& command, TransferOptions& options) {
  const char* const group = "Files";
  add_value(command, "--exr-compression", "NAME", group,
            "For .exr and half .tx: none, rle, zips, zip or piz, all lossless.\n"
            "Default: zip",
            [&options](const std::string& text) { options.image.exr_compression = text; });
  add_value(command, "--tile-size", "N", group,
            "Write .exr, .tif and .tx in tiles of N x N texels, a multiple of\n"
            "16 up to 1024. Default: rows, and 64 with levels",
            [&options](const std::string& text) {
              options.image.tile_size =
                  static_cast<std::uint32_t>(parse_integer("--tile-size", text, 16, 1024));
            });
  add_switch(command, "--mipmap", group,
             "Write .exr and .tif with all their smaller levels (mipmaps), as\n"
             "renderers want them; .tx (TIFF, or EXR for half) always has them",
             options.image.mipmap);
  add_switch(command, "--drop-alpha", group, "Write no alpha, whatever the source has",
             options.image.drop_alpha);
}

void add_coverage_option(CLI::App& command, TransferOptions& options) {
  add_value(command, "--min-coverage", "PCT", "Picture",
            "Exit with status 1 if a target finds the source for less than\n"
            "this many percent of its texels, 0 to 100; all is written all\n"
            "the same. Default: 0",
            [&options](const std::string& text) {
              options.min_coverage_percent = parse_number("--min-coverage", text, 0, 100);
            });
}

void add_skip_option(CLI::App& command, TransferOptions& options) {
  add_switch(command, "--skip-existing", "Picture",
             "Keep outputs that are there and that this same job made, with the\n"
             "same inputs and options: goes on where a stopped run ended. What\n"
             "does not say its job is kept if it is younger than all inputs",
             options.skip_existing);
}

void add_paint_options(CLI::App& command, TransferOptions& options) {
  const char* const group = "Painting over";
  add_value(command, "--onto", "IMAGE", group,
            "Write what was found over this image instead of an empty one; it\n"
            "gives size, depth and channels, its alpha stays where the source\n"
            "has none. Same tokens as OUTPUT, and may be OUTPUT itself",
            [&options](const std::string& text) {
              options.composite.onto = parse_image_pattern("--onto", text);
            });
  add_value(command, "--mask", "IMAGE", group,
            "Paint only as far as this mask is white (brightness times alpha;\n"
            "grey mixes). Same tokens",
            [&options](const std::string& text) {
              options.composite.mask = parse_image_pattern("--mask", text);
            });
}

void add_factors_option(CLI::App& command, const char* group, TransferOptions& options) {
  add_value(command, "--factors", "HOW", group,
            "apply: images show what the materials make of their textures: baseColorFactor,\n"
            "Kd, d, roughness, metallic, emissive and occlusion strength are multiplied in,\n"
            "and so are the colours of vertices.\n"
            "textures (or ignore): they show the textures alone. factors: textures and\n"
            "factors; vertices: textures and colours of vertices. A model has factors\n"
            "in its materials, so it takes apply or factors. Default: apply",
            [&options](const std::string& text) {
              const Factors factors = parse_factors("--factors", text);
              options.material.apply_factors = factors.of_materials;
              options.material.apply_vertex_colours = factors.of_vertices;
            });
}

void add_kind_option(CLI::App& command, const char* option, bool is_colour,
                     TransferOptions& options) {
  command
      .add_option_function<std::vector<std::string>>(
          option,
          [&options, option, is_colour](const std::vector<std::string>& names) {
            for (const std::string& name : names)
              parse_map_kind(option, name, is_colour, options.channels.other_maps);
          },
          is_colour ? "This map of your own is colour: converted where formats differ in\n"
                      "sRGB coding and linear light"
                    : "This map of your own is data, never converted. Default: by its name\n"
                      "(docs/maps.md), else data. May be given once per map")
      ->type_name("NAME")
      ->option_text("NAME")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
      ->group("Source");
}

void add_source_options(CLI::App& command, TransferOptions& options) {
  const char* const group = "Source";
  add_value(command, "--channels", "LIST", group,
            "baseColor,metallicRoughness,occlusion,emissive,normal, or all =\n"
            "what the source has. Each costs one decoding and one image. A\n"
            "normal map goes from the source's tangent space into the target's\n"
            "(TANGENT where the file has it, else MikkTSpace). Of a splat\n"
            "scene baseColor, and on demand confidence (0 to 1) and distance\n"
            "(signed, of the surface found from the texel; .exr or .tif).\n"
            "Default: all if OUTPUT is a model or holds <CHANNEL>, else baseColor",
            [&options](const std::string& text) {
              options.channels.all = text == "all";
              if (!options.channels.all) {
                options.channels.transferred =
                    parse_channels("--channels", text, options.channels.other_maps);
              }
            });
  add_value(command, "--bake", "LIST", group,
            "Made of the source's shape: normal (its smooth normals and its own\n"
            "normal map, in the target's tangent space), height (signed, from\n"
            "the target along its normal) and position (both .exr or .tif);\n"
            "and vertexColor, the colours of its vertices by themselves.\n"
            "Besides --channels; alone if OUTPUT is one image. Needs no textures;\n"
            "without any, give --size",
            [&options](const std::string& text) {
              options.channels.baked = parse_baked("--bake", text);
            });
  add_value(command, "--normal-y", "up|down", group,
            "Which way green rises in the source's normal maps: up in the image\n"
            "(glTF, OpenGL) or down (DirectX). Default: up",
            [&options](const std::string& text) {
              options.material.normal_y = parse_normal_y("--normal-y", text);
            });
  add_value(command, "--output-normal-y", "up|down", group,
            "The same of the normal map that is made. Default: up",
            [&options](const std::string& text) {
              options.image.normal_y = parse_normal_y("--output-normal-y", text);
            });
  command
      .add_option_function<std::vector<std::string>>(
          "--source-texture",
          [&options](const std::vector<std::string>& texts) {
            for (const std::string& text : texts) {
              options.material.textures.push_back(
                  parse_source_texture("--source-texture", text, options.channels.other_maps));
            }
          },
          "Take a channel from this image instead of what the mesh says, or a\n"
          "map of your own name (displacement, specular, mask), which --channels\n"
          "and <CHANNEL> know then. With <UDIM> or <UVTILE> in PATH: from a set\n"
          "of tiles, which may differ in size. Of an EXR by layer or channels:\n"
          "NAME=FILE.exr:diffuse or FILE.exr:N.X,Y,Z. May be given once per name")
      ->type_name("NAME=PATH")
      ->option_text("NAME=PATH")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
      ->group(group);
  add_kind_option(command, "--data", false, options);
  add_kind_option(command, "--color", true, options);
  add_factors_option(command, group, options);
}

void add_colour_options(CLI::App& command, TransferOptions& options) {
  const char* const group = "Colour";
  command
      .add_option_function<std::vector<std::string>>(
          "--source-colorspace",
          [&options](const std::vector<std::string>& texts) {
            for (const std::string& text : texts)
              options.colour.source_spaces.push_back(
                  parse_source_space("--source-colorspace", text, options.channels.other_maps));
          },
          "What the source's images of colours hold, of this channel or of all:\n"
          "srgb, lin_rec709, acescg, aces2065-1, display-p3, or a space of --ocio.\n"
          "Default: what their files say (EXR, ICC profiles, PNG's chunks), but srgb\n"
          "in glTF; else srgb for integers, lin_rec709 for floats")
      ->type_name("[NAME=]SPACE")
      ->option_text("[NAME=]SPACE")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
      ->group(group);
  add_value(command, "--output-colorspace", "SPACE", group,
            "Convert colours to this. Default: the source's as far as the format\n"
            "holds it: EXR is linear light, others are srgb or display-p3, models srgb",
            [&options](const std::string& text) { options.image.colour_space = text; });
  add_config_option(command, group, options.colour.config);
}

void add_method_options(CLI::App& command, TransferOptions& options) {
  const char* const group = "Method (SOURCE is a mesh)";
  add_value(command, "--method", "NAME", group,
            "surface: what a texel's ray hits first, as sharp as the source; the better default.\n"
            "gaussian: the paper's blend of all texels on the ray, as Gaussians: to compare\n"
            "with it, or for layers and noise that shall melt together. Default: surface",
            [&options](const std::string& text) {
              options.mesh.method = parse_method("--method", text);
            });
  add_value(command, "--filter", "NAME", group,
            "Of surface: how the texels around a hit are blended, to no more than the\n"
            "four nearest show. cubic: Catmull-Rom, sharper than bilinear, and even\n"
            "gradients stay even. sharp: steeper, for drawings and hard edges;\n"
            "gradients ripple a little. On finer targets both give back what texels\n"
            "lose as means. tent: bilinear, what renderers look up. Default: cubic",
            [&options](const std::string& text) {
              options.mesh.filter = parse_filter("--filter", text);
            });
  add_value(command, "--sigma", "S", group,
            "Of gaussian: a texel's standard deviation in texels, 0.1 to 4. Wider\n"
            "blurs more and costs time with its square; below 0.35 texels may\n"
            "find nothing. Default: 0.5",
            [&options](const std::string& text) {
              options.mesh.sigma_texels = parse_number("--sigma", text, 0.1, 4);
            });
  add_switch(command, "--densify", group,
             "Of gaussian: split texels that are large on the surface, so that it\n"
             "is about uniformly dense: up to three times as many Gaussians",
             options.mesh.densify);
}

void add_splat_options(CLI::App& command, TransferOptions& options) {
  const char* const group = "Gaussians (SOURCE is a splat scene)";
  add_value(command, "--sh", "MODE", group,
            "Which colour a Gaussian with spherical harmonics shows to a texel.\n"
            "mean: over all directions that look at the texel, as for a material\n"
            "that is lit anew. normal: as seen from straight above, with the\n"
            "highlights of there. dc: its base colour, a little faster. Default: mean",
            [&options](const std::string& text) {
              options.splats.harmonics = parse_harmonics("--sh", text);
            });
  add_filter_options(command, group, "in the job's axes: after --source-axes",
                     options.splats.filter.min_opacity, options.splats.filter.max_scale,
                     options.splats.filter.box);
  add_value(command, "--rays", "N", group,
            "So many further rays per texel, 0 to 16, in a cone of 35 degrees\n"
            "around its normal: 3 are 0.2 to 0.5 dB nearer to unseen views, but\n"
            "softer, and fine print goes. Each takes nearly as long as the\n"
            "normal. Default: 0",
            [&options](const std::string& text) {
              options.splats.rays =
                  static_cast<std::uint32_t>(parse_integer("--rays", text, 0, kMostRays));
            });
  add_switch(command, "--alpha", group,
             "Write how opaque the scene is at each texel as the image's alpha",
             options.splats.alpha);
  add_value(command, "--min-confidence", "C", group,
            "Leave texels empty that are less sure than this, 0 to 1: how opaque\n"
            "the surface is, less where colours along the normal differ or it lies\n"
            "far away, times how well the scene lies at the target. 0: show\n"
            "whatever is there. Default: 0.01",
            [&options](const std::string& text) {
              options.splats.min_confidence = parse_number("--min-confidence", text, 0, 1);
            });
  add_value(command, "--near-target", "D|P%|off", group,
            "Do not sort what stays farther than this from every target's\n"
            "surface, with 3 standard deviations counted in. The store in the\n"
            "cache is then of use to these targets alone. off: sort all.\n"
            "Default: 6.6% (or 2.2 times --max-distance, if more) where a sample\n"
            "says that this spares three quarters of the scene, else off",
            [&options](const std::string& text) {
              options.splats.everywhere = text == "off";
              options.splats.near_target.reset();
              if (!options.splats.everywhere)
                options.splats.near_target = parse_length("--near-target", text);
            });
}

void add_search_options(CLI::App& command, TransferOptions& options) {
  const char* const group = "Search";
  add_value(command, "--max-distance", "D|P%", group,
            "How far along its normal, both ways, a texel may look: in the\n"
            "target's units, or % of its diagonal (up to 100%). A larger value\n"
            "costs time: much where nothing is near, else little. Of a splat scene\n"
            "1% keeps a second layer behind a thin one out, more reaches a scene\n"
            "that a coarse mesh lies beside. Default: 5%, 3% for splat scenes",
            [&options](const std::string& text) {
              options.search.max_distance = parse_length("--max-distance", text);
            });
  add_value(command, "--max-angle", "DEG", group,
            "Ignore source surface that faces away from the texel's normal by\n"
            "more than this, 0 to 89.9 degrees. Default: 80",
            [&options](const std::string& text) {
              options.search.max_angle_deg = parse_number("--max-angle", text, 0, kLargestAngle);
            });
}

}  // namespace

Command add_transfer_command(CLI::App& program) {
  const auto settings = std::make_shared<Settings>();
  TransferOptions& options = settings->options;
  CLI::App* command = program.add_subcommand(
      "transfer", "Move a textured mesh's or splat scene's appearance onto another mesh's UVs");
  set_help_text(*command, kUsage);
  command
      ->add_option("SOURCE", options.source,
                   "Textured mesh (.glb, .gltf, .obj) or splat scene (.ply, .spz, .sog, .glb, "
                   ".gltf,\n.splat, .ksplat)")
      ->option_text(" ")
      ->required();
  command
      ->add_option("TARGET", options.targets,
                   "Meshes with UVs: .glb, .gltf or .obj. For several, OUTPUT holds <TARGET>")
      ->option_text("...")
      ->required();
  add_picture_options(*command, options);
  add_file_options(*command, options);
  add_coverage_option(*command, options);
  add_skip_option(*command, options);
  add_paint_options(*command, options);
  add_source_options(*command, options);
  add_colour_options(*command, options);
  add_mesh_options(*command, "source", "Source", options.source_use);
  add_mesh_options(*command, "target", "Target", options.target_use);
  add_search_options(*command, options);
  add_splat_options(*command, options);
  add_method_options(*command, options);
  add_external_option(*command, "Target", options.allow_external);
  add_format_option(*command, "Source", options.allowed_formats);
  add_resource_options(*command, options.resources);
  add_job_options(*command, settings->job);
  add_switch(*command, "--plan", "What is said",
             "Print least memory, disk and files; do and write nothing", settings->job.plan_only);
  const auto run = [settings] {
    return run_job(settings->job, [&settings](Progress* progress, Report* report) {
      check_channel_names(settings->options);
      if (settings->job.plan_only) {
        plan(settings->options, progress, report);
      } else {
        transfer(settings->options, progress, report);
      }
    });
  };
  return {command, run};
}

}  // namespace pounce::cli
