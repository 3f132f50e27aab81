// SPDX-License-Identifier: Apache-2.0
//
// The commands that run a job. Their options come from the library's table.
#include <fmt/format.h>

#include <memory>
#include <type_traits>

#include "commands.h"
#include "job_line.h"
#include "pounce/error.h"
#include "pounce/gaussians.h"
#include "pounce/proxy.h"
#include "pounce/textured_mesh.h"
#include "pounce/transfer.h"
#include "task_number.h"

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

constexpr const char* kPrepareUsage =
    "Usage: pounce prepare SOURCE TARGET... -o OUTPUT [--job-folder DIR --tasks N] [options]\n"
    "\n"
    "Takes the options of pounce transfer. Reads meshes and images, and keeps what is made of them "
    "in\n"
    "the cache, for tasks that start together later. Writes no image; runs again in no time.\n"
    "\n"
    "Examples:\n"
    "  # Once, then four tasks, on four machines that share this folder.\n"
    "  pounce prepare scan.glb hero.obj -o 'hero.<UDIM>.exr' --cache job/cache \\\n"
    "      --job-folder job --tasks 4\n"
    "  pounce transfer --job job --task 1/4      # and 2/4, 3/4, 4/4\n"
    "  pounce assemble job";

constexpr const char* kAssembleUsage =
    "Usage: pounce assemble FOLDER [options]\n"
    "\n"
    "Checks that everything the tasks of a job were to make is there, and makes images of what "
    "they "
    "left\n"
    "in parts: the files of one run, byte for byte. What is missing is named, with its tasks, and "
    "the\n"
    "status is 75; run these tasks again, then this. When all is there, the parts are removed.\n"
    "\n"
    "Example:\n"
    "  pounce assemble job";

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

constexpr const char* kProxyUsage =
    "Usage: pounce proxy SOURCE -o OUTPUT.glb [options]\n"
    "\n"
    "Makes a mesh with UVs of the surface of a splat scene or a point cloud: the target of a\n"
    "transfer of the same scene. The scene is drawn from 48 sides; where their depths meet is\n"
    "the surface, which is smoothed, simplified, cut into charts and packed.\n"
    "It is for objects that are seen from all around. Of a room or an open scene, choose an\n"
    "object with --box.\n"
    "Of a mesh it makes a lighter one in new UVs, with all its textures and its shape in a\n"
    "normal map: a level of detail, as pounce mesh does with more to choose.\n"
    "\n"
    "Examples:\n"
    "  # The mesh of a scene, twice as fine as usual, for a larger texture.\n"
    "  pounce proxy statue.ply -o proxy.glb --triangles 40000 --size 4096\n"
    "\n"
    "  # A level of detail of a model.\n"
    "  pounce proxy statue.glb -o statue.lod2.glb --triangles 5000 --size 1024";

constexpr const char* kMeshUsage =
    "Usage: pounce mesh SOURCE -o OUTPUT.glb [options]\n"
    "\n"
    "Makes a textured model of a splat scene, a point cloud or a heavy mesh: the mesh that\n"
    "pounce proxy makes, and a transfer of the source onto it.\n"
    "\n"
    "Examples:\n"
    "  # From the file that a trainer wrote to a textured model.\n"
    "  pounce mesh statue.ply -o statue.glb\n"
    "\n"
    "  # One object of a room, lighter, without haze.\n"
    "  pounce mesh room.ply -o chair.glb --box 0,0,0,1.5,1,1 --triangles 5000 --min-opacity 0.1\n"
    "\n"
    "  # A scan of millions of triangles for a game: colours and a normal map.\n"
    "  pounce mesh scan.obj -o scan.glb --triangles 10000 --size 4096";

void add_farm_options(CLI::App& command, FarmLine& farm) {
  const std::string group = "Tasks on one machine or many (docs/farm.md)";
  if (farm.role == TaskRole::whole) {
    add_value(command, "--task", "K/N|auto", group,
              "Make share K of N of the job, balanced by area: whole images, and parts of an image "
              "where there are fewer images than tasks. auto: K as an array of Slurm, Kubernetes, "
              "AWS Batch, SGE or PBS numbers it, N of the job folder; auto/N also works",
              [&farm](const std::string& text) { farm.task = text; });
  } else {
    add_value(command, "--tasks", "N", group, "How many tasks will share the job",
              [&farm](const std::string& text) { farm.tasks = parse_count("--tasks", text); });
  }
  add_value(
      command, "--job-folder", "DIR", group,
      "Folder that all tasks see: the job itself, how each task stands (pounce status), parts "
      "of images (pounce assemble). Needed where an image or a model is shared",
      [&farm](const std::string& text) { farm.folder = parse_path("--job-folder", text); });
}

/// A command with the options of its table; `run` gets them.
template <class Options>
Command add_job_command(CLI::App& program, JobCommand which, const std::string& name,
                        const std::string& purpose, const std::string& usage,
                        void (*run)(const Line<Options>&, Progress*, Report*),
                        TaskRole role = TaskRole::whole) {
  const auto line = std::make_shared<Line<Options>>();
  line->farm.role = role;
  CLI::App* command = program.add_subcommand(name, purpose);
  set_help_text(*command, usage);
  for (const OptionInfo& info : option_table(which)) add_given<Options>(*command, info, line);
  if (which == JobCommand::transfer) add_farm_options(*command, line->farm);
  const bool is_transfer = which == JobCommand::transfer || which == JobCommand::apply;
  if (is_transfer && role == TaskRole::whole) {
    add_switch(*command, "--plan", "Reporting",
               "Print the least memory, disk space and files; write nothing", line->job.plan_only);
  }
  if (which != JobCommand::gaussians && which != JobCommand::proxy) {
    CLI::Option* redo =
        add_switch(*command, "--redo", "Output",
                   "Make outputs again that this same job has made; without it they are skipped",
                   line->job.redo);
    if (is_transfer) redo->excludes("--skip-existing");
  }
  add_value(*command, "--job", "FILE", "Reporting",
            "Run the job that this report records, or a JSON file of the same form "
            "(docs/report.md), or the one of a job folder. Options on the command line override "
            "it; its relative paths start "
            "at the current folder",
            [line](const std::string& text) { line->job_path = parse_path("--job", text); });
  add_job_options(*command, line->job);
  command->callback([line, which] { set_options(which, *line); });
  return {command, [line, run] {
            if constexpr (std::is_same_v<Options, TransferOptions>) take_share(*line);
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
      program, JobCommand::transfer, "transfer",
      "Transfer a textured mesh's or splat scene's appearance onto another mesh's UVs",
      kTransferUsage, run_transfer);
}

Command add_prepare_command(CLI::App& program) {
  return add_job_command<TransferOptions>(
      program, JobCommand::transfer, "prepare",
      "Build the stores that tasks of one transfer will read, once", kPrepareUsage, run_transfer,
      TaskRole::prepare);
}

namespace {

/// What an assembling run did not find has to be made again.
void assemble(const Line<TransferOptions>& line, Progress* progress, Report* report) {
  try {
    transfer(line.options, progress, report);
  } catch (const Error&) {
    const JobFolder folder(line.farm.folder);
    for (const MissingImage& image : report->missing) {
      for (const std::uint32_t task : image.tasks) {
        const std::string name = std::to_string(task);
        if (folder.look_at(name).state == "done") folder.forget(name);  // others say why
      }
    }
    throw;
  }
}

}  // namespace

Command add_assemble_command(CLI::App& program) {
  const auto line = std::make_shared<Line<TransferOptions>>();
  CLI::App* command = program.add_subcommand(
      "assemble", "Check what tasks have made, and make images of parts of them");
  set_help_text(*command, kAssembleUsage);
  command
      ->add_option_function<std::string>(
          "FOLDER", [line](const std::string& text) { line->farm.folder = text; })
      ->description("Job folder that the tasks share")
      ->option_text(" ")
      ->required();
  for (const OptionInfo& info : option_table(JobCommand::transfer)) {
    if (info.group.starts_with("Resources")) add_given<TransferOptions>(*command, info, line);
  }
  add_job_options(*command, line->job);
  return {command, [line] {
            const JobFolder folder(line->farm.folder);
            const std::uint32_t tasks = folder.tasks();
            line->job_path = folder.path();
            set_options(JobCommand::transfer, *line);
            line->options.keep_made = true;
            line->options.share = {TaskRole::assemble, 1, tasks, folder.path()};
            line->job.who = fmt::format("host {}, assemble", host_name());
            line->job.log = std::make_shared<TaskLog>(folder, "assemble");
            return run_job(line->job, [&](Progress* progress, Report* report) {
              assemble(*line, progress, report);
            });
          }};
}

Command add_apply_command(CLI::App& program) {
  return add_job_command<TransferOptions>(
      program, JobCommand::apply, "apply",
      "Paint new textures through a map that transfer --map wrote", kApplyUsage, run_transfer);
}

Command add_maps_command(CLI::App& program) {
  return add_job_command<MapsOptions>(
      program, JobCommand::maps, "maps",
      "Write a mesh's position, normal and mask images over its UVs", kMapsUsage,
      [](const Line<MapsOptions>& line, Progress* progress, Report* report) {
        MapsOptions options = line.options;
        options.keep_made = !line.job.redo;
        maps(options, progress, report);
      });
}

Command add_gaussians_command(CLI::App& program) {
  return add_job_command<GaussiansOptions>(
      program, JobCommand::gaussians, "gaussians",
      "Write a textured mesh or a splat scene as Gaussian splats", kGaussiansUsage,
      [](const Line<GaussiansOptions>& line, Progress* progress, Report* report) {
        gaussians(line.options, progress, report);
      });
}

Command add_proxy_command(CLI::App& program) {
  return add_job_command<ProxyOptions>(
      program, JobCommand::proxy, "proxy",
      "Make a mesh with UVs of a splat scene's or point cloud's surface, or a lighter model",
      kProxyUsage, [](const Line<ProxyOptions>& line, Progress* progress, Report* report) {
        proxy(line.options, progress, report);
      });
}

Command add_mesh_command(CLI::App& program) {
  return add_job_command<TexturedMeshOptions>(
      program, JobCommand::mesh, "mesh",
      "Make a textured model of a splat scene, a point cloud or a heavy mesh", kMeshUsage,
      [](const Line<TexturedMeshOptions>& line, Progress* progress, Report* report) {
        TexturedMeshOptions options = line.options;
        options.transfer.keep_made = !line.job.redo;
        textured_mesh(options, progress, report);
      });
}

}  // namespace pounce::cli
