// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "grid_chart.h"
#include "recipes.h"
#include "render_image.h"

namespace pounce::fixture {

/// What files a mesh becomes. `stem` is a path without ending.
struct MeshFiles {
  std::string stem;
  bool glb = true, obj = false;
  std::string texture_format;  ///< png, jpg, exr, tif; empty: no texture
};

/// Writes the mesh in the asked formats. Its texture is rendered once: a GLB embeds png and jpg
/// (then the image file stays only if an OBJ needs it); exr and tif are not for glTF, so they stay
/// beside a GLB without texture. Appends the paths written.
void write_textured_mesh(const MeshFiles& files, const GridMesh& mesh, const RenderSpec& spec,
                         const RenderRow& texture, Paths& written);

/// Writes an untextured mesh in the asked formats. Appends the paths written.
void write_plain_mesh(const MeshFiles& files, const GridMesh& mesh, Paths& written);

}  // namespace pounce::fixture
