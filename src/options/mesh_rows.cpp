// SPDX-License-Identifier: Apache-2.0
//
// The options of `pounce proxy` and `pounce mesh`, which make meshes. What `mesh` says of the
// texture are rows of a transfer, as they are there.
#include <algorithm>
#include <array>
#include <string_view>

#include "options/parse.h"
#include "options/row.h"
#include "options/shared_rows.h"

namespace pounce::options {
namespace {

constexpr const char* kSource =
    "Splat scene (.ply, .spz, .sog, .glb, .gltf, .splat, .ksplat) or coloured point cloud (.ply, "
    ".las) of an object, or a mesh (.glb, .gltf, .obj, .ply, .stl)";

/// How the mesh is made; `shape` leads to the MeshShape.
template <class Options, class Shape>
Rows<Options> shape_rows(Shape shape, const std::string& size_help) {
  const auto member = [shape](auto which) {
    return [ shape, which ](auto& options) -> auto& { return shape(options).*which; };
  };
  return {
      row<Options>({.name = "triangles",
                    .value = "N",
                    .group = "Mesh",
                    .help = "At most so many triangles, as far as the shape allows"},
                   member(&MeshShape::triangles), integer<std::uint32_t>(100, 5000000)),
      row<Options>({.name = "detail",
                    .value = "D|P%",
                    .group = "Mesh",
                    .help = "Instead of --triangles: as few as keep the surface within about this "
                            "distance, in SOURCE's units or as a percentage of the diagonal",
                    .default_text = "none",
                    .excludes = "triangles"},
                   member(&MeshShape::detail), length()),
      row<Options>({.name = "cells",
                    .value = "N",
                    .group = "Mesh",
                    .help = "Cells along the longest side of the scene: more show finer shapes, "
                            "and more of the scene's noise",
                    .source = Source::splats},
                   member(&MeshShape::cells), integer<std::uint32_t>(16, 512)),
      switch_row<Options>(
          {.name = "close",
           .group = "Mesh",
           .help = "Close holes: what no view sees counts as inside, such as hollows. Without it "
                   "the surface stays open there",
           .source = Source::splats},
          member(&MeshShape::close)),
      row<Options>({.name = "inside",
                    .value = "X,Y,Z|middle",
                    .group = "Mesh",
                    .help = "SOURCE is a room: its surface as seen from within, as far as the air "
                            "around this point reaches (middle: of the scene)",
                    .default_text = "none",
                    .source = Source::splats},
                   member(&MeshShape::inside), air_point()),
      switch_row<Options>(
          {.name = "keep-uvs",
           .group = "UVs",
           .help =
               "Keep SOURCE's UVs, seams and materials instead of making new ones: its textures "
               "and the lighter model's then have one layout",
           .source = Source::mesh},
          member(&MeshShape::keep_uvs)),
      row<Options>({.name = "size", .value = "N", .group = "UVs", .help = size_help},
                   member(&MeshShape::size), integer<std::uint32_t>(64, 65536)),
      row<Options>({.name = "gutter",
                    .value = "N",
                    .group = "UVs",
                    .help = "Texels between charts",
                    .excludes = "keep-uvs"},
                   member(&MeshShape::gutter), integer<std::uint32_t>(0, 64)),
      row<Options>({.name = "udims",
                    .value = "N",
                    .group = "UVs",
                    .help = "Lay charts out in N UDIM tiles, each of --size and a material that is "
                            "called by its number: 1001, 1002",
                    .excludes = "keep-uvs"},
                   member(&MeshShape::udims), integer<std::uint32_t>(1, 100)),
  };
}

template <class Options, class Source, class Output>
Rows<Options> file_rows(Source source, Output output, const std::string& output_help) {
  return {
      row<Options>({.name = "source",
                    .value = "SOURCE",
                    .help = kSource,
                    .is_operand = true,
                    .is_required = true},
                   source, any_text()),
      row<Options>({.name = "output",
                    .value = "OUTPUT",
                    .group = "Output",
                    .help = output_help + ". It appears whole or not at all",
                    .letter = 'o',
                    .is_required = true},
                   output, text(parse_path)),
  };
}

Rows<ProxyOptions> proxy_rows() {
  using Options = ProxyOptions;
  Rows<Options> rows = file_rows<Options>(path(&Options::source), path(&Options::output),
                                          "Mesh to write (.glb), in the source's coordinates");
  append(
      rows,
      {
          row<Options>(
              {.name = "source-axes",
               .value = "AXES",
               .group = "Output",
               .help = "OUTPUT's x, y and z as SOURCE's, such as x,-y,-z. A transfer onto OUTPUT "
                       "needs the same",
               .default_text = "as stored"},
              path(&Options::axes), axes(false)),
      });
  append(rows, shape_rows<Options>(path(&Options::shape),
                                   "Texels along the texture that is to be made: the gutter is "
                                   "counted in these"));
  append(rows, splat_filter_rows<Options>("Splat scenes", "as stored, or after --source-axes",
                                          &Options::filter));
  append(rows, resource_rows<Options>());
  return rows;
}

/// The rows of a transfer that say how the texture is made.
constexpr std::array kOfTransfer{
    std::string_view("padding"),
    std::string_view("min-coverage"),
    std::string_view("png-compression"),
    std::string_view("channels"),
    std::string_view("normal-y"),
    std::string_view("source-texture"),
    std::string_view("factors"),
    std::string_view("source-mesh"),
    std::string_view("source-material"),
    std::string_view("source-uv-set"),
    std::string_view("source-axes"),
    std::string_view("source-colorspace"),
    std::string_view("ocio"),
    std::string_view("max-distance"),
    std::string_view("filter"),
    std::string_view("look"),
    std::string_view("views"),
    std::string_view("sh"),
    std::string_view("alpha"),
    std::string_view("min-opacity"),
    std::string_view("max-scale"),
    std::string_view("box"),
    std::string_view("min-confidence"),
    std::string_view("allow-external"),
    std::string_view("allow-format"),
    std::string_view("sandbox"),
};

Row<TexturedMeshOptions> lifted(const Row<TransferOptions>& row) {
  using Options = TexturedMeshOptions;
  return {row.info,
          row.source,
          row.method,
          row.formats,
          row.hashed,
          [set = row.set](Options& options, const std::string& option, const std::string& text) {
            set(options.transfer, option, text);
          },
          [get = row.get](const Options& options) { return get(options.transfer); },
          row.is_checked};
}

Rows<TexturedMeshOptions> textured_rows() {
  using Options = TexturedMeshOptions;
  Rows<Options> rows = file_rows<Options>(
      path(&Options::transfer, &TransferOptions::source),
      path(&Options::transfer, &TransferOptions::output),
      "Model to write (.glb, .gltf), in the source's coordinates, with a PNG per channel");
  append(rows, shape_rows<Options>(path(&Options::shape), "Texels along each side of the texture"));
  for (const Row<TransferOptions>& row : rows_of<TransferOptions>()) {
    const bool is_resource = row.info.group.starts_with("Resources");
    if (is_resource ||
        std::find(kOfTransfer.begin(), kOfTransfer.end(), row.info.name) != kOfTransfer.end())
      rows.push_back(lifted(row));
  }
  return rows;
}

}  // namespace

template <>
const std::vector<Row<ProxyOptions>>& rows_of<ProxyOptions>() {
  static const Rows<ProxyOptions> rows = proxy_rows();
  return rows;
}

template <>
const std::vector<Row<TexturedMeshOptions>>& rows_of<TexturedMeshOptions>() {
  static const Rows<TexturedMeshOptions> rows = textured_rows();
  return rows;
}

}  // namespace pounce::options
