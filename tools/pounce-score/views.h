// SPDX-License-Identifier: Apache-2.0
//
// A scene and a textured mesh, drawn from the same sides all around: how alike they look.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/vec.h"
#include "picture.h"

namespace pounce::score {

/// So many unit vectors spread evenly over all directions: points of a spherical Fibonacci lattice,
/// turned about z by `turn` of a full turn.
std::vector<Vec3d> directions(std::size_t count, double turn = 0);

/// Where a camera stands that looks along a direction, with the whole mesh in its picture.
View view_along(const mesh::Mesh& mesh, Vec3d direction, std::uint32_t size);

/// How alike a scene and a textured mesh look in some views. Squared errors are of colours in 0..1
/// before grey, over three channels.
struct Likeness {
  double either_squares = 0, both_squares = 0;
  std::size_t either = 0, both = 0;  ///< pixels where the one or the other, and where both are
  double ssim = 0;                   ///< sum over the pixels of `either`
  double gradient = 0, scene_gradient = 0;  ///< sums of squares, where both are
  std::vector<double> depths;               ///< how far apart where both are, of the diagonal

  /// Where both are, if the mesh's confidence is known: that, and the mean error of the channels.
  std::vector<std::pair<double, double>> trusted;

  void add(const Likeness& other);
  double either_db() const;
  double both_db() const;
  double iou() const;
  double mean_ssim() const;
  /// Gradient energy of the mesh over that of the scene: below 1 soft, above noisy.
  double sharpness() const;
  double depth(double quantile) const;
};

/// SSIM (Wang et al. 2004) of the grey of two pictures of an edge, at each pixel: windows of 11
/// pixels, Gaussian of 1.5.
std::vector<double> ssim(const std::vector<Vec3d>& a, const std::vector<Vec3d>& b,
                         std::uint32_t edge);

/// `trust`: the mesh with its confidence as a texture, or null.
Likeness likeness(const Seen& scene, const Seen& mesh, const Seen* trust, std::uint32_t size,
                  double diagonal);

/// The mean errors of the four quarters of pixels, from the least trusted to the most.
std::array<double, 4> errors_by_trust(std::vector<std::pair<double, double>> trusted);

}  // namespace pounce::score
