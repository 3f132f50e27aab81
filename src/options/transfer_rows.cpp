// SPDX-License-Identifier: Apache-2.0
//
// The options of `pounce transfer`. Their order is that of a job's hash, too: another order makes
// all outputs anew.
//
// A row says whether its text counts in that hash. `Hashed::otherwise` is for what changes no byte
// (resources), and for what is hashed as it was resolved: a size that follows from an image is the
// same as one that was given. When in doubt an option counts. Too much writes an image again, too
// little keeps a wrong one (docs/decisions/029-job-hash.md).
//
// `source`, `method` and `formats` say what an option applies to. Elsewhere it is refused rather
// than ignored, but only if it differs from its default.
#include "options/channel_rows.h"
#include "options/parse.h"
#include "options/shared_rows.h"

namespace pounce::options {
namespace {

using Options = TransferOptions;
using Get = const TransferOptions&;

Row<Options> factors_row() {
  return custom_row<Options>(
      {.name = "factors",
       .value = "apply|textures|factors|vertices",
       .group = "Source",
       .help = "apply: multiply material factors (baseColorFactor, Kd, d, roughness, metallic, "
               "emissive, occlusion strength) and vertex colours into the images. textures (or "
               "ignore): textures only. factors: textures and factors. vertices: textures and "
               "vertex colours. A model keeps its factors in its materials and accepts apply or "
               "factors",
       .usual = "apply",
       .source = Source::mesh_or_map},
      OptionValues::one,
      [](Options& o, const std::string& option, const std::string& text) {
        // Two members, one option. Its two names for "nothing" print as one, so their jobs are one
        // job.
        const Factors factors = parse_factors(option, text);
        o.material.apply_factors = factors.of_materials;
        o.material.apply_vertex_colours = factors.of_vertices;
      },
      [](Get o) -> Texts {
        if (o.material.apply_factors)
          return {o.material.apply_vertex_colours ? "apply" : "factors"};
        return {o.material.apply_vertex_colours ? "vertices" : "ignore"};
      });
}

Row<Options> near_target_row() {
  Row<Options> row = custom_row<Options>(
      {.name = "near-target",
       .value = "D|P%|off",
       .group = "Splat scenes",
       .help = "Skip Gaussians whose 3-sigma extent stays farther than this from every target; the "
               "sorted scene in the cache then serves these targets only. off: sort the whole "
               "scene",
       .default_text = "6.6%, or 2.2 times --max-distance if that is more, if a sample shows that "
                       "this skips three quarters of the scene; else off",
       .source = Source::splats},
      OptionValues::one,
      [](Options& o, const std::string& option, const std::string& text) {
        // Three states: a distance, "off", and nothing, by which a sample decides. One of the first
        // two clears the other.
        o.splats.everywhere = text == "off";
        o.splats.near_target.reset();
        if (!o.splats.everywhere) o.splats.near_target = parse_length(option, text);
      },
      [](Get o) -> Texts {
        if (o.splats.everywhere) return {"off"};
        if (o.splats.near_target) return {length().print(*o.splats.near_target)};
        return {};
      });
  // A row of its own has no codec that would say so. Lengths have a range, which C++ callers can
  // miss.
  row.is_checked = true;
  return row;
}

Rows<Options> output_rows() {
  const std::string group = "Output";
  // Names and sizes of outputs are hashed as they come out, image by image. What to do about
  // existing files, and when to complain, changes no byte.
  constexpr auto kHashed = Hashed::otherwise;
  return {
      row<Options>(
          {.name = "output",
           .value = "OUTPUT",
           .group = group,
           .help =
               "Model or image to write. A model (.glb, .gltf) is TARGET with new textures, one "
               "PNG per material and channel, and everything else unchanged; its name may hold "
               "<TARGET>. An image (.png, .jpg, .tif, .tx, .exr) may hold <CHANNEL>, "
               "<MATERIAL>, <TARGET>, and <UDIM> (1001) or <UVTILE> (u1_v1). Without "
               "<MATERIAL> all materials share one image; without <UDIM> UVs outside of [0,1) "
               "wrap around. Missing folders are created",
           .letter = 'o',
           .hashed = kHashed,
           .is_required = true},
          path(&Options::output), text(parse_output)),
      output_for_row(),
      row<Options>({.name = "coverage",
                    .value = "PATTERN",
                    .group = group,
                    .help = "Also write a coverage mask (255 = covered). Accepts the tokens of "
                            "OUTPUT",
                    .hashed = kHashed},
                   path(&Options::image, &ImageOptions::coverage_output),
                   text(parse_image_pattern)),
      row<Options>({.name = "map",
                    .value = "PATTERN",
                    .group = group,
                    .help = "Also write a map of where each texel hit the source, as .exr: u and v "
                            "(an ST map), UDIM, distance and angle; `pounce apply` paints through "
                            "it. Accepts the tokens of OUTPUT but <CHANNEL>",
                    .source = Source::mesh,
                    .method = Only::surface,
                    .hashed = kHashed},
                   path(&Options::image, &ImageOptions::map_output), text(parse_image_pattern)),
  };
}

/// How large outputs are, what is around their charts, and which of them are written.
Rows<Options> output_extent_rows() {
  const std::string group = "Output";
  constexpr std::uint64_t kMostPadding = 4096;  // half of it is the default at the largest size
  constexpr auto kHashed = Hashed::otherwise;
  return {
      row<Options>({.name = "tiles",
                    .value = "LIST",
                    .group = group,
                    .help = "Write only these UDIM tiles, such as 1001-1004,1011",
                    .default_text = "all that the target's UVs use",
                    .hashed = kHashed},
                   path(&Options::image, &ImageOptions::tiles), udims()),
      row<Options>({.name = "size",
                    .value = "N|WxH",
                    .group = group,
                    .help = "Resolution of each image in texels, each side 1 to 65536. Run time "
                            "scales with the number of texels",
                    .default_text = "per channel that of the largest source image",
                    .source = Source::mesh_or_splats,
                    .hashed = kHashed},
                   path(&Options::image, &ImageOptions::size), image_size()),
      row<Options>({.name = "depth",
                    .value = "u8|u16|half|float",
                    .group = group,
                    .help = "Sample type of the images",
                    .default_text = "that of the source image",
                    .hashed = kHashed},
                   path(&Options::image, &ImageOptions::depth),
                   name(depth_from_name, depth_name, "u8, u16, half or float")),
      row<Options>({.name = "padding",
                    .value = "PX",
                    .group = group,
                    .help = "Fill this many texels around every UV chart with the nearest colour. "
                            "Memory grows with it",
                    .default_text = "larger side / 128",
                    .hashed = kHashed},
                   path(&Options::image, &ImageOptions::padding_px),
                   integer<std::uint32_t>(0, kMostPadding)),
      row<Options>({.name = "min-coverage",
                    .value = "PCT",
                    .group = group,
                    .help = "Exit with status 1 if a target finds the source for less than this "
                            "percentage of its texels; all outputs are written anyway",
                    .source = Source::mesh_or_splats,
                    .hashed = kHashed},
                   path(&Options::min_coverage_percent), number(0, 100)),
      switch_row<Options>(
          {.name = "skip-existing",
           .group = group,
           .help = "Skip outputs already produced by the same inputs and options: continues an "
                   "interrupted run. Files without a recorded job are skipped if newer than every "
                   "input",
           .hashed = kHashed},
          path(&Options::skip_existing)),
  };
}

Rows<Options> file_rows() {
  // The bytes of a file depend on these, so their texts are hashed. An option of a format that no
  // output has is refused (refuse_formats()).
  const std::string group = "File format";
  return {
      row<Options>({.name = "exr-compression",
                    .value = "none|rle|zips|zip|piz",
                    .group = group,
                    .help = "Lossless compression of .exr, and of .tx with half samples",
                    .usual = "zip",
                    .formats = {"EXR"}},
                   path(&Options::image, &ImageOptions::layout, &ImageLayout::exr_compression),
                   exr_compression()),
      row<Options>({.name = "tile-size",
                    .value = "N",
                    .group = group,
                    .help = "Write .exr, .tif and .tx in tiles of N x N texels, a multiple of 16",
                    .default_text = "rows; 64 with mipmaps",
                    .formats = {"EXR", "TIFF"}},
                   path(&Options::image, &ImageOptions::layout, &ImageLayout::tile_size),
                   tile_edge()),
      row<Options>({.name = "png-compression",
                    .value = "N",
                    .group = group,
                    .help = "zlib level of PNG images: a higher level gives smaller files and "
                            "takes longer; 0 does not compress",
                    .formats = {"PNG"}},
                   path(&Options::image, &ImageOptions::layout, &ImageLayout::png_compression),
                   integer<std::uint32_t>(0, 9)),
      row<Options>({.name = "jpeg-quality",
                    .value = "N",
                    .group = group,
                    .help = "Quality of JPEG images: a lower one gives smaller files and loses "
                            "more detail",
                    .formats = {"JPEG"}},
                   path(&Options::image, &ImageOptions::layout, &ImageLayout::jpeg_quality),
                   integer<std::uint32_t>(1, 100)),
      switch_row<Options>({.name = "mipmap",
                           .group = group,
                           .help = "Write .exr and .tif with all mipmap levels, for renderers; .tx "
                                   "(TIFF, or EXR for half) always has them",
                           .formats = {"EXR", "TIFF"}},
                          path(&Options::image, &ImageOptions::layout, &ImageLayout::mipmap)),
      switch_row<Options>({.name = "drop-alpha",
                           .group = group,
                           .help = "Write no alpha, even if the source has one"},
                          path(&Options::image, &ImageOptions::drop_alpha)),
  };
}

Rows<Options> composite_rows() {
  // Hashed by content: which image lies below, not what it is called.
  const std::string group = "Compositing";
  return {
      row<Options>({.name = "onto",
                    .value = "IMAGE",
                    .group = group,
                    .help = "Write covered texels over this image instead of an empty one. It "
                            "gives size, depth and channels, and keeps its alpha if the source has "
                            "no alpha. Accepts the tokens of OUTPUT; may be OUTPUT itself",
                    .hashed = Hashed::otherwise},
                   path(&Options::composite, &CompositeOptions::onto), text(parse_image_pattern)),
      row<Options>({.name = "mask",
                    .value = "IMAGE",
                    .group = group,
                    .help = "Blend by this mask (luminance x alpha): white paints, black keeps. "
                            "Accepts the tokens of OUTPUT; needs --onto",
                    .hashed = Hashed::otherwise},
                   path(&Options::composite, &CompositeOptions::mask), text(parse_image_pattern)),
  };
}

Rows<Options> source_rows() {
  const std::string group = "Source";
  // One codec for both directions of normal maps; what goes in and what comes out are independent.
  const auto normal_y = name(normal_y_from_name, normal_y_name, "up or down");
  return {
      channels_row(),
      row<Options>(
          {.name = "bake",
           .value = "LIST",
           .group = group,
           .help = "Bake from the source's geometry, in addition to --channels, or alone if OUTPUT "
                   "names one image: normal (its smooth normals and its normal map, in the "
                   "target's tangent space), height (signed, along the target's normal) and "
                   "position (both .exr or .tif), vertexColor. Without source textures --size is "
                   "required",
           .source = Source::mesh,
           .method = Only::surface},
          path(&Options::channels, &ChannelOptions::baked), baked()),
      row<Options>({.name = "normal-y",
                    .value = "up|down",
                    .group = group,
                    .help = "Green-channel convention of the source's normal maps: up (+Y, OpenGL, "
                            "glTF) or down (-Y, DirectX)",
                    .source = Source::mesh},
                   path(&Options::material, &MaterialOptions::normal_y), normal_y),
      row<Options>({.name = "output-normal-y",
                    .value = "up|down",
                    .group = group,
                    .help = "Same, for the normal map written",
                    .source = Source::mesh},
                   path(&Options::image, &ImageOptions::normal_y), normal_y),
      source_texture_row(),
      map_kind_row(false),
      map_kind_row(true),
  };
}

Rows<Options> colour_rows() {
  return {
      // What a file states anyway need not be stated: the plan drops such an option from the hash
      // (ColourSpaces::said_anyway()).
      source_space_row(),
      row<Options>({.name = "output-colorspace",
                    .value = "SPACE",
                    .group = "Colour",
                    .help = "Convert colours to this space",
                    .default_text = "the source's, if the format holds it: EXR is linear, other "
                                    "images are srgb or display-p3, models srgb"},
                   path(&Options::image, &ImageOptions::colour_space), any_text()),
      config_row<Options>("Colour", Source::any, Hashed::otherwise),
  };
}

Rows<Options> search_rows() {
  // The default of --max-distance differs between meshes and scenes, so it is no value of its row
  // but a text for people. The plan resolves it.
  constexpr double kLargestAngle = 89.9;  // a grazing source surface is not seen at all
  return {
      row<Options>(
          {.name = "max-distance",
           .value = "D|P%",
           .group = "Search",
           .help = "Search distance along the texel's normal, both ways: in the target's units, or "
                   "% of its diagonal (up to 100%). A larger distance costs time: much where "
                   "nothing is near, else little. For splat scenes 1% excludes a second layer "
                   "behind a thin one; more reaches a scene that a coarse mesh only approximates",
           .default_text = "5%, 3% for splat scenes",
           .source = Source::mesh_or_splats},
          path(&Options::search, &SearchOptions::max_distance), length()),
      row<Options>({.name = "max-angle",
                    .value = "DEG",
                    .group = "Search",
                    .help = "Ignore source surface that faces away from the texel's normal by more "
                            "than this, in degrees",
                    .source = Source::mesh_or_splats},
                   path(&Options::search, &SearchOptions::max_angle_deg), number(0, kLargestAngle)),
  };
}

Rows<Options> splat_rows() {
  const std::string group = "Splat scenes";
  // All of these are refused with a mesh. What filters Gaussians is shared with `pounce gaussians`.
  constexpr auto kSplats = Source::splats;
  // Harmonics and filters decide what is stored of a scene, and so does --near-target. The others
  // apply to the blend: they can change without another sort.
  Rows<Options> rows{
      row<Options>({.name = "look",
                    .value = "auto|around|normal",
                    .group = group,
                    .help = "Viewing directions. around: average what the scene shows from all "
                            "sides that see the texel, as viewers display it. normal: what lies "
                            "along the texel's normal. auto: around for captures, normal for "
                            "scenes generated from a surface",
                    .source = kSplats},
                   path(&Options::splats, &SplatOptions::look),
                   name(look_from_name, look_name, "auto, around or normal")),
      row<Options>(
          {.name = "views",
           .value = "N",
           .group = group,
           .help = "Number of directions for --look around. More cover more of a texture and "
                   "are slightly closer to a viewer's image; drawing takes time in "
                   "proportion",
           .source = kSplats},
          path(&Options::splats, &SplatOptions::views),
          integer<std::uint32_t>(kLeastViews, kMostViews)),
      row<Options>(
          {.name = "sh",
           .value = "dc|normal|mean",
           .group = group,
           .help =
               "Spherical harmonics along normals. mean: view-independent, for relighting. normal: "
               "as seen along the surface normal, highlights included. dc: base colour only, also "
               "from around",
           .source = kSplats},
          path(&Options::splats, &SplatOptions::harmonics),
          name(harmonics_from_name, harmonics_name, "dc, normal or mean"))};
  append(rows, splat_filter_rows<Options>(group, "in the job's axes: after --source-axes",
                                          &Options::splats, &SplatOptions::filter));
  append(rows,
         {row<Options>(
              {.name = "rays",
               .value = "N",
               .group = group,
               .help = "Average N extra rays per texel, in a cone of 35 degrees around its normal: "
                       "closer to the multi-view appearance (3 rays gain 0.2 to 0.5 dB), but "
                       "softer. Each takes nearly as long as the first",
               .source = kSplats},
              path(&Options::splats, &SplatOptions::rays), integer<std::uint32_t>(0, kMostRays)),
          switch_row<Options>({.name = "alpha",
                               .group = group,
                               .help = "Write the scene's opacity at each texel as alpha",
                               .source = kSplats},
                              path(&Options::splats, &SplatOptions::alpha)),
          row<Options>(
              {.name = "min-confidence",
               .value = "C",
               .group = group,
               .help = "Leave texels below this confidence empty: the surface's opacity, reduced "
                       "where colours along the normal differ or the surface is far away, times "
                       "how well the scene fits the target. 0: cover all that a ray hits",
               .source = kSplats},
              path(&Options::splats, &SplatOptions::min_confidence), number(0, 1)),
          near_target_row()});
  return rows;
}

Rows<Options> method_rows() {
  // `filter` belongs to one method, `sigma` and `densify` to the other. The members are optional or
  // off, so that a row can tell whether they were set.
  const std::string group = "Meshes";
  return {
      row<Options>(
          {.name = "method",
           .value = "surface|gaussian",
           .group = group,
           .help = "surface: what the texel's ray hits first, as sharp as the source; the better "
                   "choice. gaussian: the published blend of all source texels along the ray, as "
                   "Gaussians: for comparison, or to blend layers and noise",
           .source = Source::mesh_or_splats},
          path(&Options::mesh, &MeshOptions::method),
          name(method_from_name, method_name, "surface or gaussian")),
      row<Options>(
          {.name = "filter",
           .value = "tent|cubic|sharp",
           .group = group,
           .help = "Texture filter of --method surface; none leaves the range of the four nearest "
                   "texels. cubic: Catmull-Rom, sharper than bilinear, preserves linear gradients. "
                   "sharp: steeper, for drawings and hard edges; gradients ripple slightly. Both "
                   "also undo the averaging baked into the source's texels on finer targets. tent: "
                   "bilinear, as renderers sample",
           .usual = filter_name(kDefaultFilter),
           .source = Source::mesh_or_map,
           .method = Only::surface},
          path(&Options::mesh, &MeshOptions::filter),
          name(filter_from_name, filter_name, "tent, cubic or sharp")),
      row<Options>({.name = "sigma",
                    .value = "S",
                    .group = group,
                    .help = "Standard deviation of a source texel's Gaussian in texels, for "
                            "--method gaussian. Larger blurs more and costs time with its square; "
                            "below 0.35 texels may find nothing",
                    .usual = sigma().print(kDefaultSigma),
                    .source = Source::mesh,
                    .method = Only::gaussian},
                   path(&Options::mesh, &MeshOptions::sigma_texels), sigma()),
      switch_row<Options>({.name = "densify",
                           .group = group,
                           .help = "Split texels that are large on the surface for a uniform "
                                   "density, for --method gaussian: up to three times as many "
                                   "Gaussians",
                           .source = Source::mesh,
                           .method = Only::gaussian},
                          path(&Options::mesh, &MeshOptions::densify)),
  };
}

Rows<Options> transfer_rows() {
  Rows<Options> rows{
      row<Options>(
          {.name = "source",
           .value = "SOURCE",
           .help = "Textured mesh (.glb, .gltf, .obj, .ply, .stl), splat scene (.ply, .spz, .sog, "
                   ".glb, .gltf, .splat, .ksplat) or coloured point cloud (.ply, .las)",
           .hashed = Hashed::otherwise,
           .is_operand = true,
           .is_required = true},
          path(&Options::source), any_text()),
      row<Options>(
          {.name = "target",
           .value = "TARGET",
           .help = "Meshes with UVs: .glb, .gltf, .obj or .ply. Several need <TARGET> in OUTPUT",
           .source = Source::mesh_or_splats,
           .hashed = Hashed::otherwise,
           .is_operand = true,
           .is_required = true},
          path(&Options::targets), any_text()),
  };
  // The order of help, and of the hash: see above before you move one.
  append(rows, output_rows());
  append(rows, output_extent_rows());
  append(rows, file_rows());
  append(rows, composite_rows());
  append(rows, source_rows());
  append(rows, colour_rows());
  append(rows, {factors_row()});
  append(rows, mesh_use_rows("source", &Options::source_use));
  append(rows, mesh_use_rows("target", &Options::target_use));
  append(rows, method_rows());
  append(rows, search_rows());
  append(rows, splat_rows());
  append(rows, {external_row<Options>(), format_row<Options>(), sandbox_row<Options>()});
  // Last, as in all commands: no result depends on these.
  append(rows, resource_rows<Options>());
  return rows;
}

}  // namespace

template <>
const std::vector<Row<TransferOptions>>& rows_of<TransferOptions>() {
  static const Rows<TransferOptions> rows = transfer_rows();
  return rows;
}

}  // namespace pounce::options
