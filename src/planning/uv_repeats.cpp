// SPDX-License-Identifier: Apache-2.0
//
// A transfer does not mind: an image that repeats is stored once. As Gaussians each repetition is
// written again, so one triangle with a stray coordinate can ask for more than a disk holds. Both
// conditions must hold for a warning, since repeating is usual and large images are, too.
#include "planning/uv_repeats.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace pounce::planning {
namespace {

/// Images that are laid this often over a surface are seen on purpose (bricks, grass) ...
constexpr double kUsualRepeats = 64;
/// ... and as long as the texels are no more than those of an image of 8192 x 8192, who cares.
constexpr double kUsualTexels = 8192.0 * 8192.0;

/// The texels that the triangles of a page cover, and the most that one of them does.
struct Covered {
  double texels = 0, most = 0;
  std::size_t triangle = 0;  ///< that one
};

}  // namespace

void warn_of_repeats(const surface::GeometryRequest& request, std::vector<std::string>& warnings) {
  const mesh::Mesh& mesh = *request.mesh;
  std::vector<Covered> pages(request.pages.size());
  for (std::size_t page = 0; page < pages.size(); ++page) {
    const mesh::Lattice& lattice = request.pages[page];
    if (lattice.width == 0) continue;
    Covered& sum = pages[page];
    for (const std::uint32_t t : request.triangles->of(page)) {
      const auto corner = [&](std::size_t i) {
        return to_texel(lattice, mesh.uv_sets[lattice.uv_set][mesh.triangles[t][i]]);
      };
      const double texels = std::abs(mesh::doubled_area(corner(0), corner(1), corner(2))) / 2;
      sum.texels += texels;
      if (texels > sum.most) sum.most = texels, sum.triangle = t;
    }
  }
  // Pages beyond the materials are those of triangles without UVs, which repeat nothing.
  for (std::size_t page = 0; page < std::min(pages.size(), mesh.materials.size()); ++page) {
    const mesh::Lattice& lattice = request.pages[page];
    const double image = double{1} * lattice.width * lattice.height;
    const Covered& sum = pages[page];
    if (sum.texels <= kUsualTexels || sum.texels <= kUsualRepeats * image) continue;
    warnings.push_back(
        fmt::format("{}: the UVs of material \"{}\" repeat its image {:.0f} times, triangle {} "
                    "alone {:.0f} times, which gives {:.0f} million Gaussians; repair the texture "
                    "coordinates if this is not intended",
                    mesh.path, mesh.materials[page].name, sum.texels / image, sum.triangle,
                    sum.most / image, sum.texels / 1e6));
  }
}

}  // namespace pounce::planning
