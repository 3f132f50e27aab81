// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "core/vec.h"
#include "image.h"
#include "mesh/mesh.h"
#include "scene.h"

namespace pounce::score {

/// An orthographic camera whose picture is square.
struct View {
  Vec3d right, down, forward;  ///< unit, orthogonal
  Vec3d corner;                ///< centre of the upper left pixel
  double pixel = 0;            ///< edge of a pixel in the scene's units
  std::uint32_t size = 0;      ///< pixels along an edge
  /// Triangles that face away are not drawn: a room is seen as a doll's house.
  bool one_sided = false;

  Vec3d place(double x, double y) const {
    return corner + right * (x * pixel) + down * (y * pixel);
  }
};

/// What a camera is to show.
struct Framing {
  Vec3d from{1, 0, 1};               ///< where it stands as seen from the middle; of any length
  Vec3d up{0, 1, 0};                 ///< of any length
  std::optional<Vec3d> middle = {};  ///< default: the mesh's
  std::optional<double> edge = {};   ///< what fits into the picture's edge; default: the whole mesh
  std::uint32_t size = 512;          ///< pixels along an edge
};

/// Throws Error(usage) where `up` does not say how to hold the camera, Error(input) for a mesh
/// without size.
View view_of(const mesh::Mesh& mesh, const Framing& framing);

/// What a camera sees in its pixels, row by row.
struct Seen {
  std::vector<Vec3d> colours;  ///< of what is there, without a background
  std::vector<double> cover;   ///< 0..1: how much of a pixel it takes
  std::vector<double> depth;   ///< from the camera's plane; infinite where nothing takes half of it

  /// A pixel before a background.
  Vec3d before(std::size_t pixel, Vec3d background) const {
    return colours[pixel] * cover[pixel] + background * (1 - cover[pixel]);
  }
};

/// The scene, as render() draws it, with `finer`^2 samples per pixel: as a viewer shows it whose
/// pixels are these, each the mean of its samples.
Seen see_scene(const Scene& scene, const View& view, bool harmonics, std::uint32_t finer);
/// The mesh, as draw_mesh() draws it with `finer`^2 samples per pixel. Without a texture: grey.
/// Throws Error(input) for a mesh without UVs that is to have one.
Seen see_mesh(const mesh::Mesh& mesh, const Image* texture, const View& view, std::uint32_t finer);

/// Bilinear, repeating; v down.
Vec3d lookup(const Image& image, double u, double v);

/// What a triangle shows at a point of it, by the shares of its corners there.
using Shade = std::function<Vec3d(const std::array<double, 3>& shares)>;
/// A mesh whose triangles, by their numbers, show what `shader_of` says: the nearest surface from
/// either side.
Seen see_triangles(const mesh::Mesh& mesh, const View& view, std::uint32_t finer,
                   const std::function<Shade(std::size_t triangle)>& shader_of);

/// What the scene looks like, as render() draws it, before a background; row by row.
std::vector<Vec3d> draw_scene(const Scene& scene, const View& view, bool harmonics,
                              Vec3d background);

/// What the mesh looks like without one: lit faces, and edges in dark lines.
std::vector<Vec3d> draw_wireframe(const mesh::Mesh& mesh, const View& view, Vec3d background);

/// What the mesh looks like with an image on UV set 0, unlit: the nearest surface from either side,
/// bilinear lookup, 2x2 samples per pixel. Throws Error(input) for a mesh without UVs.
std::vector<Vec3d> draw_mesh(const mesh::Mesh& mesh, const Image& texture, const View& view,
                             Vec3d background);

}  // namespace pounce::score
