// SPDX-License-Identifier: Apache-2.0
//
// The options of `pounce maps` and `pounce gaussians`.
//
// Shorter tables than that of a transfer, from the same parts (shared_rows.h). What both have is
// one row there, so help and refusals agree.
//
// `maps` is hashed like a transfer, since its images record their jobs. Files of Gaussians record
// none, so `hashed` means nothing in their table.
#include "options/parse.h"
#include "options/row.h"
#include "options/shared_rows.h"

namespace pounce::options {
namespace {

std::string parse_maps_output(const std::string& option, const std::string& text) {
  parse_image_pattern(option, text);
  if (text.find("<CHANNEL>") == std::string::npos)
    refuse_value(option, text, "<CHANNEL> in it: three images need three names");
  return text;
}

Rows<MapsOptions> maps_rows() {
  using Options = MapsOptions;
  Rows<Options> rows{
      row<Options>({.name = "target",
                    .value = "TARGET",
                    .help = "Mesh with UVs: .glb, .gltf, .obj or .ply",
                    .hashed = Hashed::otherwise,
                    .is_operand = true,
                    .is_required = true},
                   path(&Options::target), any_text()),
      row<Options>(
          {.name = "output",
           .value = "OUTPUT",
           .group = "Output",
           .help = "Images to write (.exr, .tif); must hold <CHANNEL>, which becomes position, "
                   "normal and mask; with <UDIM> or <UVTILE> one image per tile",
           .letter = 'o',
           .hashed = Hashed::otherwise,
           .is_required = true},
          path(&Options::output), text(parse_maps_output)),
      row<Options>({.name = "size",
                    .value = "N|WxH",
                    .group = "Output",
                    .help = "Resolution in texels, each side 1 to 65536. Run time scales with the "
                            "number of texels",
                    .hashed = Hashed::otherwise},
                   path(&Options::size), image_size()),
  };
  append(rows, mesh_use_rows("target", &Options::target_use));
  append(rows, {external_row<Options>()});
  append(rows, resource_rows<Options>());
  return rows;
}

/// The one channel that Gaussians have, without the maps that a transfer numbers.
Row<GaussiansOptions> colour_image_row(const std::string& group) {
  return custom_row<GaussiansOptions>(
      {.name = "source-texture",
       .value = "baseColor=PATH",
       .group = group,
       .help = "Read the colours from this image instead of the mesh's own",
       .source = Source::mesh},
      OptionValues::one,
      [](GaussiansOptions& o, const std::string& option, const std::string& text) {
        // A list that is thrown away: a name that is no channel becomes a map of it and is refused
        // here.
        std::vector<OtherMap> maps;
        const SourceTexture texture = parse_source_texture(option, text, maps);
        if (texture.channel != Channel::base_color)
          refuse_value(option, text, "baseColor=PATH: splats have one colour");
        o.source_textures = {texture};
      },
      [](const GaussiansOptions& o) {
        Texts texts;
        for (const auto& [channel, path] : o.source_textures)
          texts.push_back(std::string(channel_name(channel)) + "=" + path);
        return texts;
      });
}

Row<GaussiansOptions> colour_space_row(const std::string& group) {
  return custom_row<GaussiansOptions>(
      {.name = "source-colorspace",
       .value = "SPACE",
       .group = group,
       .help = "Colour space of the images: srgb, lin_rec709, acescg, aces2065-1, display-p3, or a "
               "space of --ocio",
       .default_text = "what the files state",
       .source = Source::mesh},
      OptionValues::one,
      [](GaussiansOptions& o, const std::string&, const std::string& text) {
        o.colour.source_spaces = {{std::nullopt, text}};
      },
      [](const GaussiansOptions& o) {
        Texts texts;
        for (const SourceColourSpace& given : o.colour.source_spaces) texts.push_back(given.space);
        return texts;
      });
}

Rows<GaussiansOptions> mesh_rows() {
  using Options = GaussiansOptions;
  const std::string group = "Meshes";
  return {
      colour_image_row(group),
      colour_space_row(group),
      config_row<Options>(group, Source::mesh, Hashed::as_text),
      row<Options>({.name = "sigma",
                    .value = "S",
                    .group = group,
                    .help = "Standard deviation of a texel's disc in texels. Below 0.4 viewers "
                            "show gaps",
                    .usual = sigma().print(kDefaultSigma),
                    .source = Source::mesh},
                   path(&Options::sigma_texels), sigma()),
      row<Options>({.name = "sharpen",
                    .value = "A",
                    .group = group,
                    .help = "Sharpen colours by A times what blending the discs takes away: for a "
                            "transfer back onto a mesh, best with --sigma 0.25",
                    .source = Source::mesh},
                   path(&Options::sharpen), number(0, 4)),
  };
}

Rows<GaussiansOptions> gaussians_rows() {
  using Options = GaussiansOptions;
  // Whatever is written, one row says how it is rotated. There is no default that holds for all
  // formats, so "x,y,z" is a value like others here, and not the same as nothing.
  const std::string scenes = "Splat scenes";
  Rows<Options> rows{
      row<Options>(
          {.name = "source",
           .value = "SOURCE",
           .help = "Mesh with a baseColor texture (.glb, .gltf, .obj, .ply) or splat scene",
           .is_operand = true,
           .is_required = true},
          path(&Options::source), any_text()),
      row<Options>({.name = "output",
                    .value = "OUTPUT",
                    .group = "Output",
                    .help = "File to write (.ply, .spz or .glb). It appears whole or not at all",
                    .letter = 'o',
                    .is_required = true},
                   path(&Options::output), text(parse_path)),
      row<Options>({.name = "source-axes",
                    .value = "AXES",
                    .group = "Output",
                    .help = "OUTPUT's x, y and z as SOURCE's, such as x,-y,-z",
                    .default_text = "as stored; scenes from or to glTF, where y is up, are turned: "
                                    "-x,-y,z"},
                   path(&Options::axes), axes(false)),
  };
  // What applies to one kind of source only is a group of its own in help.
  append(rows, mesh_rows());
  append(rows, splat_filter_rows<Options>(scenes, "as the scene is stored, or after --source-axes",
                                          &Options::filter));
  append(rows, {row<Options>({.name = "count",
                              .value = "N",
                              .group = scenes,
                              .help = "Write at most N Gaussians, the most important ones: by "
                                      "opacity times the product of the two larger standard "
                                      "deviations. Reads the scene twice",
                              .default_text = "all",
                              .source = Source::splats},
                             path(&Options::count), integer<std::uint64_t>(1, UINT64_MAX)),
                external_row<Options>(), format_row<Options>(), sandbox_row<Options>()});
  append(rows, resource_rows<Options>());
  return rows;
}

}  // namespace

template <>
const std::vector<Row<MapsOptions>>& rows_of<MapsOptions>() {
  static const Rows<MapsOptions> rows = maps_rows();
  return rows;
}

template <>
const std::vector<Row<GaussiansOptions>>& rows_of<GaussiansOptions>() {
  static const Rows<GaussiansOptions> rows = gaussians_rows();
  return rows;
}

// --- apply ---------------------------------------------------------------------------------------
//
// The options of `pounce apply`: those of a transfer that apply to a hit map. They are the same
// rows, so that they are read, refused, reported and hashed alike; some mean less there, and are
// described in words of their own.

namespace {

/// What an option of a transfer is for a hit map, where that is not the same.
void reword(OptionInfo& info) {
  if (info.name == "source") {
    info.value = "MAP";
    info.help = "Hit map (.exr) that `pounce transfer --map` wrote. May hold <UDIM> or <UVTILE>";
  } else if (info.name == "output") {
    info.help =
        "Image to write (.png, .jpg, .tif, .tx, .exr). May hold <CHANNEL>, and holds <UDIM> "
        "(1001) or <UVTILE> (u1_v1) if MAP does. Missing folders are created";
  } else if (info.name == "tiles") {
    info.default_text = "all that MAP has";
  } else if (info.name == "channels") {
    info.help =
        "baseColor, metallicRoughness, occlusion and emissive, separated by commas. Each needs "
        "--source-texture";
    info.default_text = "all that --source-texture names if OUTPUT holds <CHANNEL>, else baseColor";
  } else if (info.name == "source-texture") {
    info.help =
        "Paint this image: of a material's channel, or a custom map (displacement, specular, mask) "
        "that --channels and <CHANNEL> then know by NAME. PATH may hold <UDIM> or <UVTILE>. Layers "
        "and channels of an EXR: NAME=FILE.exr:diffuse or NAME=FILE.exr:N.X,Y,Z. Once per name";
    info.is_required = true;
  }
}

}  // namespace

std::vector<OptionInfo> apply_infos() {
  std::vector<OptionInfo> infos;
  for (const Row<TransferOptions>& row : rows_of<TransferOptions>()) {
    if (!applies_to(row.source, Source::map)) continue;
    infos.push_back(row.info);
    reword(infos.back());
  }
  return infos;
}

}  // namespace pounce::options
