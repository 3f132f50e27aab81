// SPDX-License-Identifier: Apache-2.0
#include <memory>

#include "commands.h"
#include "pounce/inspect.h"
#include "shared_options.h"

namespace pounce::cli {
namespace {

constexpr const char* kUsage =
    "Usage: pounce inspect FILE [--json]\n"
    "\n"
    "Examples:\n"
    "  # Triangles, UV sets and their ranges, materials and their textures.\n"
    "  pounce inspect avatar.glb\n"
    "\n"
    "  # Gaussians of a splat scene, those a transfer would leave out, and why.\n"
    "  pounce inspect room.ply\n"
    "\n"
    "  # Size, sample type and colour space of an image, for a program.\n"
    "  pounce inspect skin.png --json\n"
    "\n"
    "  # Is this pack of the tile cache sound?\n"
    "  pounce inspect ~/.cache/pounce/v1/geometry/*.pack";

struct Settings {
  std::string path;
  bool json = false;
};

}  // namespace

Command add_inspect_command(CLI::App& program) {
  const auto settings = std::make_shared<Settings>();
  CLI::App* command = program.add_subcommand(
      "inspect", "Say what a mesh, a splat scene, an image or a tile store holds");
  set_help_text(*command, kUsage);
  command->add_option("FILE", settings->path, "Mesh, splat scene, image or pack file")
      ->option_text(" ")
      ->required();
  add_switch(*command, "--json", "Options", "As JSON instead of text", settings->json);
  const auto run = [settings] {
    write_stdout(settings->json ? inspect_json(settings->path) : inspect_text(settings->path));
    return 0;
  };
  return {command, run};
}

}  // namespace pounce::cli
