// SPDX-License-Identifier: Apache-2.0
//
// What a job was asked to do, for its report: options that differ from their defaults, by the names
// that they have on the command line.
#include "flow/plan/describe_job.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

namespace pounce::flow {
namespace {

std::string text_of(ImageSize size) { return fmt::format("{}x{}", size.width, size.height); }

std::string text_of(const Length& length) {
  return fmt::format("{}{}", length.value, length.is_percent ? "%" : "");
}

class OptionList {
 public:
  explicit OptionList(Report& report) : options_(report.options) {}

  void add(const std::string& name, const std::string& value) {
    if (!value.empty()) options_.push_back({name, {value}, false});
  }
  void add(const std::string& name, const std::vector<std::string>& values) {
    if (!values.empty()) options_.push_back({name, values, true});
  }
  void add(const std::string& name, bool given) {
    if (given) options_.push_back({name, {"true"}, false});
  }
  void add_limit(const std::string& name, const std::optional<std::uint64_t>& bytes) {
    if (bytes) add(name, *bytes == 0 ? std::string("none") : std::to_string(*bytes));
  }
  void add_maps(const TransferOptions& o) {
    std::vector<std::string> values, data, colours;
    for (const SourceTexture& texture : o.material.textures)
      values.push_back(fmt::format("{}={}", channel_name(o, texture.channel), texture.path));
    add("source-texture", values);
    for (const OtherMap& map : o.channels.other_maps) {
      if (map.is_colour) (*map.is_colour ? colours : data).push_back(map.name);
    }
    add("data", data);
    add("color", colours);
  }
  void add(const TransferOptions& o, const std::vector<SourceColourSpace>& spaces) {
    std::vector<std::string> values;
    for (const SourceColourSpace& given : spaces) {
      values.push_back((given.channel ? channel_name(o, *given.channel) + "=" : "") + given.space);
    }
    add("source-colorspace", values);
  }
  void add(const std::string& side, const MeshUse& use) {
    add(side + "-mesh", use.meshes);
    add(side + "-material", use.materials);
    add(side + "-uv-set", use.uv_set ? std::to_string(*use.uv_set) : std::string());
    add(side + "-axes", use.axes);
  }
  void add_splats(const TransferOptions& o) {
    const bool other_harmonics = o.splats.harmonics != SplatOptions{}.harmonics;
    add("sh", other_harmonics ? std::string(harmonics_name(o.splats.harmonics)) : "");
    add_filters(o.splats.filter);
    add("rays", o.splats.rays != 0 ? std::to_string(o.splats.rays) : std::string());
    add("alpha", o.splats.alpha);
    const bool other_confidence = o.splats.min_confidence != SplatOptions{}.min_confidence;
    add("min-confidence", other_confidence ? fmt::format("{}", o.splats.min_confidence) : "");
    add("near-target", o.splats.everywhere    ? std::string("off")
                       : o.splats.near_target ? text_of(*o.splats.near_target)
                                              : std::string());
  }
  void add_filters(const SplatFilter& o) {
    const bool leaves_out = o.min_opacity && *o.min_opacity > kDefaultMinOpacity;
    add("min-opacity", leaves_out ? fmt::format("{}", *o.min_opacity) : "");
    add("max-scale", o.max_scale ? fmt::format("{}", *o.max_scale) : "");
    if (o.box) {
      add("box",
          fmt::format("{},{}", fmt::join(o.box->lowest, ","), fmt::join(o.box->highest, ",")));
    }
  }
  void add(const Resources& r) {
    add("memory", r.memory_bytes != 0 ? std::to_string(r.memory_bytes) : std::string());
    add("threads", r.threads != 0 ? std::to_string(r.threads) : std::string());
    add("cache", r.cache_dir);
    add("no-cache", !r.use_cache);
    add_limit("cache-limit", r.cache_limit_bytes);
    add("no-wait", !r.wait_for_cache);
    add("temp", r.temp_dir);
    add_limit("max-temp", r.max_temp_bytes);
  }

 private:
  std::vector<OptionReport>& options_;
};

std::vector<std::string> outputs_of(const TransferOptions& o) {
  std::vector<std::string> outputs;
  for (const ChannelOutput& own : o.image.channel_outputs)
    outputs.push_back(channel_name(o, own.channel) + "=" + own.path);
  return outputs;
}

std::vector<std::string> names_of(const TransferOptions& o, const std::vector<Channel>& channels) {
  std::vector<std::string> names;
  for (const Channel channel : channels) names.push_back(channel_name(o, channel));
  return names;
}

std::string factors_text(const TransferOptions& o) {
  if (o.material.apply_factors) return o.material.apply_vertex_colours ? "" : "factors";
  return o.material.apply_vertex_colours ? "vertices" : "ignore";
}

std::vector<std::string> format_names(const std::vector<ImageFormat>& formats) {
  std::vector<std::string> names;
  for (const ImageFormat format : formats) names.push_back(image_format_name(format));
  return names;
}

std::vector<std::string> texts_of(const std::vector<std::uint32_t>& numbers) {
  std::vector<std::string> texts;
  for (const std::uint32_t number : numbers) texts.push_back(std::to_string(number));
  return texts;
}

}  // namespace

void describe(const TransferOptions& o, bool plan_only, Report& report) {
  const TransferOptions usual;
  report.command = "transfer";
  report.method = method_name(o.mesh.method);
  add_input(o.source, report);
  for (const std::string& target : o.targets) add_input(target, report);
  OptionList list(report);
  list.add("output", o.output);
  list.add("output-for", outputs_of(o));
  list.add("coverage", o.image.coverage_output);
  list.add("tiles", texts_of(o.image.tiles));
  list.add("size", o.image.size ? text_of(*o.image.size) : std::string());
  list.add("depth", o.image.depth ? std::string(depth_name(*o.image.depth)) : std::string());
  list.add("exr-compression", o.image.exr_compression == "zip" ? "" : o.image.exr_compression);
  list.add("tile-size", o.image.tile_size != 0 ? std::to_string(o.image.tile_size) : std::string());
  list.add("mipmap", o.image.mipmap);
  list.add("drop-alpha", o.image.drop_alpha);
  list.add("padding", o.image.padding_px ? std::to_string(*o.image.padding_px) : std::string());
  list.add("skip-existing", o.skip_existing);
  list.add("min-coverage",
           o.min_coverage_percent > 0 ? fmt::format("{}", o.min_coverage_percent) : "");
  list.add("onto", o.composite.onto);
  list.add("mask", o.composite.mask);
  list.add("channels",
           o.channels.all ? std::vector<std::string>{"all"} : names_of(o, o.channels.transferred));
  list.add("bake", names_of(o, o.channels.baked));
  list.add("normal-y", o.material.normal_y != usual.material.normal_y
                           ? std::string(normal_y_name(o.material.normal_y))
                           : "");
  list.add("output-normal-y", o.image.normal_y != usual.image.normal_y
                                  ? std::string(normal_y_name(o.image.normal_y))
                                  : "");
  list.add_maps(o);
  list.add(o, o.colour.source_spaces);
  list.add("output-colorspace", o.image.colour_space);
  list.add("ocio", o.colour.config);
  list.add("factors", factors_text(o));
  list.add("source", o.source_use);
  list.add("target", o.target_use);
  list.add("method",
           o.mesh.method != usual.mesh.method ? std::string(method_name(o.mesh.method)) : "");
  list.add("filter", o.mesh.filter.value_or(kDefaultFilter) != kDefaultFilter
                         ? std::string(filter_name(*o.mesh.filter))
                         : std::string());
  list.add("sigma", o.mesh.sigma_texels.value_or(kDefaultSigma) != kDefaultSigma
                        ? fmt::format("{}", *o.mesh.sigma_texels)
                        : std::string());
  list.add("densify", o.mesh.densify);
  list.add("max-distance", o.search.max_distance ? text_of(*o.search.max_distance) : std::string());
  list.add("max-angle", o.search.max_angle_deg != usual.search.max_angle_deg
                            ? fmt::format("{}", o.search.max_angle_deg)
                            : "");
  list.add_splats(o);
  list.add("allow-external", o.allow_external);
  list.add("allow-format", format_names(o.allowed_formats));
  list.add(o.resources);
  list.add("plan", plan_only);
}

void describe(const MapsOptions& o, Report& report) {
  report.command = "maps";
  add_input(o.target, report);
  OptionList list(report);
  list.add("output", o.output);
  list.add("size", text_of(o.size));
  list.add("target", o.target_use);
  list.add("allow-external", o.allow_external);
  list.add(o.resources);
}

void describe(const GaussiansOptions& o, Report& report) {
  report.command = "gaussians";
  add_input(o.source, report);
  OptionList list(report);
  list.add("output", o.output);
  list.add("source-axes", o.axes);
  std::vector<std::string> textures;
  for (const SourceTexture& texture : o.source_textures)
    textures.push_back(fmt::format("{}={}", channel_name(texture.channel), texture.path));
  list.add("source-texture", textures);
  list.add({}, o.colour.source_spaces);
  list.add("ocio", o.colour.config);
  list.add("sigma", o.sigma_texels.value_or(kDefaultSigma) != kDefaultSigma
                        ? fmt::format("{}", *o.sigma_texels)
                        : std::string());
  list.add("sharpen", o.sharpen > 0 ? fmt::format("{}", o.sharpen) : std::string());
  list.add_filters(o.filter);
  list.add("count", o.count ? std::to_string(*o.count) : std::string());
  list.add("allow-external", o.allow_external);
  list.add("allow-format", format_names(o.allowed_formats));
  list.add(o.resources);
}

void add_input(const std::string& path, Report& report) {
  std::vector<std::string>& inputs = report.inputs;
  if (!path.empty() && std::find(inputs.begin(), inputs.end(), path) == inputs.end())
    inputs.push_back(path);
}

}  // namespace pounce::flow
