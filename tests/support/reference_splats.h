// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "core/vec.h"
#include "mesh/mesh.h"
#include "pounce/report.h"
#include "support/target_raster.h"

namespace pounce::test {

/// One Gaussian of a scene, in double precision.
struct ReferenceSplat {
  Vec3d mean;
  std::array<double, 3> sigma{};
  std::array<double, 4> rotation{1, 0, 0, 0};  ///< w, x, y, z
  double alpha = 1;
  Vec3d colour;
  Vec3d normal;  ///< zero: none, the shortest axis is meant, both ways
};

/// A target texel: a point of the surface, its unit normal and the texel's edge.
struct ReferenceTexel {
  Vec3d position, normal;
  double edge = 0;
};

struct ReferenceLimits {
  double reach = 0;
  double min_cosine = 0;
  double window = 0;    ///< width of the depth window, before half a texel bounds it
  double discness = 0;  ///< 0..1
  bool antialiased = false;
  double expected = 0;   ///< where along the normal the surface is thought to lie
  double deviation = 0;  ///< from there; 0: a third of the reach
  double fine_edge = std::numeric_limits<double>::infinity();  ///< texels beyond it show means
};

/// Texels look first where most of their target found the scene, if it lies there.
void look_where_found(const TargetReport& target, ReferenceLimits& limits);

/// What one Gaussian gives to one texel before anything is hidden.
struct Contribution {
  double alpha = 0;  ///< opacity x response; 0: nothing
  double mass = 0;   ///< what it adds to the depth profile
  double t = 0;      ///< of the best hit, along the normal
  double disc = 0;   ///< cos^2 x planarity x needle factor
  Vec3d colour;
  bool unsure = false;  ///< at the cut-off or at the end of the reach
};

/// Covariance of a Gaussian, row by row.
std::array<double, 9> covariance(const ReferenceSplat& splat);

/// The textbook formulas of one pair: tangent basis, 2x2 marginal, its inverse, the conditional
/// mean. Alpha 0: beyond the cut-off or the reach, or facing away.
Contribution contribution(const ReferenceSplat& splat, const ReferenceTexel& texel,
                          const ReferenceLimits& limits);

struct ReferenceBlend {
  bool covered = false;
  Vec3d colour;
  double opacity = 0;
  double distance = 0;
  bool unsure = false;  ///< another surface is as good to within rounding
};

/// How far a scene's Gaussians are the discs of a surface, from how round and how thick
/// they are.
double reference_discness(const std::vector<ReferenceSplat>& scene);

/// The longest edge of a fine texel, from the median of the Gaussians' largest deviations.
double reference_fine_edge(const std::vector<ReferenceSplat>& scene);

/// Every Gaussian against one texel. Slow and obvious; shares no code with the product.
ReferenceBlend reference_blend(const std::vector<ReferenceSplat>& scene,
                               const ReferenceTexel& texel, const ReferenceLimits& limits);

/// The Gaussians of a binary little-endian 3DGS PLY whose vertex element comes first and holds
/// floats only.
std::vector<ReferenceSplat> read_reference_splats(const std::string& path);

/// Writes such a file, with normals if any Gaussian has one; rounded to floats. `comment` is a line
/// of the header if it is not empty.
void write_reference_splats(const std::string& path, const std::vector<ReferenceSplat>& scene,
                            const std::string& comment = "");

/// The texel of a mesh's UV image, from its raster; nothing where no triangle covers it or the
/// triangle has no area or normal there.
std::optional<ReferenceTexel> reference_texel(const mesh::Mesh& mesh, const TargetRaster& raster,
                                              std::size_t texel);

}  // namespace pounce::test
