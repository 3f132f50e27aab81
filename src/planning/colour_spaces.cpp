// SPDX-License-Identifier: Apache-2.0
//
// Colours keep their space as far as the output's format can hold it: EXR holds linear light of any
// primaries, the others sRGB's coding of any, with a profile that says so. What is linear light of
// other primaries becomes sRGB where it is to be coded: as 8 or 16 bits nobody expects it.
//
// Spaces of a configuration come in as linear light of Rec. 709, before factors, and go out as the
// last thing of all. In between everything is as without it.
//
// There are two kinds of spaces here. Built-in ones are primaries and one of two curves, and
// convert by matrices with the same bits everywhere (docs/decisions/030-colour-spaces.md). Those of
// an OpenColorIO configuration are names, opaque to all but io::ColourConfig, and come as
// transforms to and from linear light (docs/decisions/036-colour-configurations.md). A name that
// both know is ours.
//
// Nothing is converted that need not be: `input` is nothing where samples mean what is usual for
// their depth and have the output's primaries. Such texels keep their bits.
#include "planning/colour_spaces.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "core/colour_space.h"
#include "io/image/write.h"
#include "io/model/model_writer.h"
#include "job/run_job.h"
#include "planning/name_patterns.h"
#include "planning/texture_meaning.h"
#include "store/blocks/colour_store.h"

namespace pounce::planning {
namespace {

/// Tables that take no more are loaded even if the budget is smaller: then it is said exactly how
/// much the job needs.
constexpr std::uint64_t kLookAnyway = 64ULL << 20;

/// EXR holds linear light, whatever is asked for.
void check_exr_space(const TransferOptions& options, const ColourSpace& asked) {
  if (asked.linear) return;
  throw Error(ErrorKind::usage, fmt::format("--output-colorspace {}: EXR is linear; choose "
                                            "lin_rec709, acescg or aces2065-1, or another format",
                                            options.image.colour_space));
}

void check_output_space(const TransferOptions& options, const ColourSpace& asked) {
  if (!options.composite.onto.empty()) {
    throw Error(ErrorKind::usage,
                "--output-colorspace: an image that is painted over keeps its own colour space; "
                "remove this option");
  }
  if (io::is_exr(options.output, options.image.depth.value_or(Depth::u8)))
    check_exr_space(options, asked);
  const bool is_srgb =
      asked.config_name.empty() && !asked.linear && same_primaries(asked.primaries, kRec709);
  if (io::is_model_path(options.output) && !is_srgb) {
    throw Error(ErrorKind::usage,
                fmt::format("--output-colorspace {}: glTF textures are always srgb; write images",
                            options.image.colour_space));
  }
}

/// No file says that it holds a space of a configuration, so none is made by the way.
void check_kept(const TransferOptions& options, const ColourSpace& source) {
  const bool is_said = !options.image.colour_space.empty() || !options.composite.onto.empty() ||
                       io::is_model_path(options.output);
  if (source.config_name.empty() || is_said) return;
  throw Error(ErrorKind::usage,
              fmt::format("--source-colorspace {0}: an output file cannot state a colour space of "
                          "{1}; add --output-colorspace, such as srgb, lin_rec709 or {0}",
                          source.config_name, options.colour.config));
}

/// The first of them, for messages.
std::string some_of(const std::vector<std::string>& names) {
  constexpr std::size_t kShown = 24;
  const auto end = names.begin() + static_cast<std::ptrdiff_t>(std::min(names.size(), kShown));
  std::string text = fmt::format("{}", fmt::join(names.begin(), end, ", "));
  if (names.size() > kShown) text += fmt::format(" and {} more", names.size() - kShown);
  return text;
}

}  // namespace

void check_colour_spaces(const TransferOptions& options) {
  // Reads the configuration, although planning reads it again: names that are wrong are told before
  // a mesh is read, which may take long.
  const ColourSpaces spaces(options, io::is_model_path(options.output));
  std::vector<std::string> given;
  for (const SourceColourSpace& source : options.colour.source_spaces) {
    const std::string channel =
        source.channel ? channel_name(options, *source.channel) : "all channels";
    if (source.channel && !is_colour(options, *source.channel)) {
      throw Error(ErrorKind::usage,
                  fmt::format("--source-colorspace {}={}: {} is data and is never converted",
                              channel, source.space, channel));
    }
    if (std::find(given.begin(), given.end(), channel) != given.end())
      throw Error(ErrorKind::usage,
                  fmt::format("--source-colorspace: specified twice for {}", channel));
    given.push_back(channel);
  }
  if (spaces.asked()) check_output_space(options, *spaces.asked());
  for (const ColourSpace& space : spaces.given()) check_kept(options, space);
}

// --- names ---------------------------------------------------------------------------------------

ColourSpaces::ColourSpaces(const TransferOptions& options, bool for_model)
    : options_(options), for_model_(for_model) {
  if (!options.colour.config.empty()) {
    if (options.colour.source_spaces.empty() && options.image.colour_space.empty()) {
      throw Error(ErrorKind::usage,
                  fmt::format("--ocio {}: none of its colour spaces is used; select one with "
                              "--source-colorspace or --output-colorspace",
                              options.colour.config));
    }
    config_ = io::ColourConfig::load(options.colour.config, options.allow_external,
                                     std::max(job::budget_bytes(options.resources), kLookAnyway));
  }
  for (const SourceColourSpace& given : options.colour.source_spaces)
    given_.push_back(resolved("--source-colorspace", given.space));
  if (!options.image.colour_space.empty())
    asked_ = resolved("--output-colorspace", options.image.colour_space);
}

ColourSpace ColourSpaces::resolved(const char* option, const std::string& name) const {
  if (const auto own = colour_space_from_name(name)) {
    // Scripts must give the same bytes with and without --ocio, so a built-in name keeps its
    // meaning. Where the configuration means something else by it, silence would be worse than an
    // error.
    if (config_ != nullptr && config_->has(name)) refuse_other_meaning(option, name, *own);
    return *own;
  }
  if (config_ == nullptr) {
    throw Error(ErrorKind::usage, fmt::format("{} {}: unknown colour space; choose {}, or one of "
                                              "an OpenColorIO configuration with --ocio CONFIG",
                                              option, name, colour_space_names()));
  }
  if (!config_->has(name)) {
    throw Error(
        ErrorKind::usage,
        fmt::format("{} {}: {} has no such colour space; it has {}; built in are {}", option, name,
                    config_->path(), some_of(config_->names()), colour_space_names()));
  }
  if (config_->is_data(name)) {
    throw Error(ErrorKind::usage,
                fmt::format("{} {}: {} declares this space as data, which is never converted; "
                            "remove it, or mark the map with --data",
                            option, name, config_->path()));
  }
  return {kRec709, true, config_->full_name(name)};
}

/// Our names are ours, exact and the same everywhere; who means something else by them must hear.
void ColourSpaces::refuse_other_meaning(const char* option, const std::string& name,
                                        const ColourSpace& own) const {
  // Compared by what the two make of a few colours, since a configuration has no formula to
  // compare.
  constexpr double kAlike = 0.002;
  constexpr std::array<std::array<double, 3>, 4> kColours{
      {{0.18, 0.18, 0.18}, {0.6, 0.3, 0.2}, {0.2, 0.5, 0.3}, {0.1, 0.2, 0.7}}};
  std::shared_ptr<const ColourTransform> theirs;
  try {
    theirs = config_->to_linear(name);
  } catch (const Error&) {
    return;  // it cannot be meant
  }
  const shading::ColourInput ours{own.linear, primaries_matrix(own.primaries, kRec709)};
  for (const auto& colour : kColours) {
    shading::TexelValue expected{{colour[0], colour[1], colour[2]}, 3};
    shading::apply(ours, expected);
    std::array<double, 3> got = colour;
    theirs->apply(got);
    for (std::size_t c = 0; c < 3; ++c) {
      if (std::fabs(got[c] - expected.v[c]) <= kAlike) continue;
      throw Error(ErrorKind::usage, fmt::format("{} {}: {} gives this built-in name to a different "
                                                "colour space; use another alias of that space",
                                                option, name, config_->path()));
    }
  }
}

// --- the source ----------------------------------------------------------------------------------

std::optional<ColourSpace> ColourSpaces::given(Channel channel) const {
  std::optional<ColourSpace> found;
  if (!is_colour(options_, channel)) return found;
  for (std::size_t i = 0; i < given_.size(); ++i) {
    const auto& of = options_.colour.source_spaces[i].channel;
    // What names the channel beats what names none, whichever comes first.
    if (of ? *of == channel : !found) found = given_[i];
  }
  return found;
}

ColourSpace ColourSpaces::of(Channel channel, const ColumnPlan& column) const {
  if (!is_colour(options_, channel)) return {kRec709, column.info.linear};
  if (const auto said = given(channel)) return *said;
  return column.heeds_tags ? column.info.space() : ColourSpace{kRec709, column.info.linear};
}

bool ColourSpaces::said_anyway(Channel channel, const ColumnPlan& column) const {
  const auto said = given(channel);
  return !said || *said == (column.heeds_tags ? column.info.space()
                                              : ColourSpace{kRec709, column.info.linear});
}

bool ColourSpaces::is_by_config(Channel channel) const {
  if (!is_colour(options_, channel)) return false;
  const auto source = given(channel);
  return (source && !source->config_name.empty()) || (asked_ && !asked_->config_name.empty());
}

// --- the output ----------------------------------------------------------------------------------

void ColourSpaces::choose(const SourceLook& look, const std::optional<io::ImageInfo>& onto,
                          ChannelPlan& plan, std::vector<std::string>& notes) {
  const bool float_out = store::is_float(plan.format.depth);
  // EXR is linear; float TIFF keeps linear input linear; everything else is sRGB-coded.
  const bool is_exr = io::is_exr(output_of(options_, plan.channel), plan.format.depth);
  plan.format.linear = is_exr || (float_out && (onto ? onto->space().linear : look.linear));
  if (!plan.format.is_colour) return;
  if (asked_ && is_exr) check_exr_space(options_, *asked_);
  if (asked_ && !asked_->config_name.empty()) {
    plan.format.transform = transform(asked_->config_name, false);
    plan.colour_space = asked_->config_name;
    return note_conversion(look, plan, *asked_, notes);
  }
  // An image below decides for its output. Else primaries of linear light are kept where the output
  // is linear as well, and those of coded colours everywhere; glTF knows sRGB alone.
  const ColourSpace source{look.chromaticities.value_or(kRec709), look.linear};
  if (onto) {
    plan.primaries = onto->space().primaries;
    plan.format.linear = plan.format.linear || onto->space().linear;
  } else {
    if (!for_model_ && (plan.format.linear || !source.linear)) plan.primaries = source.primaries;
    const ColourSpace usual{plan.primaries, plan.format.linear};
    // The hash of the job does not tell an option that states the default from none.
    if (asked_ && *asked_ == usual) plan.said_anyway.emplace_back("output-colorspace");
    if (asked_) {
      plan.primaries = asked_->primaries;
      plan.format.linear = asked_->linear;
    }
  }
  const ColourSpace made{plan.primaries, plan.format.linear};
  // What readers take a file for that says nothing.
  const bool is_plain = same_primaries(made.primaries, kRec709) && made.linear == float_out;
  const bool is_said = onto ? onto->colours.primaries.has_value() : look.chromaticities.has_value();
  if (!is_plain || (is_exr && is_said)) plan.chromaticities = made.primaries;
  note_conversion(look, plan, made, notes);
}

void ColourSpaces::note_conversion(const SourceLook& look, const ChannelPlan& plan,
                                   const ColourSpace& made, std::vector<std::string>& notes) const {
  if (look.size.width == 0 && !look.of_scene) return;  // no images
  ColourSpace source{look.chromaticities.value_or(kRec709), look.linear};
  if (const auto said = given(plan.channel); said && !said->config_name.empty()) source = *said;
  if (source.config_name == made.config_name &&
      (!made.config_name.empty() ||
       (source.linear == made.linear && same_primaries(source.primaries, made.primaries))))
    return;
  notes.push_back(fmt::format("{} is converted from {} to {}", plan.name, colour_space_name(source),
                              colour_space_name(made)));
}

std::optional<shading::ColourInput> ColourSpaces::input(const ColourSpace& space, bool usual_linear,
                                                        bool plain, const ChannelPlan& plan) {
  if (space.config_name.empty() || !plan.format.is_colour)
    return colour_input(space, usual_linear, plan);
  // From a space into itself, with nothing in between: the samples are the output's, bit for bit. A
  // conversion to light and back would only round them.
  if (plain && space.config_name == plan.colour_space)
    return shading::ColourInput{plan.format.linear, std::nullopt, nullptr, true};
  shading::ColourInput input{true, std::nullopt, transform(space.config_name, true)};
  if (!same_primaries(kRec709, plan.primaries))
    input.primaries = primaries_matrix(kRec709, plan.primaries);
  return input;
}

const ColourTransform* ColourSpaces::transform(const std::string& name, bool to_linear) {
  // One transform per space and direction, shared by all images and channels: its tables may be
  // large.
  const std::pair key(name, to_linear);
  if (const auto made = transforms_.find(key); made != transforms_.end()) return made->second.get();
  // What throws leaves nothing behind: a channel that cannot be read may be left out.
  auto made = to_linear ? config_->to_linear(name) : config_->from_linear(name);
  return transforms_.emplace(key, std::move(made)).first->second.get();
}

void ColourSpaces::finish(SourcePlan& plan) const {
  for (const auto& [name, transform] : transforms_) plan.transforms.push_back(transform);
  if (transforms_.empty()) return;
  plan.table_loading_bytes = config_->table_loading_bytes();
  plan.table_bytes = config_->table_bytes();
  plan.notes.push_back(
      fmt::format("colours are converted by OpenColorIO with {}: the last bits of the output may "
                  "differ between kinds of processors",
                  config_->path()));
}

std::optional<shading::ColourInput> colour_input(const ColourSpace& space, bool usual_linear,
                                                 const ChannelPlan& plan) {
  if (!plan.format.is_colour) return std::nullopt;
  const bool same = same_primaries(space.primaries, plan.primaries);
  if (same && space.linear == usual_linear) return std::nullopt;
  shading::ColourInput input{space.linear, std::nullopt};
  if (!same) input.primaries = primaries_matrix(space.primaries, plan.primaries);
  return input;
}

}  // namespace pounce::planning
