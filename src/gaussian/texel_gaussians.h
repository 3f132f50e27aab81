// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "core/page_pool.h"
#include "mesh/lattice.h"
#include "store/blocks/geometry_block.h"

namespace pounce::gaussian {

/// Standard deviation of a texel's Gaussian in texels, along x and along y
/// (docs/decisions/014-gaussians-out.md).
inline constexpr double kSigmaTexels = 0.5;
/// A disc's thickness over the smaller of its two widths.
inline constexpr double kFlatness = 0.01;

/// The shape that all Gaussians of one triangle share: an ellipse in the triangle's plane.
struct Footprint {
  double sigma[3];     ///< standard deviations in space, largest first; the third is the thickness
  double rotation[4];  ///< unit quaternion w, x, y, z, w >= 0: its matrix's columns are the axes;
                       ///< the third is the triangle's normal on the front side
};

/// One Gaussian of a mesh: what a texel of its image is on the surface, or a whole triangle that
/// holds no texel's centre or has no image.
struct MeshGaussian {
  Vec3f mean, normal;      ///< the interpolated vertex normal, unit
  std::uint32_t triangle;  ///< index in the block
  std::int32_t x, y;       ///< whole texel coordinates of the colour, not wrapped
  float frac_x, frac_y;    ///< and the rest: 0 where the Gaussian is a whole texel
  Vec4f colour;            ///< of the vertices: linear light and alpha; white where they have none
};

/// How the texels of one triangle lie.
struct TexelFrame {
  std::array<Vec2d, 3> texels;  ///< its corners in texels
  double doubled_area;          ///< of these, signed
  double edge;                  ///< of a texel on the surface, the longer one
};

/// How a surface is sampled.
struct TexelSampling {
  double sigma = kSigmaTexels;  ///< standard deviation in texels (or parts of them), > 0
  /// Texels of more than twice its square are split into parts of about that; so are triangles
  /// without image. 0: one Gaussian per texel.
  double spacing = 0;
};

/// The Gaussians of one stored block: by triangle in file order, within a triangle in raster order.
/// Triangles without area in space have none. Block and lattice must live. Const members are
/// thread-safe.
class MeshGaussians {
 public:
  MeshGaussians(const store::GeometryBlock& block, const mesh::Lattice& lattice,
                const TexelSampling& sampling = {});

  std::uint64_t count() const { return first_.back(); }
  /// The surface that these Gaussians stand for: the sum of their texels' (or triangles') areas.
  double area() const { return area_; }
  /// Visits Gaussians [begin, end) in order.
  void visit(std::uint64_t begin, std::uint64_t end,
             const std::function<void(const MeshGaussian&)>& each) const;
  /// The shape of one triangle's Gaussians; the triangle must have some.
  Footprint footprint(std::uint32_t triangle) const;
  /// How the texels of one triangle lie, which must cover some.
  TexelFrame frame(std::uint32_t triangle) const;

 private:
  struct Corners;
  Corners corners(std::uint32_t triangle) const;
  void split(Corners& c) const;
  bool is_single(const Corners& c) const;
  Vec4f colour_at(std::uint32_t triangle, double w0, double w1, double w2) const;
  template <class Span>
  void raster(const Corners& c, const Span& span) const;

  const store::GeometryBlock& block_;
  const mesh::Lattice& lattice_;
  const TexelSampling sampling_;
  double area_ = 0;
  std::vector<std::uint64_t> first_;  ///< by triangle: its first Gaussian; and the end
};

/// Which texels around a Gaussian of a mesh continue its surface: they lie beside it in its chart
/// and in space. Two charts may touch in the image, and a chart may lie on another one: place tells
/// them apart. Knows the triangles of the blocks that it was given; where there are none, a
/// triangle's texels continue as far as the triangle goes.
class TexelNeighbours {
 public:
  static constexpr int kReach = 2;  ///< texels in each direction

  TexelNeighbours();
  /// Begins anew, around this block.
  void start(std::int32_t block_x, std::int32_t block_y);
  /// Notes where the triangles of this or a neighbouring block are.
  void add(const store::GeometryBlock& block, const mesh::Lattice& lattice);
  /// Of a Gaussian of the block in the middle that is a whole texel: does (x + dx, y + dy) continue
  /// its surface? Both at most kReach in size.
  bool continues(const MeshGaussian& g, const TexelFrame& frame, int dx, int dy) const;

  static std::uint64_t bytes() {
    return round_to_pages(std::uint64_t{kEdge} * kEdge * sizeof(Spot));
  }

 private:
  /// Triangles that are no larger than this over the block's border are seen whole; others reach as
  /// far as they like.
  static constexpr int kMargin = 16 + kReach, kEdge = mesh::kBlockEdge + 2 * kMargin;
  static constexpr std::size_t kLayers = 4;  ///< of charts that lie upon each other
  struct Spot {
    std::uint32_t layers = 0;
    std::array<Vec3f, kLayers> places;
  };

  std::int64_t left_ = 0, top_ = 0;
  PageVector<Spot> spots_;  ///< kEdge rows of kEdge
};

}  // namespace pounce::gaussian
