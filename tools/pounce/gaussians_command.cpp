// SPDX-License-Identifier: Apache-2.0
#include <memory>

#include "arguments.h"
#include "commands.h"
#include "pounce/gaussians.h"
#include "shared_options.h"

namespace pounce::cli {
namespace {

constexpr const char* kUsage =
    "Usage: pounce gaussians SOURCE -o OUTPUT [options]\n"
    "\n"
    "Writes Gaussian splats as 3DGS PLY (.ply), SPZ 2 (.spz) or glTF (.glb).\n"
    "Of a mesh: one flat disc for every texel of the baseColor image that the surface\n"
    "uses, stretched and turned as the texel is on the surface. A triangle that holds\n"
    "no texel's centre, or has no image, becomes one disc.\n"
    "Of a splat scene, in any format that is read: its Gaussians, or some of them.\n"
    "A Gaussian takes 68 bytes as .ply, 56 as .glb, 19 before compression as .spz;\n"
    "harmonics of degree 3 add 180, 180 and 45.\n"
    "\n"
    "Examples:\n"
    "  # A model for any viewer of Gaussian splats.\n"
    "  pounce gaussians scan.glb -o scan.ply\n"
    "\n"
    "  # With another texture than the mesh names, in a quarter of a GiB of memory.\n"
    "  pounce gaussians scan.obj -o scan.ply --source-texture baseColor=scan.exr \\\n"
    "    --memory 256MiB\n"
    "\n"
    "  # A trained scene for the web: the half million that matter, within a box.\n"
    "  pounce gaussians room.ply -o table.spz --box -1,-1,-1,1,1,1 --count 500000";

struct Settings {
  GaussiansOptions options;
  JobSettings job;
};

void add_mesh_source_options(CLI::App& command, GaussiansOptions& options) {
  const char* const group = "Splats of a mesh";
  add_value(command, "--source-texture", "baseColor=PATH", group,
            "Take the colours from this image instead of what the mesh\n"
            "says",
            [&options](const std::string& text) {
              std::vector<OtherMap> maps;
              const SourceTexture texture = parse_source_texture("--source-texture", text, maps);
              if (texture.channel != Channel::base_color) {
                throw Error(ErrorKind::usage, "--source-texture: got \"" + text +
                                                  "\", expected baseColor=PATH: splats have one "
                                                  "colour");
              }
              options.source_textures = {texture};
            });
  add_value(command, "--source-colorspace", "SPACE", group,
            "What the colours of the images are: srgb, lin_rec709, acescg,\n"
            "aces2065-1, display-p3, or a space of --ocio. Default: what their\n"
            "files say",
            [&options](const std::string& text) {
              options.colour.source_spaces = {{std::nullopt, text}};
            });
  add_config_option(command, group, options.colour.config);
  add_value(command, "--sigma", "S", group,
            "Standard deviation of a texel's disc in texels, 0.1 to 4. Below 0.4\n"
            "viewers show gaps. Default: 0.5",
            [&options](const std::string& text) {
              options.sigma_texels = parse_number("--sigma", text, 0.1, 4);
            });
  add_value(command, "--sharpen", "A", group,
            "Sharpen colours by A times what a blend of the discs takes away\n"
            "from them, 0 to 4: for a transfer back onto a mesh, best with\n"
            "--sigma 0.25. Default: 0",
            [&options](const std::string& text) {
              options.sharpen = parse_number("--sharpen", text, 0, 4);
            });
}

void add_scene_source_options(CLI::App& command, GaussiansOptions& options) {
  const char* const group = "Splats of a scene";
  add_value(command, "--count", "N", group,
            "No more than the N most important Gaussians: by opacity times the\n"
            "product of the two larger standard deviations. Reads the scene twice.\n"
            "Default: all",
            [&options](const std::string& text) {
              options.count = parse_integer("--count", text, 1, UINT64_MAX);
            });
  add_filter_options(command, group, "as the scene is stored, or after --source-axes",
                     options.filter.min_opacity, options.filter.max_scale, options.filter.box);
}

}  // namespace

Command add_gaussians_command(CLI::App& program) {
  const auto settings = std::make_shared<Settings>();
  GaussiansOptions& options = settings->options;
  CLI::App* command = program.add_subcommand(
      "gaussians", "Write a textured mesh or a splat scene as Gaussian splats");
  set_help_text(*command, kUsage);
  command
      ->add_option("SOURCE", options.source,
                   "Mesh with a baseColor texture (.glb, .gltf, .obj) or splat scene")
      ->option_text(" ")
      ->required();
  add_value(*command, "-o,--output", "OUTPUT", "Splats",
            "File to write (.ply, .spz or .glb). It appears whole or not at all",
            [&options](const std::string& text) { options.output = parse_path("-o", text); })
      ->required();
  add_value(*command, "--source-axes", "AXES", "Splats",
            "OUTPUT's x, y and z as SOURCE's, such as x,-y,-z. Default: as\n"
            "stored; scenes that come from or go to glTF, where y is up, are\n"
            "turned: -x,-y,z",
            [&options](const std::string& text) {
              options.axes = parse_axes_text("--source-axes", text);
            });
  add_mesh_source_options(*command, options);
  add_scene_source_options(*command, options);
  add_external_option(*command, "Splats", options.allow_external);
  add_format_option(*command, "Splats", options.allowed_formats);
  add_resource_options(*command, options.resources);
  add_job_options(*command, settings->job);
  const auto run = [settings] {
    return run_job(settings->job, [&settings](Progress* progress, Report* report) {
      gaussians(settings->options, progress, report);
    });
  };
  return {command, run};
}

}  // namespace pounce::cli
