// SPDX-License-Identifier: Apache-2.0
//
// The commands that look at files: inspect, compare, cache.
#include <fmt/chrono.h>
#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "commands.h"
#include "job.h"
#include "pounce/cache.h"
#include "pounce/compare.h"
#include "pounce/error.h"
#include "pounce/inspect.h"
#include "terminal.h"

namespace pounce::cli {
namespace {

constexpr const char* kGroup = "Options";

/// How far images are trusted.
void add_trust_options(CLI::App& command, TransferOptions& reading) {
  for (const char* name : {"allow-format", "sandbox"}) {
    add_transfer_row(command, name, kGroup, [&reading, name](const std::string& text) {
      set_option(reading, name, text);
    });
  }
}

}  // namespace

namespace {

constexpr const char* kInspectUsage =
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

struct InspectSettings {
  std::vector<std::string> paths;
  bool json = false;
  TransferOptions reading;  ///< what files may be read
};

/// One file's description. What is wrong with one of several is said, and the others are looked at
/// all the same; the first such problem is the exit status.
std::string inspect_one(const InspectSettings& settings, const std::string& path, int& status) {
  try {
    const auto say = settings.json ? inspect_json : inspect_text;
    return say(path, settings.reading.allow_external, settings.reading.trust);
  } catch (const Error& error) {
    if (settings.paths.size() == 1) throw;
    write_stderr("pounce: error: " + visible_line(error.what()) + "\n");
    if (status == 0) status = exit_status(error);
    if (!settings.json) return "";
    const nlohmann::ordered_json said{{"file", path}, {"error", error.what()}};
    return said.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
  }
}

int inspect_all(const InspectSettings& settings) {
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
  const auto settings = std::make_shared<InspectSettings>();
  CLI::App* command = program.add_subcommand(
      "inspect", "Show the contents of a mesh, splat scene, image or tile store");
  set_help_text(*command, kInspectUsage);
  command
      ->add_option("FILE", settings->paths,
                   "Mesh (.glb .gltf .obj), splat scene (.ply .spz .sog .glb .splat .ksplat), "
                   "point\ncloud (.ply .las), image or pack file")
      ->option_text("...")
      ->required();
  add_switch(*command, "--json", kGroup,
             "Print JSON instead of text: an object, or a list of objects for several files",
             settings->json);
  add_transfer_row(*command, "allow-external", kGroup, [settings](const std::string& text) {
    set_option(settings->reading, "allow-external", text);
  });
  add_trust_options(*command, settings->reading);
  const auto run = [settings] { return inspect_all(*settings); };
  return {command, run};
}

namespace {

constexpr const char* kCompareUsage =
    "Usage: pounce compare A B [--mask M] [--min-psnr DB] [--json]\n"
    "\n"
    "Examples:\n"
    "  # Compare a result with its truth where the truth's alpha is set.\n"
    "  pounce compare result.png truth.png\n"
    "\n"
    "  # In a script: exit status 1 unless at least 40 dB inside the mask.\n"
    "  pounce compare result.png truth.png --mask mask.png --min-psnr 40";

constexpr double kHighestThresholdDb = 1000;
constexpr int kBelowThreshold = 1;  // the exit status

struct CompareSettings {
  std::string a, b, mask;
  std::optional<double> min_psnr_db;
  bool json = false;
  TransferOptions reading;  ///< what files may be read
};

std::string comparison_text(const Comparison& result) {
  const std::string psnr = std::isinf(result.psnr_db) ? std::string("infinite (equal)")
                                                      : fmt::format("{:.2f} dB", result.psnr_db);
  return fmt::format(
      "similarity     {:.6f}\npsnr           {}\nlargest error  {:.6f} at ({}, {})\n"
      "compared       {} texels x {} channels\n",
      result.similarity, psnr, result.largest_error, result.largest_x, result.largest_y,
      with_commas(result.texels), result.channels);
}

std::string comparison_json(const Comparison& result, bool passed) {
  nlohmann::ordered_json json;
  json["similarity"] = result.similarity;
  // JSON has no infinity: equal images get null here, and "equal" says why.
  json["psnr_db"] = result.psnr_db;
  json["equal"] = std::isinf(result.psnr_db);
  json["largest_error"] = result.largest_error;
  json["largest_x"] = result.largest_x;
  json["largest_y"] = result.largest_y;
  json["texels"] = result.texels;
  json["channels"] = result.channels;
  json["passed"] = passed;
  return json.dump(2) + "\n";
}

int run_comparison(const CompareSettings& settings) {
  const Comparison result = compare(settings.a, settings.b, settings.mask, settings.reading.trust);
  const bool passed = !settings.min_psnr_db || result.psnr_db >= *settings.min_psnr_db;
  write_stdout(settings.json ? comparison_json(result, passed) : comparison_text(result));
  if (!passed) {
    write_stderr(fmt::format("pounce: {} and {}: {:.2f} dB, below the required {:g} dB\n",
                             visible_line(settings.a), visible_line(settings.b), result.psnr_db,
                             *settings.min_psnr_db));
  }
  return passed ? 0 : kBelowThreshold;
}

}  // namespace

Command add_compare_command(CLI::App& program) {
  const auto settings = std::make_shared<CompareSettings>();
  CLI::App* command = program.add_subcommand("compare", "Measure the similarity of two images");
  set_help_text(*command, kCompareUsage);
  command->add_option("A", settings->a, "Image")->option_text(" ")->required();
  command->add_option("B", settings->b, "Image of the same size")->option_text(" ")->required();
  add_value(*command, "--mask", "M", kGroup,
            "Compare where this image's first channel is not 0.\nDefault: B's alpha if present, "
            "else everywhere",
            [settings](const std::string& text) { settings->mask = parse_path("--mask", text); });
  add_value(*command, "--min-psnr", "DB", kGroup,
            "Exit with status 1 below this PSNR, 0 to 1000 dB",
            [settings](const std::string& text) {
              settings->min_psnr_db = parse_number("--min-psnr", text, 0, kHighestThresholdDb);
            });
  add_switch(*command, "--json", kGroup, "Print JSON instead of text", settings->json);
  add_trust_options(*command, settings->reading);
  return {command, [settings] { return run_comparison(*settings); }};
}

namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kCacheUsage =
    "Usage: pounce cache info|list|verify|prune|clear [options]\n"
    "\n"
    "The cache stores prepared meshes and images for reuse. Everything in it can be rebuilt. Jobs\n"
    "may run meanwhile: packs in use are never removed.\n"
    "\n"
    "Examples:\n"
    "  # How much space does it use, and what is its limit?\n"
    "  pounce cache info\n"
    "\n"
    "  # List its contents, least recently used first.\n"
    "  pounce cache list\n"
    "\n"
    "  # Verify every pack; remove damaged ones.\n"
    "  pounce cache verify --remove\n"
    "\n"
    "  # Keep what was used within 30 days, up to 10 GiB.\n"
    "  pounce cache prune --older-than 30d --to 10GiB";

struct CacheSettings {
  std::string folder;
  bool json = false;
  bool remove = false;
  std::optional<std::uint64_t> most_bytes;
  std::optional<double> older_than_s;
};

std::string json_text(const Json& json) {
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string when(double seconds_since_1970) {
  const auto seconds = static_cast<std::time_t>(seconds_since_1970);
  return fmt::format("{:%Y-%m-%d %H:%M}", fmt::localtime(seconds));
}

std::string count_text(std::uint64_t count, const char* what) {
  return fmt::format("{} {}{}", with_commas(count), what, count == 1 ? "" : "s");
}

int show_info(const CacheSettings& settings) {
  const CacheInfo info = cache_info(settings.folder);
  if (settings.json) {
    Json kinds = Json::object();
    for (const auto& [kind, share] : info.kinds) {
      kinds[kind] = {{"objects", share.objects}, {"bytes", share.bytes}};
    }
    write_stdout(
        json_text({{"folder", info.folder},
                   {"taken", info.taken_bytes},
                   {"default_limit", info.default_limit_bytes},
                   {"kinds", kinds},
                   {"unfinished",
                    {{"objects", info.unfinished.objects}, {"bytes", info.unfinished.bytes}}}}));
    return 0;
  }
  std::string text =
      fmt::format("folder      {}\nused        {}\n", info.folder, bytes_text(info.taken_bytes));
  text += info.default_limit_bytes == 0
              ? "limit       none\n"
              : fmt::format("limit       {}, a tenth of the disk, for jobs without --cache-limit\n",
                            bytes_text(info.default_limit_bytes));
  for (const auto& [kind, share] : info.kinds) {
    text += fmt::format("{:<11} {}, {}\n", kind, count_text(share.objects, "pack"),
                        bytes_text(share.bytes));
  }
  if (info.unfinished.objects > 0) {
    text += fmt::format("unfinished  {}, {}\n", count_text(info.unfinished.objects, "pack"),
                        bytes_text(info.unfinished.bytes));
  }
  write_stdout(text);
  return 0;
}

Json object_json(const CacheObject& object) {
  return {{"kind", object.kind},       {"key", object.key},
          {"size", object.size_bytes}, {"last_used", object.last_used_s},
          {"made_from", object.label}, {"path", object.path}};
}

int show_list(const CacheSettings& settings) {
  const std::vector<CacheObject> objects = cache_list(settings.folder);
  if (settings.json) {
    Json list = Json::array();
    for (const CacheObject& object : objects) list.push_back(object_json(object));
    write_stdout(json_text(list));
    return 0;
  }
  std::string text;
  for (const CacheObject& object : objects) {
    text += fmt::format("{:<9} {}  {:>10}  {}  {}\n", object.kind, object.key,
                        bytes_text(object.size_bytes), when(object.last_used_s), object.label);
  }
  write_stdout(text);
  return 0;
}

int show_verdict(const CacheSettings& settings) {
  const CacheVerdict verdict = cache_verify(settings.folder, settings.remove);
  if (settings.json) {
    Json damaged = Json::array();
    for (const CacheDamage& damage : verdict.damaged) {
      Json one = object_json(damage.object);
      one["what"] = damage.what;
      one["removed"] = damage.removed;
      damaged.push_back(std::move(one));
    }
    write_stdout(
        json_text({{"objects", verdict.objects}, {"bytes", verdict.bytes}, {"damaged", damaged}}));
  } else {
    std::string text;
    for (const CacheDamage& damage : verdict.damaged) {
      text += fmt::format("{}{}\n", damage.what, damage.removed ? " (removed)" : "");
    }
    text +=
        fmt::format("{}, {}: {}\n", count_text(verdict.objects, "pack"), bytes_text(verdict.bytes),
                    verdict.damaged.empty() ? "every checksum matches"
                                            : fmt::format("{} damaged", verdict.damaged.size()));
    write_stdout(text);
  }
  return verdict.damaged.empty() ? 0 : exit_status(ErrorKind::damaged_store);
}

int show_pruned(const CachePruned& pruned) {
  std::string text =
      fmt::format("removed {}, {}; the cache now uses {}\n", count_text(pruned.objects, "pack"),
                  bytes_text(pruned.bytes), bytes_text(pruned.taken_bytes));
  if (pruned.in_use > 0) {
    text += fmt::format(
        "{} kept: in use by a running job, owned by another user, or not to be removed\n",
        count_text(pruned.in_use, "pack"));
  }
  if (pruned.half_done > 0) {
    text += fmt::format("removed {} beside outputs, {}\n",
                        count_text(pruned.half_done, "half-done image"),
                        bytes_text(pruned.half_done_bytes));
  }
  write_stdout(text);
  return 0;
}

/// One of the five; --cache goes with each.
CLI::App* add_action(CLI::App& command, CacheSettings& settings, const char* name,
                     const char* help) {
  CLI::App* action = command.add_subcommand(name, help);
  add_transfer_row(*action, "cache", kGroup, [&settings](const std::string& text) {
    settings.folder = parse_path("--cache", text);
  });
  return action;
}

void add_json(CLI::App& action, CacheSettings& settings) {
  add_switch(action, "--json", kGroup,
             "Print JSON instead of text; sizes in bytes, times in seconds since 1970",
             settings.json);
}

}  // namespace

Command add_cache_command(CLI::App& program) {
  const auto settings = std::make_shared<CacheSettings>();
  CLI::App* command = program.add_subcommand("cache", "Show, verify and shrink the tile cache");
  command->require_subcommand(1);
  set_help_text(*command, kCacheUsage);
  CLI::App* info =
      add_action(*command, *settings, "info", "Show folder, size, limit and packs per kind");
  set_help_text(*info, "Usage: pounce cache info [--json] [--cache DIR]");
  add_json(*info, *settings);
  CLI::App* list = add_action(*command, *settings, "list",
                              "List packs: kind, key, size, last use, what they were built from");
  set_help_text(*list, "Usage: pounce cache list [--json] [--cache DIR]");
  add_json(*list, *settings);
  CLI::App* verify = add_action(*command, *settings, "verify",
                                "Read every byte of every pack; exit status 6 if one is damaged");
  set_help_text(*verify, "Usage: pounce cache verify [--remove] [--json] [--cache DIR]");
  add_json(*verify, *settings);
  add_switch(*verify, "--remove", kGroup,
             "Remove damaged packs; the next job that needs one rebuilds it", settings->remove);
  CLI::App* prune = add_action(*command, *settings, "prune",
                               "Remove packs, least recently used first, and remains of dead runs");
  set_help_text(
      *prune,
      "Usage: pounce cache prune [--to SIZE] [--older-than TIME] [--cache DIR]\n\nWith neither "
      "option: removes only unfinished packs of dead runs. With both: first packs\nunused for that "
      "long, then, if that is not enough, the least recently used ones.");
  add_value(
      *prune, "--to", "SIZE", kGroup, "Target size of the cache: 10GiB, 500MB",
      [settings](const std::string& text) { settings->most_bytes = parse_bytes("--to", text); });
  add_value(*prune, "--older-than", "TIME", kGroup,
            "Packs unused for this long: 30d, 12h, 90min, 45s",
            [settings](const std::string& text) {
              settings->older_than_s = parse_duration("--older-than", text);
            });
  CLI::App* clear = add_action(*command, *settings, "clear",
                               "Remove every pack that no running job uses, and cached hashes");
  set_help_text(*clear, "Usage: pounce cache clear [--cache DIR]");
  const auto run = [settings, info, list, verify, prune] {
    if (info->parsed()) return show_info(*settings);
    if (list->parsed()) return show_list(*settings);
    if (verify->parsed()) return show_verdict(*settings);
    if (prune->parsed()) {
      return show_pruned(
          cache_prune(settings->folder, settings->most_bytes, settings->older_than_s));
    }
    return show_pruned(cache_clear(settings->folder));
  };
  return {command, run};
}

}  // namespace pounce::cli
