// SPDX-License-Identifier: Apache-2.0
//
// The report as JSON, field by field as docs/report.md tells it. That page is a promise to scripts:
// keys that it names stay, and where there is nothing to say the key is there with null or nothing
// in it. So values are copied one by one: a member renamed in C++ renames no key.
//
// A failed job has a report, too, with whatever was known when it failed; so no function here may
// rely on a stage having run.
#include "pounce/report.h"

#include <nlohmann/json.hpp>

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

/// null for a job that succeeded, so that a script asks one key.
Json failure_json(const Report& report) {
  if (!report.failure) return nullptr;
  return {{"kind", report.failure->kind},
          {"exit_status", report.failure->exit_status},
          {"message", report.failure->message}};
}

/// As they were given, each as a text or, where an option may come several times, a list of texts.
Json options_json(const Report& report) {
  Json options = Json::object();
  for (const OptionReport& option : report.options) {
    if (option.is_list) {
      options[option.name] = option.values;
    } else {
      options[option.name] = option.values.front();
    }
  }
  return options;
}

/// Texels of an image, a target or a channel: the same four keys everywhere.
void add_counts(const TexelCounts& counts, Json& json) {
  json["texels"] = counts.texels;
  json["covered"] = counts.covered;
  json["empty"] = counts.empty;
  json["filled"] = counts.filled;
}

Json image_json(const ImageReport& image) {
  Json json;
  json["path"] = image.path;
  json["channel"] = image.channel;
  json["material"] = image.material;
  json["udim"] = image.udim == 0 ? Json(nullptr) : Json(image.udim);
  json["width"] = image.width;
  json["height"] = image.height;
  json["state"] = image.state;
  add_counts(image.counts, json);
  return json;
}

/// Nodes of the graph: which of them the others waited for, and what for (works, memory).
Json nodes_json(const Report& report) {
  Json nodes = Json::array();
  for (const NodeReport& node : report.nodes) {
    nodes.push_back({{"name", node.name},
                     {"runs", node.runs},
                     {"most_waiting", node.most_waiting},
                     {"busy_s", node.busy_s},
                     {"stalls", node.stalls},
                     {"stalled_s", node.stalled_s},
                     {"bytes", node.bytes}});
  }
  return nodes;
}

Json targets_json(const Report& report) {
  Json targets = Json::array();
  for (const TargetReport& target : report.targets) {
    Json json;
    json["path"] = target.path;
    add_counts(target.counts, json);
    json["overlapping"] = target.overlapping;
    json["fill"] = target.fill;
    // null is "not measured"; 0 would be a measure.
    json["texel_size"] = target.texel_size ? Json(*target.texel_size) : Json(nullptr);
    json["enough"] = target.enough;
    json["max_distance"] = target.max_distance;
    json["distances"] = target.distances;
    json["mean_distance"] = target.mean_distance ? Json(*target.mean_distance) : Json(nullptr);
    json["close_layers"] = target.close_layers ? Json(*target.close_layers) : Json(nullptr);
    json["fit"] = target.fit ? Json(*target.fit) : Json(nullptr);
    json["scene_offset"] = target.fit ? Json(target.scene_offset) : Json(nullptr);
    json["scene_spread"] = target.fit ? Json(target.scene_spread) : Json(nullptr);
    json["images"] = Json::array();
    for (const ImageReport& image : target.images) json["images"].push_back(image_json(image));
    targets.push_back(std::move(json));
  }
  return targets;
}

/// Of all targets together; each target's images have their own counts.
Json channels_json(const Report& report) {
  Json channels = Json::array();
  for (const ChannelReport& channel : report.channels) {
    Json json;
    json["name"] = channel.name;
    json["images"] = channel.images;
    add_counts(channel.counts, json);
    channels.push_back(std::move(json));
  }
  return channels;
}

/// Bounds, known before anything was written; what was used stands under "bytes".
Json disk_json(const Report& report) {
  if (!report.disk_most) return nullptr;
  return {{"scratch", report.disk_most->scratch_bytes},
          {"cache", report.disk_most->cache_bytes},
          {"outputs", report.disk_most->output_bytes},
          {"scratch_limit", report.disk_most->scratch_limit_bytes}};
}

}  // namespace

// What the user asked to leave out first, what is broken last: summaries list them in this order.
std::span<const LeftOutReason> left_out_reasons() {
  static constexpr std::array<LeftOutReason, 11> kReasons{{
      {"outside_box", "outside of --box"},
      {"faint", "below --min-opacity"},
      {"too_large", "above --max-scale"},
      {"out_of_reach", "farther from the target than the search distance (--near-target)"},
      {"less_important", "beyond --count"},
      {"transparent", "transparent"},
      {"far", "far from the rest of the scene"},
      {"exploded", "larger than the whole scene"},
      {"sizeless", "with zero size"},
      {"zero_quaternion", "without a rotation"},
      {"not_finite", "not finite"},
  }};
  return kReasons;
}

std::string to_json(const Report& report) {
  Json json;
  json["version"] = report.version;
  json["command"] = report.command;
  json["failure"] = failure_json(report);
  json["inputs"] = report.inputs;
  json["options"] = options_json(report);
  json["isa"] = report.isa;
  json["threads"] = report.threads;
  json["stages"] = stages_json(report);
  json["nodes"] = nodes_json(report);
  Json filtered = Json::object();  // {} and not null where nothing was left out
  for (const auto& [reason, count] : report.source_filtered) filtered[reason] = count;
  json["method"] = report.method;
  json["filter"] = report.filter;
  json["origin"] = report.origin;
  json["source"] = {{"gaussians", report.source_gaussians},
                    {"filtered", filtered},
                    {"sigma", report.sigma_texels},
                    {"densify", report.densify},
                    {"depth_window", report.depth_window},
                    {"discness", report.discness},
                    {"views", report.views},
                    {"gaussian_size", report.gaussian_size},
                    {"images_decoded", report.images_decoded}};
  json["target"] = {{"texels", report.target_texels},
                    {"covered", report.target_covered},
                    {"filled", report.target_filled},
                    {"empty", report.target_empty},
                    {"overlapping", report.target_overlapping},
                    {"clipped", report.target_clipped},
                    {"udims", report.udims}};
  json["targets"] = targets_json(report);
  json["channels"] = channels_json(report);
  json["tiles"] = {{"source", report.source_tiles},
                   {"target", report.target_tiles},
                   {"read", report.tiles_read},
                   {"written", report.tiles_written}};
  json["bytes"] = {{"read", report.bytes_read},
                   {"written", report.bytes_written},
                   {"temp_peak", report.temp_peak_bytes},
                   {"source_store", report.source_store_bytes},
                   {"target_store", report.target_store_bytes},
                   {"outputs", report.output_bytes}};
  json["disk_most"] = disk_json(report);
  json["memory"] = {{"budget", report.memory_budget_bytes},
                    {"leased_peak", report.leased_peak_bytes},
                    {"peak_rss", report.peak_rss_bytes},
                    {"least", report.least_memory_bytes},
                    {"least_for", report.least_memory_for},
                    {"beside", report.memory_beside_bytes},
                    {"least_process", report.least_memory_bytes + report.memory_beside_bytes}};
  json["warnings"] = report.warnings;
  json["notes"] = report.notes;
  json["outputs"] = report.outputs;
  json["kept"] = report.kept;
  for (const HalfDoneImage& image : report.half_done) {
    json["half_done"].push_back({{"path", image.path},
                                 {"blocks", image.blocks},
                                 {"texels", image.texels},
                                 {"of_texels", image.of_texels},
                                 {"worked_s", image.worked_s},
                                 {"left_s", image.left_s}});
  }
  for (const MissingImage& image : report.missing) {
    json["missing"].push_back({{"path", image.path},
                               {"texels", image.texels},
                               {"of_texels", image.of_texels},
                               {"tasks", image.tasks}});
  }
  if (report.work_s > 0) json["work_s"] = report.work_s;
  // A file name need not be UTF-8; JSON must be.
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace pounce
