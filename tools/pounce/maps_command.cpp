// SPDX-License-Identifier: Apache-2.0
#include <memory>

#include "arguments.h"
#include "commands.h"
#include "pounce/error.h"
#include "pounce/transfer.h"
#include "shared_options.h"

namespace pounce::cli {
namespace {

constexpr const char* kUsage =
    "Usage: pounce maps TARGET -o 'OUTPUT with <CHANNEL>' [options]\n"
    "\n"
    "Examples:\n"
    "  # maps/position.exr, maps/normal.exr and maps/mask.exr, 1024 x 1024 texels each.\n"
    "  pounce maps avatar.glb -o 'maps/<CHANNEL>.exr'\n"
    "\n"
    "  # The same, larger, in a quarter of a GiB of memory.\n"
    "  pounce maps avatar.glb -o 'maps/<CHANNEL>.exr' --size 16384 --memory 256MiB";

struct Settings {
  MapsOptions options;
  JobSettings job;
};

}  // namespace

Command add_maps_command(CLI::App& program) {
  const auto settings = std::make_shared<Settings>();
  MapsOptions& options = settings->options;
  CLI::App* command = program.add_subcommand(
      "maps", "Write a mesh's position, normal and mask images over its UVs");
  set_help_text(*command, kUsage);
  command->add_option("TARGET", options.target, "Mesh with UVs: .glb, .gltf or .obj")
      ->option_text(" ")
      ->required();
  add_value(*command, "-o,--output", "OUTPUT", "Picture",
            "Images to write (.exr); must hold <CHANNEL>, which becomes\n"
            "position, normal and mask; with <UDIM> or <UVTILE> an image per tile\n"
            "of UV space",
            [&options](const std::string& text) {
              options.output = parse_image_pattern("-o", text);
              if (options.output.find("<CHANNEL>") == std::string::npos) {
                throw Error(ErrorKind::usage,
                            "-o: got \"" + text +
                                "\", expected <CHANNEL> in it: three images need three names");
              }
            })
      ->required();
  add_value(
      *command, "--size", "N|WxH", "Picture",
      "Texels, each side 1 to 65536. Time grows with their number.\n"
      "Default: 1024",
      [&options](const std::string& text) { options.size = parse_image_size("--size", text); });
  add_mesh_options(*command, "target", "Target", options.target_use);
  add_external_option(*command, "Target", options.allow_external);
  add_resource_options(*command, options.resources);
  add_job_options(*command, settings->job);
  const auto run = [settings] {
    return run_job(settings->job, [&settings](Progress* progress, Report* report) {
      maps(settings->options, progress, report);
    });
  };
  return {command, run};
}

}  // namespace pounce::cli
