// SPDX-License-Identifier: Apache-2.0
//
// Rows whose values name channels, and so may name custom maps.
//
// A name that is no channel gets a number in ChannelOptions::other_maps the first time that any of
// these options meets it, and the same number from every later one. Numbers therefore depend on the
// order of the options. They never leave a job: whatever is printed, hashed or recorded has the
// name. Whether a name has an image at all is asked once all options are known
// (planning/check_options.cpp), since --channels may come before --source-texture.
//
// Most rows are hashed otherwise: which channels are written does not matter to the bytes of one of
// them, and an image counts by its content (docs/decisions/029-job-hash.md).
#include "options/channel_rows.h"

#include "options/codecs.h"

namespace pounce::options {
namespace {

using Options = TransferOptions;
using Get = const TransferOptions&;

std::string name_in(Get o, Channel channel) { return channel_name(o, channel); }

}  // namespace

Row<Options> output_for_row() {
  // A channel's own pattern decides the format of its image, which is hashed as resolved.
  return custom_row<Options>(
      {.name = "output-for",
       .value = "CHANNEL=PATTERN",
       .group = "Output",
       .help = "Write this channel to images of its own name and format, such as height=height.exr "
               "beside PNGs. Accepts the tokens of OUTPUT; once per channel",
       .hashed = Hashed::otherwise},
      OptionValues::several,
      [](Options& o, const std::string& option, const std::string& text) {
        o.image.channel_outputs.push_back(
            parse_channel_output(option, text, o.channels.other_maps));
      },
      [](Get o) {
        Texts texts;
        for (const auto& [channel, path] : o.image.channel_outputs)
          texts.push_back(name_in(o, channel) + "=" + path);
        return texts;
      });
}

Row<Options> channels_row() {
  return custom_row<Options>(
      {.name = "channels",
       .value = "LIST|all",
       .group = "Source",
       .help = "baseColor, metallicRoughness, occlusion, emissive and normal, separated by commas, "
               "or all that the source has. Each costs one decoding and one image. Normal maps are "
               "converted from the source's tangent space to the target's (TANGENT if present, "
               "else MikkTSpace). Splat scenes have baseColor and, if named, confidence (0 to 1) "
               "and distance (signed, from the texel to the surface; .exr or .tif)",
       .default_text = "all if OUTPUT is a model or holds <CHANNEL>, else baseColor",
       .hashed = Hashed::otherwise},
      OptionValues::list,
      [](Options& o, const std::string& option, const std::string& text) {
        // The last one counts, as for any option with one value: "all" clears a list and the other
        // way round.
        o.channels.all = text == "all";
        o.channels.transferred = o.channels.all
                                     ? std::vector<Channel>{}
                                     : parse_channels(option, text, o.channels.other_maps);
      },
      [](Get o) {
        if (o.channels.all) return Texts{"all"};
        Texts texts;
        for (const Channel channel : o.channels.transferred) texts.push_back(name_in(o, channel));
        return texts;
      });
}

Row<Options> source_texture_row() {
  return custom_row<Options>(
      {.name = "source-texture",
       .value = "NAME=PATH",
       .group = "Source",
       .help = "Read a channel from this image instead of the mesh's own, or add a custom map "
               "(displacement, specular, mask) that --channels and <CHANNEL> then know by NAME. "
               "PATH may hold <UDIM> or <UVTILE>. Layers and channels of an EXR: "
               "NAME=FILE.exr:diffuse or NAME=FILE.exr:N.X,Y,Z. Once per name",
       .source = Source::mesh_or_map,
       .hashed = Hashed::otherwise},
      OptionValues::several,
      [](Options& o, const std::string& option, const std::string& text) {
        // Two images for one name are refused by planning::SourceImages, which names both.
        o.material.textures.push_back(parse_source_texture(option, text, o.channels.other_maps));
      },
      [](Get o) {
        Texts texts;
        for (const auto& [channel, path] : o.material.textures)
          texts.push_back(name_in(o, channel) + "=" + path);
        return texts;
      });
}

Row<Options> map_kind_row(bool is_colour) {
  // Two options, one member: a map is colour, data, or neither is stated. parse_map_kind() refuses
  // both.
  Spec spec{.name = is_colour ? "color" : "data", .value = "NAME", .group = "Source"};
  spec.help = is_colour
                  ? "Treat this custom map as colour: converted between sRGB and linear light "
                    "where formats differ. Once per map"
                  : "Treat this custom map as data (no colour conversion). Once per map";
  spec.default_text = is_colour ? "" : "by its name (docs/maps.md), else data";
  spec.hashed = Hashed::otherwise;
  return custom_row<Options>(
      std::move(spec), OptionValues::several,
      [is_colour](Options& o, const std::string& option, const std::string& text) {
        parse_map_kind(option, text, is_colour, o.channels.other_maps);
      },
      [is_colour](Get o) {
        Texts texts;
        for (const OtherMap& map : o.channels.other_maps) {
          // A map for which nothing was stated is printed by neither option.
          if (map.is_colour == is_colour) texts.push_back(map.name);
        }
        return texts;
      });
}

Row<Options> source_space_row() {
  return custom_row<Options>(
      {.name = "source-colorspace",
       .value = "[NAME=]SPACE",
       .group = "Colour",
       .help = "Colour space of the source's colour images, of this channel or of all: srgb, "
               "lin_rec709, acescg, aces2065-1, display-p3, or a space of --ocio",
       .default_text = "what the files state (EXR, ICC profiles, PNG chunks), but srgb in glTF; "
                       "else srgb for integers, lin_rec709 for floats",
       .source = Source::mesh_or_map},
      OptionValues::several,
      [](Options& o, const std::string& option, const std::string& text) {
        o.colour.source_spaces.push_back(parse_source_space(option, text, o.channels.other_maps));
      },
      [](Get o) {
        Texts texts;
        for (const auto& [channel, space] : o.colour.source_spaces)
          // Without a name it applies to all channels, which is how it is printed.
          texts.push_back((channel ? name_in(o, *channel) + "=" : "") + space);
        return texts;
      });
}

}  // namespace pounce::options
