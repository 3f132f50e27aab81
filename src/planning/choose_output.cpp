// SPDX-License-Identifier: Apache-2.0
//
// The output of a channel: its size, its channels and what they are called, its depth; and what its
// format cannot hold.
//
// In this order: what the user says, else what the image below has (--onto), else what the source
// has, else what the format prefers. A format that cannot hold the result is refused before any
// work if something would be wrong in the image, and accepted with a warning if something is left
// out.
//
// The depth comes first, since a format's abilities may depend on it: a .tx is a TIFF, or an EXR
// for halves. Colour spaces come last: they depend on the depth and on whether the channel is
// colour at all.
#include <fmt/format.h>

#include <algorithm>

#include "io/image/write.h"
#include "planning/colour_spaces.h"
#include "planning/map_kind.h"
#include "planning/output_names.h"
#include "planning/plan.h"

namespace pounce::planning {
namespace {

constexpr std::uint32_t kUntexturedSize = 1024;

/// How many channels the output has, and what they are.
void choose_channels(const TransferOptions& options, const SourceLook& look,
                     const std::optional<io::ImageInfo>& onto, ChannelPlan& plan,
                     std::vector<std::string>& warnings) {
  const std::string& output = output_of(options, plan.channel);
  const io::FormatLook format = io::format_look(output, plan.format.depth);
  plan.format.has_alpha = onto ? onto->has_alpha : look.alpha && !options.image.drop_alpha;
  std::uint32_t colours = look.colours;
  plan.names = look.names;
  if (onto) {  // as the old image is, but for grey that is to take colour
    const std::uint32_t old = onto->channels - (onto->has_alpha ? 1U : 0U);
    colours = std::max(old, std::min(look.colours, 3U));
    plan.names = onto->names;
    if (onto->has_alpha) plan.names.pop_back();
  }
  // One and three channels fit everywhere. Two and four are data: a format must say of the last one
  // that it is no alpha, or readers would take it for that.
  const bool fits = colours + (plan.format.has_alpha ? 1U : 0U) <= io::kMostChannels;
  const bool data = colours == 2 || colours == 4;
  const bool held = format.annotated || (format.data && !plan.format.has_alpha);
  if (!fits || (data && !held)) colours = 3;
  plan.format.channels = colours + (plan.format.has_alpha ? 1U : 0U);
  if (look.colours == 4 && colours == 3) {
    warnings.push_back(fmt::format(
        "{}: a fourth channel other than alpha does not fit into {} and is left out: {}", output,
        onto   ? "the image that is painted over"
        : fits ? format.name
               : "an image with alpha",
        look.names.empty() ? "the fourth" : look.names.back()));
  }
  if (look.colours == 2 && colours == 3 && !onto) {
    warnings.push_back(fmt::format("{}: {} does not support two channels; the third is set to 0",
                                   output, format.name));
  }
  if (plan.names.size() > colours) plan.names.resize(colours);
  const bool named = !plan.names.empty() && !io::are_usual(plan.names, false);
  if (named && !format.annotated) {
    const auto usual = io::usual_names(colours, false);
    warnings.push_back(fmt::format(
        "{}: {} does not store channel names: {} are written as {}; use .exr to keep the names",
        output, format.name, io::joined(plan.names),
        io::joined(
            {usual.begin(), usual.begin() + static_cast<std::ptrdiff_t>(plan.names.size())})));
  }
  // Names for some of the channels only count as none.
  if (plan.names.size() < colours) plan.names.clear();
  if (!plan.names.empty() && plan.format.has_alpha) {  // of their layer: "diffuse.R", "diffuse.A"
    const std::size_t dot = plan.names.front().rfind('.');
    const std::size_t layer = dot == std::string::npos ? 0 : dot + 1;
    plan.names.push_back(plan.names.front().substr(0, layer) + "A");
  }
}

}  // namespace

void choose_output(const TransferOptions& options, const SourceLook& look, ColourSpaces& spaces,
                   ChannelPlan& plan, std::vector<std::string>& warnings,
                   std::vector<std::string>& notes) {
  const std::optional<io::ImageInfo> onto = onto_header(options, plan.name);
  plan.source_alpha = look.alpha;
  plan.source_colours = look.colours;
  plan.size = options.image.size.value_or(onto ? ImageSize{onto->width, onto->height} : look.size);
  if (plan.size.width == 0) plan.size = {kUntexturedSize, kUntexturedSize};
  if (plan.size.width > store::kLargestImageSide || plan.size.height > store::kLargestImageSide) {
    throw Error(ErrorKind::usage,
                fmt::format("--size {}x{}: each side is limited to {} texels", plan.size.width,
                            plan.size.height, store::kLargestImageSide));
  }
  const std::string& output = output_of(options, plan.channel);
  // A depth that was asked for is not replaced by the nearest one: why_not_writable() refuses it
  // below.
  const Depth wanted = options.image.depth ? *options.image.depth : onto ? onto->depth : look.depth;
  plan.format.depth = options.image.depth ? wanted : io::writable_depth(output, wanted);
  choose_channels(options, look, onto, plan, warnings);
  plan.format.is_colour = is_colour(options, plan.channel);
  spaces.choose(look, onto, plan, notes);
  // EXR holds colours times alpha: what comes so goes so, bit by bit.
  plan.format.premultiplied =
      io::is_exr(output, plan.format.depth) && !onto && plan.format.has_alpha && look.premultiplied;
  io::ImageWriteSpec spec{plan.size.width,   plan.size.height,   plan.format.channels,
                          plan.format.depth, plan.format.linear, plan.format.has_alpha};
  std::string why = io::why_not_writable(output, spec);
  if (why.empty()) return;
  // Would it do without alpha? Then the message says so.
  if (spec.has_alpha && !onto && !options.splats.alpha) {
    spec.has_alpha = false;
    --spec.channels;
    if (io::why_not_writable(output, spec).empty()) why += ", or --drop-alpha";
  }
  throw Error(ErrorKind::usage, why);
}

void check_numbers(const TransferOptions& options, const ChannelPlan& plan,
                   const std::string& option) {
  const char* const name = channel_name(plan.channel);
  // Only --onto can bring another number of samples: an image that is composited over keeps its
  // own.
  const std::uint32_t samples = plan.channel == Channel::position ? 3 : 1;
  if (plan.format.channels != samples) {
    throw Error(
        ErrorKind::usage,
        fmt::format("{} {}: --onto {} has {} samples per texel, this channel has {}; add <CHANNEL> "
                    "to --onto, or transfer {} in a separate run",
                    option, name, options.composite.onto, plan.format.channels, samples, name));
  }
  const bool is_float = plan.format.depth == Depth::half || plan.format.depth == Depth::float32;
  if (plan.channel == Channel::confidence || is_float) return;
  throw Error(ErrorKind::usage, fmt::format("{} {}: signed values need half or float samples, but "
                                            "{} would hold {}; write .exr or .tif{}",
                                            option, name, output_of(options, plan.channel),
                                            depth_name(plan.format.depth),
                                            options.image.depth ? " and remove --depth" : ""));
}

}  // namespace pounce::planning
