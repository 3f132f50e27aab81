// SPDX-License-Identifier: Apache-2.0
#include "grid_chart.h"
#include "output_file.h"
#include "recipes.h"
#include "write_textured_mesh.h"

namespace pounce::fixture {

Paths make_one_texel(const OneTexelOptions& options) {
  make_folder(options.folder);
  GridChart quad;
  quad.name = "quad";
  quad.columns = quad.rows = 1;
  quad.uv_sets.push_back(fit_frame(1, 1, {0, 0}, {1, 1}));
  quad.point = [](std::uint32_t column, std::uint32_t row) {
    return SurfacePoint{{column * 1.0, 1.0 - row, 0}, {0, 0, 1}};
  };
  const GridMesh mesh{quad};
  const bool obj = options.mesh_format == "obj";
  Paths written;
  const MeshFiles source{options.folder + "/one_texel_src", !obj, obj, options.image_format};
  const bool is_exr = options.image_format == "exr";
  write_textured_mesh(
      source, mesh, {.width = 1, .height = 1, .depth = is_exr ? Depth::half : Depth::u8},
      [](std::uint32_t, std::span<float> row) {
        row[0] = 0.8F;
        row[1] = 0.4F;
        row[2] = 0.2F;
      },
      written);
  write_plain_mesh({options.folder + "/one_texel_target", !obj, obj, {}}, mesh, written);
  return written;
}

}  // namespace pounce::fixture
