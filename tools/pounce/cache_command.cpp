// SPDX-License-Identifier: Apache-2.0
#include <fmt/chrono.h>
#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "arguments.h"
#include "commands.h"
#include "pounce/cache.h"
#include "shared_options.h"
#include "summary.h"

namespace pounce::cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kUsage =
    "Usage: pounce cache info|list|verify|prune|clear [options]\n"
    "\n"
    "A mesh or an image that was prepared once waits here for the next run. Everything in it can\n"
    "be made again; jobs may run meanwhile, and what they use stays.\n"
    "\n"
    "Examples:\n"
    "  # How much room does it take, and how much may it take?\n"
    "  pounce cache info\n"
    "\n"
    "  # What is in it, longest unused first?\n"
    "  pounce cache list\n"
    "\n"
    "  # Is all of it as it was written? Remove what is not.\n"
    "  pounce cache verify --remove\n"
    "\n"
    "  # Keep what was used within 30 days, and no more than 10 GiB of that.\n"
    "  pounce cache prune --older-than 30d --to 10GiB";

constexpr const char* kGroup = "Options";

struct Settings {
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

int show_info(const Settings& settings) {
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
      fmt::format("folder      {}\ntaken       {}\n", info.folder, bytes_text(info.taken_bytes));
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

int show_list(const Settings& settings) {
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

int show_verdict(const Settings& settings) {
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
      fmt::format("removed {}, {}; the cache takes {} now\n", count_text(pruned.objects, "pack"),
                  bytes_text(pruned.bytes), bytes_text(pruned.taken_bytes));
  if (pruned.in_use > 0) {
    text += fmt::format("{} stayed: in use by a running job, or another user's\n",
                        count_text(pruned.in_use, "pack"));
  }
  write_stdout(text);
  return 0;
}

/// One of the five; --cache goes with each.
CLI::App* add_action(CLI::App& command, Settings& settings, const char* name, const char* help) {
  CLI::App* action = command.add_subcommand(name, help);
  add_value(
      *action, "--cache", "DIR", kGroup,
      "Folder of the cache. Default: $XDG_CACHE_HOME/pounce, else\n"
      "~/.cache/pounce",
      [&settings](const std::string& text) { settings.folder = parse_path("--cache", text); });
  return action;
}

void add_json(CLI::App& action, Settings& settings) {
  add_switch(action, "--json", kGroup,
             "As JSON instead of text; sizes in bytes, times in seconds since 1970", settings.json);
}

}  // namespace

Command add_cache_command(CLI::App& program) {
  const auto settings = std::make_shared<Settings>();
  CLI::App* command =
      program.add_subcommand("cache", "Look at the tile cache, check it, make room");
  command->require_subcommand(1);
  set_help_text(*command, kUsage);
  CLI::App* info = add_action(*command, *settings, "info", "Folder, size, limit, packs per kind");
  set_help_text(*info, "Usage: pounce cache info [--json] [--cache DIR]");
  add_json(*info, *settings);
  CLI::App* list = add_action(*command, *settings, "list",
                              "Each pack: kind, key, size, last use, what it was made from");
  set_help_text(*list, "Usage: pounce cache list [--json] [--cache DIR]");
  add_json(*list, *settings);
  CLI::App* verify = add_action(*command, *settings, "verify",
                                "Read every byte of every pack; exit status 6 if one is damaged");
  set_help_text(*verify, "Usage: pounce cache verify [--remove] [--json] [--cache DIR]");
  add_json(*verify, *settings);
  add_switch(*verify, "--remove", kGroup,
             "Remove damaged packs; the next job that needs one makes it again", settings->remove);
  CLI::App* prune = add_action(*command, *settings, "prune",
                               "Remove packs, longest unused first, and what dead runs left");
  set_help_text(
      *prune,
      "Usage: pounce cache prune [--to SIZE] [--older-than TIME] [--cache DIR]\n\n"
      "With neither option: removes only what dead runs left half-built. With both: first\n"
      "what was not used for so long, then, if that is not enough, longest unused first.");
  add_value(
      *prune, "--to", "SIZE", kGroup, "Until the cache takes no more than this: 10GiB, 500MB",
      [settings](const std::string& text) { settings->most_bytes = parse_bytes("--to", text); });
  add_value(*prune, "--older-than", "TIME", kGroup,
            "Those not used for so long: 30d, 12h, 90min, 45s",
            [settings](const std::string& text) {
              settings->older_than_s = parse_duration("--older-than", text);
            });
  CLI::App* clear = add_action(*command, *settings, "clear",
                               "Remove every pack that no running job uses, and remembered hashes");
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
