// SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "commands.h"
#include "pounce/error.h"
#include "pounce/inspect.h"
#include "shared_options.h"
#include "visible.h"

namespace pounce::cli {
namespace {

constexpr const char* kUsage =
    "Usage: pounce inspect FILE... [--json]\n"
    "\n"
    "Examples:\n"
    "  # Triangles, names, UV sets with their ranges and UDIM tiles, materials and all their\n"
    "  # textures, those that are not transferred among them.\n"
    "  pounce inspect avatar.glb\n"
    "\n"
    "  # Gaussians of a splat scene, those a transfer would leave out and why, and whether the\n"
    "  # scene (box 98 %: nearly all of it, floaters aside) lies where a mesh does.\n"
    "  pounce inspect room.ply chair.glb\n"
    "\n"
    "  # Size, sample type, colour space, tiles and levels (mipmaps) of an image, for a program.\n"
    "  pounce inspect skin.png --json\n"
    "\n"
    "  # Are these packs of the tile cache sound?\n"
    "  pounce inspect ~/.cache/pounce/v3/geometry/*.pack";

struct Settings {
  std::vector<std::string> paths;
  bool json = false;
  bool allow_external = false;
  std::vector<ImageFormat> allowed_formats;
};

/// One file's description. What is wrong with one of several is said, and the others are looked at
/// all the same; the first such problem is the exit status.
std::string inspect_one(const Settings& settings, const std::string& path, int& status) {
  try {
    const auto say = settings.json ? inspect_json : inspect_text;
    return say(path, settings.allow_external, settings.allowed_formats);
  } catch (const Error& error) {
    if (settings.paths.size() == 1) throw;
    write_stderr("pounce: error: " + visible_line(error.what()) + "\n");
    if (status == 0) status = exit_status(error.kind());
    if (!settings.json) return "";
    const nlohmann::ordered_json said{{"file", path}, {"error", error.what()}};
    return said.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
  }
}

int inspect_all(const Settings& settings) {
  const bool is_list = settings.json && settings.paths.size() > 1;
  int status = 0;
  std::string before = is_list ? "[\n" : "";
  for (const std::string& path : settings.paths) {
    std::string text = inspect_one(settings, path, status);
    if (text.empty()) continue;
    if (is_list) text.pop_back();  // the line's end: a comma may follow
    write_stdout(before + text);
    before = is_list ? ",\n" : "\n";
  }
  if (is_list) write_stdout("\n]\n");
  return status;
}

}  // namespace

Command add_inspect_command(CLI::App& program) {
  const auto settings = std::make_shared<Settings>();
  CLI::App* command = program.add_subcommand(
      "inspect", "Say what a mesh, a splat scene, an image or a tile store holds");
  set_help_text(*command, kUsage);
  command
      ->add_option("FILE", settings->paths,
                   "Mesh (.glb .gltf .obj), splat scene (.ply .spz .sog .glb .splat .ksplat), "
                   "image\nor pack file")
      ->option_text("...")
      ->required();
  add_switch(*command, "--json", "Options",
             "As JSON instead of text: an object; of several files a list of them", settings->json);
  add_external_option(*command, "Options", settings->allow_external);
  add_format_option(*command, "Options", settings->allowed_formats);
  const auto run = [settings] { return inspect_all(*settings); };
  return {command, run};
}

}  // namespace pounce::cli
