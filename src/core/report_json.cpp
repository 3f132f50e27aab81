// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include "pounce/report.h"

namespace pounce {
namespace {

using Json = nlohmann::ordered_json;  // keys in the order of docs/report.md

Json stages_json(const Report& report) {
  Json stages = Json::array();
  for (const StageTime& stage : report.stages) {
    stages.push_back({{"name", stage.name},
                      {"wall_s", stage.wall_s},
                      {"cpu_s", stage.cpu_s},
                      {"cached", stage.cached}});
  }
  return stages;
}

}  // namespace

std::string to_json(const Report& report) {
  Json json;
  json["version"] = report.version;
  json["command"] = report.command;
  json["isa"] = report.isa;
  json["threads"] = report.threads;
  json["stages"] = stages_json(report);
  Json filtered = Json::object();  // {} and not null where nothing was left out
  for (const auto& [reason, count] : report.source_filtered) filtered[reason] = count;
  json["source"] = {{"gaussians", report.source_gaussians},
                    {"filtered", filtered},
                    {"depth_window", report.depth_window},
                    {"images_decoded", report.images_decoded}};
  json["target"] = {{"texels", report.target_texels},           {"covered", report.target_covered},
                    {"filled", report.target_filled},           {"empty", report.target_empty},
                    {"overlapping", report.target_overlapping}, {"udims", report.udims}};
  json["tiles"] = {{"source", report.source_tiles},
                   {"target", report.target_tiles},
                   {"read", report.tiles_read},
                   {"written", report.tiles_written}};
  json["bytes"] = {{"read", report.bytes_read},
                   {"written", report.bytes_written},
                   {"temp_peak", report.temp_peak_bytes},
                   {"source_store", report.source_store_bytes},
                   {"target_store", report.target_store_bytes}};
  json["memory"] = {{"budget", report.memory_budget_bytes},
                    {"leased_peak", report.leased_peak_bytes},
                    {"peak_rss", report.peak_rss_bytes},
                    {"least", report.least_memory_bytes}};
  json["warnings"] = report.warnings;
  json["outputs"] = report.outputs;
  json["kept"] = report.kept;
  // A file name need not be UTF-8; JSON must be.
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace pounce
