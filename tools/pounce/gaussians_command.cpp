// SPDX-License-Identifier: Apache-2.0
#include <memory>

#include "arguments.h"
#include "commands.h"
#include "pounce/gaussians.h"
#include "shared_options.h"

namespace pounce::cli {
namespace {

constexpr const char* kUsage =
    "Usage: pounce gaussians SOURCE -o OUTPUT.ply [options]\n"
    "\n"
    "One flat disc for every texel of the baseColor image that the surface uses, half a\n"
    "texel its standard deviation, stretched and turned as the texel is on the surface.\n"
    "A triangle that holds no texel's centre, or has no image, becomes one disc.\n"
    "A texel takes 68 bytes: a full 4096 x 4096 image 1.1 GB.\n"
    "\n"
    "Examples:\n"
    "  # A model for any viewer of Gaussian splats.\n"
    "  pounce gaussians scan.glb -o scan.ply\n"
    "\n"
    "  # With another texture than the mesh names, in a quarter of a GiB of memory.\n"
    "  pounce gaussians scan.obj -o scan.ply --source-texture baseColor=scan.exr \\\n"
    "    --memory 256MiB";

struct Settings {
  GaussiansOptions options;
  JobSettings job;
};

}  // namespace

Command add_gaussians_command(CLI::App& program) {
  const auto settings = std::make_shared<Settings>();
  GaussiansOptions& options = settings->options;
  CLI::App* command =
      program.add_subcommand("gaussians", "Write a textured mesh as Gaussian splats (3DGS PLY)");
  set_help_text(*command, kUsage);
  command
      ->add_option("SOURCE", options.source, "Mesh with a baseColor texture: .glb, .gltf or .obj")
      ->option_text(" ")
      ->required();
  add_value(*command, "-o,--output", "OUTPUT", "Splats",
            "File to write (.ply). It appears whole or not at all",
            [&options](const std::string& text) { options.output = parse_path("-o", text); })
      ->required();
  add_value(*command, "--source-texture", "baseColor=PATH", "Splats",
            "Take the colours from this image instead of what the mesh\n"
            "says",
            [&options](const std::string& text) {
              const SourceTexture texture = parse_source_texture("--source-texture", text);
              if (texture.channel != Channel::base_color) {
                throw Error(ErrorKind::usage, "--source-texture: got \"" + text +
                                                  "\", expected baseColor=PATH: splats have one "
                                                  "colour");
              }
              options.source_textures = {texture};
            });
  add_external_option(*command, "Splats", options.allow_external);
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
