// SPDX-License-Identifier: Apache-2.0
//
// Painting over, as far as it is decided before any work: which image each output is painted onto,
// whether the two fit, and where charts lie that padding must leave alone.
//
// A channel has one format, but --onto may name many images, one per UDIM tile. The first one by
// name decides the format before pages are known (onto_header()); each page's own image is then
// held against it (plan_onto()).
#include "planning/image_output.h"

#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <filesystem>
#include <map>

#include "core/posix_io.h"
#include "io/files/asset_file.h"
#include "io/image/write.h"
#include "planning/colour_spaces.h"
#include "planning/name_patterns.h"
#include "planning/plan.h"
#include "planning/texture_meaning.h"
#include "pounce/error.h"
#include "store/blocks/colour_store.h"

namespace pounce::planning {
namespace {

namespace fs = std::filesystem;

std::string header_text(const io::ImageInfo& info) {
  return fmt::format("{} x {} texels, {} channels, {}", info.width, info.height, info.channels,
                     depth_name(info.depth));
}

/// The pattern's file name as one for fnmatch(): every token may be anything.
std::string any_name(const std::string& name) {
  std::string out;
  for (std::size_t at = 0; at < name.size(); ++at) {
    const std::size_t close = name[at] == '<' ? name.find('>', at) : std::string::npos;
    if (close != std::string::npos) {
      out += '*';
      at = close;
    } else {
      if (std::string_view("*?[\\").find(name[at]) != std::string_view::npos) out += '\\';
      out += name[at];
    }
  }
  return out;
}

std::string replaced(std::string pattern, const std::string& token, const std::string& value) {
  const std::string all = "<" + token + ">";
  for (std::size_t at = pattern.find(all); at != std::string::npos; at = pattern.find(all))
    pattern.replace(at, all.size(), value);
  return pattern;
}

io::ImageInfo checked_header(const std::string& option, const std::string& path, ImageSize size,
                             const ImageTrust& trust) {
  std::error_code error;
  if (fs::status(path, error).type() == fs::file_type::not_found) {
    throw Error(ErrorKind::storage, fmt::format("{}: missing for {}; create it (an empty image "
                                                "will do), or list the existing UDIMs with --tiles",
                                                path, option));
  }
  const io::ImageInfo info = io::ImageReader(path, trust).info();
  if (info.width != size.width || info.height != size.height) {
    throw Error(ErrorKind::input,
                fmt::format("{}: {} has {} x {} texels, but the output has {} x {}; resize it, or "
                            "remove --size to use the size of the image that is painted over",
                            path, option, info.width, info.height, size.width, size.height));
  }
  return info;
}

}  // namespace

std::optional<io::ImageInfo> onto_header(const TransferOptions& options,
                                         const std::string& channel) {
  if (options.composite.onto.empty()) return std::nullopt;
  const std::string pattern = replaced(options.composite.onto, "CHANNEL", channel);
  if (pattern.find('<') == std::string::npos) return io::ImageReader(pattern, options.trust).info();
  const fs::path path(pattern);
  const std::string wanted = any_name(path.filename().string());
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  // By name, since the order of a folder's entries differs between file systems, and the format
  // must not.
  std::string first;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (fnmatch(wanted.c_str(), name.c_str(), 0) == 0 && (first.empty() || name < first))
      first = name;
  }
  if (error && error != std::errc::no_such_file_or_directory && error != std::errc::not_a_directory)
    fail_storage(folder.string(), "read the folder", error.value());
  if (first.empty()) {
    throw io::MissingFile(fmt::format("{}: --onto: no such file; name existing images", pattern));
  }
  return io::ImageReader((path.parent_path() / first).string(), options.trust).info();
}

OntoImage plan_onto(const TransferOptions& options, const std::string& output,
                    const std::map<std::string, std::string>& tokens, ImageSize size,
                    const shading::TexelFormat& format, const SourceSamples& source) {
  OntoImage onto;
  onto.trust = options.trust;
  onto.path = expand_pattern(options.composite.onto, tokens);
  const io::ImageInfo info = checked_header("--onto", onto.path, size, options.trust);
  onto.decoder_bytes = info.decoder_bytes;
  if (!options.composite.mask.empty()) {
    onto.mask_path = expand_pattern(options.composite.mask, tokens);
    onto.decoder_bytes +=
        checked_header("--mask", onto.mask_path, size, options.trust).decoder_bytes;
  }
  // A smaller number of channels is converted, grey to colour for instance. A channel that has no
  // place in the output, or that would change its meaning, is an error.
  const bool lost_alpha = info.has_alpha && !format.has_alpha;
  const bool made_alpha = !info.has_alpha && info.channels == 4 && format.has_alpha;
  if (info.channels > format.channels || lost_alpha || made_alpha) {
    throw Error(ErrorKind::input, fmt::format("{}: --onto image has {}, unlike the first image of "
                                              "the pattern; convert them to one format",
                                              onto.path, header_text(info)));
  }
  onto.alpha = format.has_alpha && source.alpha && info.has_alpha ? shading::PaintAlpha::mix
                                                                  : shading::PaintAlpha::keep;
  onto.keep_last = format.colours() == 4 && source.colours < 4;
  // Only between EXRs of one depth and number of channels can old samples stay as they are,
  // multiplied. Everything else is straight while it is composited.
  onto.premultiplied = info.premultiplied && format.has_alpha && info.format == "openexr" &&
                       info.depth == format.depth && info.channels == format.channels &&
                       io::is_exr(output, format.depth);
  return onto;
}

std::vector<std::shared_ptr<const mesh::UvOccupancy>> occupied_pages(
    const mesh::Mesh& target, const std::vector<TargetPage>& pages, bool by_tile,
    std::uint32_t uv_set) {
  std::vector<std::shared_ptr<mesh::UvOccupancy>> made;
  // Triangles that were not selected count, too: their texels are somebody's paint.
  std::map<std::pair<std::int64_t, std::uint32_t>, std::size_t> page_of;  // (material, UDIM)
  for (std::size_t p = 0; p < pages.size(); ++p) {
    made.push_back(std::make_shared<mesh::UvOccupancy>());
    page_of[{pages[p].material ? std::int64_t{*pages[p].material} : -1, pages[p].udim}] = p;
  }
  const bool by_material = !pages.empty() && pages.front().material.has_value();
  const auto add = [&](const std::array<std::uint32_t, 3>& corners, std::uint32_t material) {
    const std::int64_t set = by_material ? std::int64_t{material} : -1;
    std::array<Vec2f, 3> uv;
    std::array<Vec2d, 3> precise;
    for (std::size_t k = 0; k < 3; ++k) {
      if (!target.has_uv(uv_set, corners[k])) return;
      uv[k] = target.uv_sets[uv_set][corners[k]];
      precise[k] = {uv[k].x, uv[k].y};
    }
    if (!by_tile) {
      const auto at = page_of.find({set, mesh::kFirstUdim});
      if (at != page_of.end()) made[at->second]->add_wrapped(uv);
      return;
    }
    mesh::visit_uv_tiles(precise, [&](mesh::UvTile tile) {
      const auto udim = mesh::udim_number(tile);
      const auto at = udim ? page_of.find({set, *udim}) : page_of.end();
      if (at != page_of.end()) made[at->second]->add(uv, tile.column, mesh::period_y(tile));
    });
  };
  for (std::size_t t = 0; t < target.triangles.size(); ++t)
    add(target.triangles[t], target.triangle_material[t]);
  for (std::size_t t = 0; t < target.rest.size(); ++t) add(target.rest[t], target.rest_material[t]);
  for (const auto& each : made) each->finish();
  return {made.begin(), made.end()};
}

// --- what a channel's output is ------------------------------------------------------------------
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
  const bool is_float = store::is_float(plan.format.depth);
  if (plan.channel == Channel::confidence || is_float) return;
  throw Error(ErrorKind::usage, fmt::format("{} {}: signed values need half or float samples, but "
                                            "{} would hold {}; write .exr or .tif{}",
                                            option, name, output_of(options, plan.channel),
                                            depth_name(plan.format.depth),
                                            options.image.depth ? " and remove --depth" : ""));
}

// --- projection maps -----------------------------------------------------------------------------
//
// Names and formats of `pounce maps`. All materials share a page there, and the maps are not
// images of colours: what a transfer says of its outputs does not hold for them.

MapsOutput::MapsOutput(const MapsOptions& options)
    : options_(options),
      by_tile_(has_token(options.output, "UDIM") || has_token(options.output, "UVTILE")) {
  if (!has_token(options_.output, "CHANNEL")) {
    throw Error(ErrorKind::usage, options_.output +
                                      ": <CHANNEL> is missing, which becomes position, normal "
                                      "and mask; add it to the file name");
  }
  if (io::is_tx_path(options_.output)) {
    throw Error(ErrorKind::usage, options_.output +
                                      ": .tx is for renderers' textures with mipmaps, which maps "
                                      "of a mesh do not have; write .exr or .tif");
  }
}

std::string MapsOutput::path(const TargetPage& page, int map) const {
  // <MATERIAL> has no value here: expand_pattern() refuses it as unknown. The same holds for tokens
  // of tiles unless the pattern has them.
  std::map<std::string, std::string> values{
      {"CHANNEL", kMapNames[static_cast<std::size_t>(map)]},
      {"TARGET", std::filesystem::path(options_.target).stem().string()}};
  if (by_tile_) values.merge(page.tokens());
  values.erase("MATERIAL");
  return expand_pattern(options_.output, values);
}

void MapsOutput::plan(const std::vector<TargetPage>& pages) {
  std::vector<std::string> paths;
  for (const TargetPage& page : pages) {
    for (int map = 0; map < 3; ++map) paths.push_back(path(page, map));
  }
  check_outputs(paths);
  // The ending decides the depth, and endings do not depend on a page: what holds for the first
  // page's names holds for all. Positions and normals are signed and unbounded, so integers cannot
  // hold them.
  for (int map = 0; map < 3; ++map) {
    const std::string& path = paths[static_cast<std::size_t>(map)];
    const Depth depth = io::writable_depth(path, map == kMask ? Depth::u8 : Depth::float32);
    io::ImageWriteSpec spec{
        options_.size.width, options_.size.height, map == kMask ? 1U : 3U, depth, true, false};
    std::string why = io::why_not_writable(path, spec);
    if (why.empty() && map != kMask && depth != Depth::float32) {
      why = path + ": positions and normals need a float format; write .exr or .tif";
    }
    if (!why.empty()) throw Error(ErrorKind::usage, why);
    specs_.push_back(spec);
  }
}

}  // namespace pounce::planning
