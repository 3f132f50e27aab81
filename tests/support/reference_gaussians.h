// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "core/vec.h"
#include "mesh/mesh.h"
#include "support/reference_splats.h"
#include "support/target_raster.h"
#include "support/whole_image.h"

namespace pounce::test {

/// A texel of a textured mesh as a Gaussian, in double precision.
struct TexelAsGaussian {
  Vec3d mean, normal;
  std::array<double, 6> covariance{};  ///< xx xy xz yy yz zz
  double alpha = 1;
  Vec3d colour;
};

/// One per texel that a triangle of UV set 0 covers, from a raster of this test's own. Thickness is
/// a share of a texel's smaller width.
std::vector<TexelAsGaussian> texels_as_gaussians(const mesh::Mesh& mesh, const WholeImage& image,
                                                 double sigma, double thickness);

struct RayBlendLimits {
  double max_distance = 0, first_reach = 0, min_cosine = 0;
};
struct RayBlend {
  bool covered = false;
  Vec3d colour;
  double alpha = 0;
  bool unsure = false;  ///< rounding decides whether a Gaussian is in reach
};
/// What docs/paper.md says, Gaussian by Gaussian: all within reach, by alpha, response and cosine;
/// twice the reach where nothing is.
RayBlend ray_blend(const std::vector<TexelAsGaussian>& gaussians, const ReferenceTexel& texel,
                   const RayBlendLimits& limits);

/// The sums of bench/bench_literal.cpp: all Gaussians that the texel's cell of a grid over the
/// target lists, by response alone.
class LiteralBlend {
 public:
  LiteralBlend(const std::vector<TexelAsGaussian>& gaussians,
               const std::vector<ReferenceTexel>& target);
  std::optional<Vec3d> colour(const ReferenceTexel& texel) const;

 private:
  std::array<int, 3> cell(Vec3d p) const;
  const std::vector<TexelAsGaussian>& gaussians_;
  Vec3d low_, high_;
  double axis_ = 1;
};

}  // namespace pounce::test
