// SPDX-License-Identifier: Apache-2.0
//
// The commands that run a job. Their options come from the library's table. What the command line
// gives is kept as text until all of it is read, since --job may name a file with more options:
// those are set first, so that the command line wins.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <memory>

#include "commands.h"
#include "pounce/error.h"
#include "pounce/gaussians.h"
#include "pounce/transfer.h"

namespace pounce::cli {
namespace {

constexpr const char* kTransferUsage =
    "Usage: pounce transfer SOURCE TARGET... -o OUTPUT [options]\n"
    "\n"
    "Examples:\n"
    "  # Transfer the skin of a scan to an avatar, at the resolution of the scan's texture.\n"
    "  pounce transfer scan.glb avatar.glb -o avatar.png\n"
    "\n"
    "  # Every channel the source has, 8192 x 8192 texels each, in one GiB of memory.\n"
    "  pounce transfer scan.glb avatar.glb -o 'maps/<CHANNEL>.png' --size 8192 --memory 1GiB\n"
    "\n"
    "  # A finished model: the avatar with its new textures.\n"
    "  pounce transfer scan.glb avatar.glb -o finished.glb\n"
    "\n"
    "  # A mesh without materials, with its texture in a file of its own, and a coverage mask.\n"
    "  pounce transfer scan.obj avatar.obj --source-texture baseColor=scan.exr \\\n"
    "      -o avatar.exr --coverage avatar.mask.png\n"
    "\n"
    "  # UDIMs in and out: one image per tile; later two of the tiles again.\n"
    "  pounce transfer scan.obj hero.obj -o 'hero.<UDIM>.exr' \\\n"
    "      --source-texture 'baseColor=scan.<UDIM>.exr'\n"
    "  pounce transfer scan.obj hero.obj -o 'hero.<UDIM>.exr' --tiles 1003,1011 \\\n"
    "      --source-texture 'baseColor=scan.<UDIM>.exr'\n"
    "\n"
    "  # A splat scene onto a mesh that is aligned with its surface; then one chair of the room,\n"
    "  # without haze (docs/splats.md).\n"
    "  pounce transfer room.ply proxy.glb -o proxy.png --size 4096\n"
    "  pounce transfer room.ply chair.glb -o chair.png --size 2048 --min-opacity 0.1 \\\n"
    "      --max-distance 1% --box 0,0,0,1.5,1,1\n"
    "\n"
    "  # One scan onto many avatars: the source is prepared once.\n"
    "  pounce transfer scan.glb avatars/*.glb -o 'skins/<TARGET>.png'";

constexpr const char* kApplyUsage =
    "Usage: pounce apply MAP --source-texture NAME=PATH -o OUTPUT [options]\n"
    "\n"
    "Paints images through a hit map: what pounce transfer would give with this texture on "
    "the\n"
    "source, texel for texel, without the meshes and without a search.\n"
    "\n"
    "Examples:\n"
    "  # Once: transfer, and keep where each texel hit the source.\n"
    "  pounce transfer scan.glb avatar.glb -o avatar.png --map avatar.hits.exr\n"
    "\n"
    "  # For every new version of the scan's texture.\n"
    "  pounce apply avatar.hits.exr --source-texture baseColor=scan_v2.png -o avatar_v2.png\n"
    "\n"
    "  # UDIMs, and a map that no material has.\n"
    "  pounce apply 'hero.hits.<UDIM>.exr' --source-texture 'wetness=wet.<UDIM>.exr' \\\n"
    "      --channels wetness -o 'hero.wetness.<UDIM>.exr'";

constexpr const char* kMapsUsage =
    "Usage: pounce maps TARGET -o 'OUTPUT with <CHANNEL>' [options]\n"
    "\n"
    "Examples:\n"
    "  # maps/position.exr, maps/normal.exr and maps/mask.exr, 1024 x 1024 texels each.\n"
    "  pounce maps avatar.glb -o 'maps/<CHANNEL>.exr'\n"
    "\n"
    "  # The same, larger, in a quarter of a GiB of memory.\n"
    "  pounce maps avatar.glb -o 'maps/<CHANNEL>.exr' --size 16384 --memory 256MiB";

constexpr const char* kGaussiansUsage =
    "Usage: pounce gaussians SOURCE -o OUTPUT [options]\n"
    "\n"
    "Writes Gaussian splats as 3DGS PLY (.ply), SPZ 2 (.spz) or glTF (.glb).\n"
    "From a mesh: one flat disc for every texel of the baseColor image that the surface\n"
    "uses, stretched and rotated like the texel on the surface. A triangle without a texel's\n"
    "centre, or without an image, becomes one disc.\n"
    "From a splat scene in any supported format: its Gaussians, or some of them.\n"
    "A Gaussian takes 68 bytes as .ply, 56 as .glb, 19 before compression as .spz;\n"
    "spherical harmonics of degree 3 add 180, 180 and 45.\n"
    "\n"
    "Examples:\n"
    "  # A model for any viewer of Gaussian splats.\n"
    "  pounce gaussians scan.glb -o scan.ply\n"
    "\n"
    "  # With another texture than the mesh's own, in a quarter of a GiB of memory.\n"
    "  pounce gaussians scan.obj -o scan.ply --source-texture baseColor=scan.exr \\\n"
    "    --memory 256MiB\n"
    "\n"
    "  # A trained scene for the web: the half million that matter, within a box.\n"
    "  pounce gaussians room.ply -o table.spz --box -1,-1,-1,1,1,1 --count 500000";

template <class Options>
struct Line {
  Options options;
  JobSettings job;
  std::string job_path;             ///< --job
  std::vector<OptionReport> given;  ///< on the command line
};

const OptionReport* find_given(const std::vector<OptionReport>& given, const std::string& name) {
  const auto at = std::find_if(given.begin(), given.end(),
                               [&](const OptionReport& option) { return option.name == name; });
  return at == given.end() ? nullptr : &*at;
}

/// Is the option, or one that excludes it, on the command line?
bool is_overridden(const std::vector<OptionInfo>& table, const std::vector<OptionReport>& given,
                   const std::string& name) {
  if (find_given(given, name) != nullptr) return true;
  return std::any_of(table.begin(), table.end(), [&](const OptionInfo& info) {
    const std::string other = info.name == name       ? info.excludes
                              : info.excludes == name ? info.name
                                                      : "";
    return !other.empty() && find_given(given, other) != nullptr;
  });
}

/// The texts of an option in a file, each as the command line would have it.
std::vector<std::string> typed_texts(const std::vector<OptionInfo>& table,
                                     const OptionReport& option) {
  const auto row = std::find_if(table.begin(), table.end(),
                                [&](const OptionInfo& info) { return info.name == option.name; });
  if (row == table.end() || row->values != OptionValues::list) return option.values;
  return {fmt::format("{}", fmt::join(option.values, ","))};
}

template <class Options>
void set_recorded(JobCommand command, Line<Options>& line) {
  const std::string name = job_command_name(command);
  const RecordedJob job = read_job(line.job_path);
  if (job.command != name) {
    throw Error(ErrorKind::usage,
                fmt::format("{0}: is a job of {1}; run it with pounce {1} --job {0}", line.job_path,
                            job.command));
  }
  const std::vector<OptionInfo>& table = option_table(command);
  for (const OptionReport& option : job.options) {
    if (is_overridden(table, line.given, option.name)) continue;
    if (option.name == "plan") {
      line.job.plan_only = true;
      continue;
    }
    try {
      for (const std::string& text : typed_texts(table, option))
        set_option(line.options, option.name, text);
    } catch (const Error& error) {
      throw Error(error.kind(), line.job_path + ": " + error.what());
    }
  }
}

/// Once the whole line is read.
template <class Options>
void set_options(JobCommand command, Line<Options>& line) {
  if (!line.job_path.empty()) set_recorded(command, line);
  for (const OptionReport& option : line.given) {
    for (const std::string& text : option.values) set_option(line.options, option.name, text);
  }
  const std::vector<OptionReport> known = option_texts(line.options);
  for (const OptionInfo& info : option_table(command)) {
    if (!info.is_required || find_given(known, info.name) != nullptr) continue;
    throw Error(ErrorKind::usage,
                (info.is_operand ? info.value : "--" + info.name) + " is required");
  }
}

/// A command with the options of its table; `run` gets them.
template <class Options>
Command add_job_command(CLI::App& program, JobCommand which, const std::string& purpose,
                        const std::string& usage,
                        void (*run)(const Line<Options>&, Progress*, Report*)) {
  const auto line = std::make_shared<Line<Options>>();
  CLI::App* command = program.add_subcommand(job_command_name(which), purpose);
  set_help_text(*command, usage);
  for (const OptionInfo& info : option_table(which)) {
    CLI::Option* option = add_row(*command, info, [line, name = info.name](const auto& text) {
      if (find_given(line->given, name) == nullptr) line->given.push_back({name, {}, false});
      line->given.back().values.push_back(text);
    });
    if (!info.excludes.empty()) option->excludes("--" + info.excludes);
  }
  const bool is_transfer = which == JobCommand::transfer || which == JobCommand::apply;
  if (is_transfer) {
    add_switch(*command, "--plan", "Reporting",
               "Print the least memory, disk space and files; write nothing", line->job.plan_only);
  }
  if (which != JobCommand::gaussians) {
    CLI::Option* redo =
        add_switch(*command, "--redo", "Output",
                   "Make outputs again that this same job has made; without it they are skipped",
                   line->job.redo);
    if (is_transfer) redo->excludes("--skip-existing");
  }
  add_value(*command, "--job", "FILE", "Reporting",
            "Run the job that this report records, or a JSON file of the same form "
            "(docs/report.md). Options on the command line override it; its relative paths start "
            "at the current folder",
            [line](const std::string& text) { line->job_path = parse_path("--job", text); });
  add_job_options(*command, line->job);
  command->callback([line, which] { set_options(which, *line); });
  return {command, [line, run] {
            return run_job(line->job, [&](Progress* progress, Report* report) {
              run(*line, progress, report);
            });
          }};
}

void run_transfer(const Line<TransferOptions>& line, Progress* progress, Report* report) {
  TransferOptions options = line.options;
  options.keep_made = !line.job.redo;
  if (line.job.plan_only) {
    plan(options, progress, report);
  } else {
    transfer(options, progress, report);
  }
}

}  // namespace

Command add_transfer_command(CLI::App& program) {
  return add_job_command<TransferOptions>(
      program, JobCommand::transfer,
      "Transfer a textured mesh's or splat scene's appearance onto another mesh's UVs",
      kTransferUsage, run_transfer);
}

Command add_apply_command(CLI::App& program) {
  return add_job_command<TransferOptions>(
      program, JobCommand::apply, "Paint new textures through a map that transfer --map wrote",
      kApplyUsage, run_transfer);
}

Command add_maps_command(CLI::App& program) {
  return add_job_command<MapsOptions>(
      program, JobCommand::maps, "Write a mesh's position, normal and mask images over its UVs",
      kMapsUsage, [](const Line<MapsOptions>& line, Progress* progress, Report* report) {
        MapsOptions options = line.options;
        options.keep_made = !line.job.redo;
        maps(options, progress, report);
      });
}

Command add_gaussians_command(CLI::App& program) {
  return add_job_command<GaussiansOptions>(
      program, JobCommand::gaussians, "Write a textured mesh or a splat scene as Gaussian splats",
      kGaussiansUsage, [](const Line<GaussiansOptions>& line, Progress* progress, Report* report) {
        gaussians(line.options, progress, report);
      });
}

}  // namespace pounce::cli
