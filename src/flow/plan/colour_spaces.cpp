// SPDX-License-Identifier: Apache-2.0
//
// Colours keep their space as far as the output's format can hold it: EXR holds linear light of any
// primaries, the others sRGB's coding of any, with a profile that says so. What is linear light of
// other primaries becomes sRGB where it is to be coded: as 8 or 16 bits nobody expects it.
#include "flow/plan/colour_spaces.h"

#include <fmt/format.h>

#include <algorithm>

#include "flow/plan/map_kind.h"
#include "io/files/file_ending.h"
#include "io/image/write.h"
#include "io/model/write.h"

namespace pounce::flow {
namespace {

bool is_exr(const std::string& path) { return io::lower_ending(path) == ".exr"; }

ColourSpace known_space(const char* option, const std::string& name) {
  if (const auto space = colour_space_from_name(name)) return *space;
  throw Error(ErrorKind::usage, fmt::format("{} {}: this colour space is not known; known are {}",
                                            option, name, colour_space_names()));
}

std::optional<ColourSpace> asked_space(const TransferOptions& options) {
  if (options.output_colour_space.empty()) return std::nullopt;
  return known_space("--output-colorspace", options.output_colour_space);
}

}  // namespace

void check_colour_spaces(const TransferOptions& options) {
  std::vector<std::string> given;
  for (const SourceColourSpace& source : options.source_colour_spaces) {
    known_space("--source-colorspace", source.space);
    const std::string channel =
        source.channel ? channel_name(options, *source.channel) : "all channels";
    if (source.channel && !is_colour(options, *source.channel)) {
      throw Error(ErrorKind::usage,
                  fmt::format("--source-colorspace {}={}: {} is data and never converted", channel,
                              source.space, channel));
    }
    if (std::find(given.begin(), given.end(), channel) != given.end())
      throw Error(ErrorKind::usage,
                  fmt::format("--source-colorspace: given twice for {}", channel));
    given.push_back(channel);
  }
  const auto asked = asked_space(options);
  if (!asked) return;
  if (!options.onto.empty()) {
    throw Error(ErrorKind::usage,
                "--output-colorspace: an image that is painted onto keeps its own; leave it out");
  }
  if (is_exr(options.output) && !asked->linear) {
    throw Error(ErrorKind::usage,
                fmt::format("--output-colorspace {}: EXR holds linear light; choose lin_rec709, "
                            "acescg or aces2065-1, or another format",
                            options.output_colour_space));
  }
  if (io::is_model_path(options.output) &&
      (asked->linear || !same_primaries(asked->primaries, kRec709))) {
    throw Error(ErrorKind::usage,
                fmt::format("--output-colorspace {}: the textures of glTF are srgb; write images",
                            options.output_colour_space));
  }
}

std::optional<ColourSpace> given_space(const TransferOptions& options, Channel channel) {
  std::optional<ColourSpace> found;
  if (!is_colour(options, channel)) return found;
  for (const SourceColourSpace& given : options.source_colour_spaces) {
    if (given.channel ? *given.channel == channel : !found)
      found = known_space("--source-colorspace", given.space);
  }
  return found;
}

ColourSpace space_of(const TransferOptions& options, Channel channel, const ColumnPlan& column) {
  if (!is_colour(options, channel)) return {kRec709, column.info.linear};
  if (const auto given = given_space(options, channel)) return *given;
  return column.heeds_tags ? column.info.space() : ColourSpace{kRec709, column.info.linear};
}

void choose_space(const TransferOptions& options, const SourceLook& look,
                  const std::optional<io::ImageInfo>& onto, ChannelPlan& plan,
                  std::vector<std::string>& notes) {
  const bool float_out = plan.format.depth == Depth::half || plan.format.depth == Depth::float32;
  // EXR is linear; float TIFF keeps linear input linear; everything else is sRGB-coded.
  plan.format.linear =
      is_exr(options.output) || (float_out && (onto ? onto->space().linear : look.linear));
  if (!plan.format.is_colour) return;
  const auto asked = asked_space(options);
  const ColourSpace source{look.chromaticities.value_or(kRec709), look.linear};
  if (onto) {
    plan.primaries = onto->space().primaries;
    plan.format.linear = plan.format.linear || onto->space().linear;
  } else if (asked) {
    plan.primaries = asked->primaries;
    plan.format.linear = asked->linear;
  } else if (!io::is_model_path(options.output) && (plan.format.linear || !source.linear)) {
    plan.primaries = source.primaries;
  }
  const ColourSpace made{plan.primaries, plan.format.linear};
  const bool is_plain = same_primaries(made.primaries, kRec709) && (!made.linear || float_out);
  const bool is_said = onto ? onto->colours.primaries.has_value() : look.chromaticities.has_value();
  if (!is_plain || (is_exr(options.output) && is_said)) plan.chromaticities = made.primaries;
  const bool has_images = look.size.width > 0;
  if (has_images &&
      (source.linear != made.linear || !same_primaries(source.primaries, made.primaries))) {
    notes.push_back(fmt::format("{} is converted from {} to {}", plan.name,
                                colour_space_name(source), colour_space_name(made)));
  }
}

std::optional<texture::ColourInput> colour_input(const ColourSpace& space, bool usual_linear,
                                                 const ChannelPlan& plan) {
  if (!plan.format.is_colour) return std::nullopt;
  const bool same = same_primaries(space.primaries, plan.primaries);
  if (same && space.linear == usual_linear) return std::nullopt;
  texture::ColourInput input{space.linear, std::nullopt};
  if (!same) input.primaries = primaries_matrix(space.primaries, plan.primaries);
  return input;
}

}  // namespace pounce::flow
