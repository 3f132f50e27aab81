// SPDX-License-Identifier: Apache-2.0
#include "shared_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "arguments.h"
#include "bad_line.h"
#include "pounce/error.h"

namespace pounce::cli {
namespace {

constexpr unsigned kMostThreads = 1024;
constexpr std::uint64_t kMostUvSets = 255;
constexpr int kHelpColumn = 30;

constexpr const char* kExitStatusHelp =
    "Exit status:\n"
    "    0  done\n"
    "    1  compare: below --min-psnr; transfer: below --min-coverage\n"
    "    2  the command line makes no sense\n"
    "    3  a mesh or an image cannot be used\n"
    "    4  --memory is too small; the message names the least that works\n"
    "    5  a file or folder cannot be read, written or created; the disk is full\n"
    "    6  a tile store is damaged\n"
    "   70  an error inside pounce; please report it\n"
    "   75  another process holds what is needed\n"
    "  130  interrupted; no half-written output is left";

/// Names between commas.
void allow_formats(const std::string& text, std::vector<ImageFormat>& allowed) {
  std::istringstream names(text + ",");
  for (std::string name; std::getline(names, name, ',');) {
    const std::optional<ImageFormat> format = image_format_from_name(name);
    if (!format) {
      throw Error(ErrorKind::usage,
                  fmt::format("--allow-format: got \"{}\", expected bmp or tga, which are not read "
                              "without it; convert images of other formats{}",
                              name, did_you_mean(name, {"bmp", "tga"})));
    }
    if (std::find(allowed.begin(), allowed.end(), *format) == allowed.end())
      allowed.push_back(*format);
  }
}

class HelpFormatter : public CLI::Formatter {
 public:
  explicit HelpFormatter(std::string usage) : usage_(std::move(usage)) {
    column_width(kHelpColumn);
  }
  std::string make_usage(const CLI::App*, std::string) const override {
    return "\n" + usage_ + "\n";
  }
  std::string make_option_opts(const CLI::Option* option) const override {
    const std::string& value = option->get_option_text();  // and no list of what it excludes
    return value.empty() ? "" : " " + value;
  }

 private:
  std::string usage_;
};

}  // namespace

void set_help_text(CLI::App& command, const std::string& usage_and_examples) {
  command.formatter(std::make_shared<HelpFormatter>(usage_and_examples));
  command.footer(kExitStatusHelp);
}

CLI::Option* add_switch(CLI::App& command, const std::string& name, const std::string& group,
                        const std::string& help, bool& flag, bool value) {
  return command
      .add_flag_callback(
          name, [&flag, value] { flag = value; }, help)
      ->disable_flag_override()  // --plan=no would read like the opposite of what it does
      ->group(group);
}

void add_mesh_options(CLI::App& command, const std::string& side, const std::string& group,
                      MeshUse& use) {
  const bool is_source = side == "source";
  const auto add_patterns = [&](const std::string& name, const std::string& help,
                                std::vector<std::string>& patterns) {
    command
        .add_option_function<std::vector<std::string>>(
            name,
            [&patterns, name](const std::vector<std::string>& texts) {
              for (const std::string& text : texts) patterns.push_back(parse_pattern(name, text));
            },
            help)
        ->type_name("NAME")
        ->option_text("NAME")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
        ->group(group);
  };
  add_patterns("--" + side + "-mesh",
               "Only what has this name: node or mesh of a glTF, object or group\n"
               "of an OBJ. May hold * ? [a-c], may be given several times",
               use.meshes);
  add_patterns("--" + side + "-material", "Only triangles of this material; the same patterns",
               use.materials);
  const std::string uv_set = "--" + side + "-uv-set";
  add_value(command, uv_set, "N", group,
            is_source ? "Sample textures through this UV set. Default: as the materials say"
                      : "Write images over this UV set. Default: 0",
            [&use, uv_set](const std::string& text) {
              use.uv_set = static_cast<std::uint32_t>(parse_integer(uv_set, text, 0, kMostUvSets));
            });
  add_value(command, "--" + side + "-axes", "AXES", group,
            "Turn the mesh: its axes in the order wanted, with a minus where\n"
            "one turns round, as in x,-y,-z; written after = where it begins\n"
            "with a minus. Default: as stored",
            [&use, side](const std::string& text) {
              use.axes = parse_axes_text("--" + side + "-axes", text);
            });
}

void add_external_option(CLI::App& command, const std::string& group, bool& allow) {
  add_switch(command, "--allow-external", group,
             "Also read buffers, images and material files that a mesh names\n"
             "outside of its own folder (.., absolute paths, links), and tables\n"
             "that an OpenColorIO configuration names outside of its own. Without\n"
             "it they are refused: a model could bring any file into the output",
             allow);
}

void add_format_option(CLI::App& command, const std::string& group,
                       std::vector<ImageFormat>& allowed) {
  command
      .add_option_function<std::vector<std::string>>(
          "--allow-format",
          [&allowed](const std::vector<std::string>& texts) {
            for (const std::string& text : texts) allow_formats(text, allowed);
          },
          "Also read images of these formats: bmp, tga; names between commas.\n"
          "Without it PNG, JPEG, TIFF, EXR, WebP, HDR and binary PNM are read,\n"
          "told by what a file holds, not by its name. For files you trust:\n"
          "decoders of further formats are easier to attack")
      ->type_name("FORMATS")
      ->option_text("FORMATS")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
      ->group(group);
}

void add_config_option(CLI::App& command, const std::string& group, std::string& config) {
  add_value(command, "--ocio", "CONFIG", group,
            "An OpenColorIO configuration (.ocio), for the names of colour spaces\n"
            "that pounce does not know itself. Its tables must be in its folder\n"
            "(else --allow-external). The last bits of such outputs may differ\n"
            "from one kind of processor to another",
            [&config](const std::string& text) { config = parse_path("--ocio", text); });
}

void add_resource_options(CLI::App& command, Resources& resources) {
  const char* const group = "Machine (the result does not depend on these)";
  add_value(command, "--memory", "SIZE", group,
            "Budget for everything big the job holds: 512MiB, 1.5G, 4096\n"
            "(bytes); KiB, MiB, GiB, TiB = 1024s, kB, MB, GB, TB = 1000s.\n"
            "Smaller means more reading of tiles, not another picture.\n"
            "Default: half of what the process may use (cgroup included)",
            [&resources](const std::string& text) {
              resources.memory_bytes = parse_bytes("--memory", text);
            });
  add_value(command, "--threads", "N", group,
            "Worker threads, 1 to 1024, no more than cores. Default: all cores",
            [&resources](const std::string& text) {
              resources.threads =
                  static_cast<unsigned>(parse_integer("--threads", text, 1, kMostThreads));
            });
  CLI::Option* cache = add_value(
      command, "--cache", "DIR", group,
      "Folder of the tile cache, where a mesh prepared once waits for\n"
      "the next run. Default: $XDG_CACHE_HOME/pounce, else\n"
      "~/.cache/pounce",
      [&resources](const std::string& text) { resources.cache_dir = parse_path("--cache", text); });
  add_switch(command, "--no-cache", group,
             "Keep nothing for the next run: tiles live in nameless files", resources.use_cache,
             false)
      ->excludes(cache);
  add_value(command, "--cache-limit", "SIZE", group,
            "Room on disk that the cache may take: 10GiB, or none. What was\n"
            "used longest ago makes room before anything is written; what does\n"
            "not fit is not kept. Default: a tenth of the file system",
            [&resources](const std::string& text) {
              resources.cache_limit_bytes = parse_limit("--cache-limit", text);
            });
  add_value(
      command, "--temp", "DIR", group, "Folder for scratch files. Default: the output's folder",
      [&resources](const std::string& text) { resources.temp_dir = parse_path("--temp", text); });
  add_value(command, "--max-temp", "SIZE", group,
            "Room on disk that scratch files may take: 10GiB, or none. A job\n"
            "that comes to need more ends with status 5. Default: a tenth of\n"
            "what is free there, but 1 GiB at least",
            [&resources](const std::string& text) {
              resources.max_temp_bytes = parse_limit("--max-temp", text);
            });
  add_switch(command, "--no-wait", group,
             "End with status 75 instead of waiting for what another process\n"
             "is just making for the cache",
             resources.wait_for_cache, false);
}

void add_filter_options(CLI::App& command, const std::string& group, const std::string& box_axes,
                        std::optional<double>& min_opacity, std::optional<double>& max_scale,
                        std::optional<AxisBox>& box) {
  add_value(command, "--min-opacity", "A", group,
            "Leave out Gaussians less opaque than this, 0.0039 (1/255) to 1:\n"
            "against haze. Default: 1/255",
            [&min_opacity](const std::string& text) {
              min_opacity = parse_number("--min-opacity", text, 0.0039, 1);
            });
  add_value(command, "--max-scale", "L", group,
            "Leave out Gaussians whose largest standard deviation is above this,\n"
            "in the scene's units: against sky and fog. Default: no limit",
            [&max_scale](const std::string& text) {
              max_scale = parse_number("--max-scale", text, 1e-30, 1e30);
            });
  add_value(command, "--box", "X0,Y0,Z0,X1,Y1,Z1", group,
            "Leave out Gaussians whose middle is outside of this box, given\n" + box_axes +
                ". Default: no box",
            [&box](const std::string& text) { box = parse_box("--box", text); });
}

void add_job_options(CLI::App& command, JobSettings& settings) {
  const char* const group = "What is said";
  add_value(command, "--report", "FILE", group,
            "Write what was done as JSON: times, counts, bytes, memory,\n"
            "warnings, outputs; also of a job that fails, with its error.\n"
            "- is the standard output",
            [&settings](const std::string& text) {
              settings.report_path = parse_report_path("--report", text);
            });
  add_value(command, "--progress", "KIND", group,
            "auto   a bar on a terminal, plain lines elsewhere (default)\n"
            "plain  a line every few seconds and at the end of each stage\n"
            "json   one JSON object per line; the last says how the job ended\n"
            "none   nothing. All on the standard error output",
            [&settings](const std::string& text) {
              settings.progress = parse_progress_kind("--progress", text);
            });
  CLI::Option* quiet =
      add_switch(command, "-q,--quiet", group, "Say nothing but errors", settings.quiet);
  add_switch(command, "-v,--verbose", group,
             "At the end also show time per stage, memory and tiles", settings.verbose)
      ->excludes(quiet);
}

}  // namespace pounce::cli
