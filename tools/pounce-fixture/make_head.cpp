// SPDX-License-Identifier: Apache-2.0
#include "cube_charts.h"
#include "head_texture.h"
#include "output_file.h"
#include "recipes.h"
#include "write_textured_mesh.h"

namespace pounce::fixture {

Paths make_head(const HeadOptions& options) {
  make_folder(options.folder);
  Paths written;
  const auto files = [&](const char* name) {
    return MeshFiles{options.folder + "/" + name, options.glb, options.obj, options.texture_format};
  };
  {
    const GridMesh mesh = head_source_charts(source_head(), options.triangles);
    const std::uint32_t size = options.texture_size;
    const HeadTexture texture(mesh, size, size);
    const bool is_exr = options.texture_format == "exr";
    write_textured_mesh(
        files("head_src"), mesh,
        {.width = size, .height = size, .depth = is_exr ? Depth::half : Depth::u8},
        [&](std::uint32_t y, std::span<float> row) { texture.rgb_row(y, row); }, written);
  }
  {
    const GridMesh mesh =
        head_target_charts(source_head(), options.triangles * 13 / 10, Turn(27, 19));
    write_plain_mesh(files("head_same"), mesh, written);
    const std::uint32_t size = options.target_size;
    const HeadTexture truth(mesh, size, size);
    written.push_back(options.folder + "/head_same.truth.png");
    render_image(written.back(),
                 {.width = size, .height = size, .channels = 4, .depth = Depth::u16},
                 [&](std::uint32_t y, std::span<float> row) { truth.truth_row(y, row); });
  }
  const GridMesh other = head_target_charts(other_head(), options.triangles * 8 / 10, Turn(-12, 8));
  write_plain_mesh(files("head_other"), other, written);
  return written;
}

}  // namespace pounce::fixture
