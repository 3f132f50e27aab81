// SPDX-License-Identifier: Apache-2.0
//
// From a stored block's triangles to Gaussians with a mean, a normal and a covariance.
//
// On a triangle position is affine in the texel: p(x, y) = p0 + jx x + jy y. A texel's square is
// then a parallelogram with edges jx and jy, and its Gaussian has the covariance
// s^2 (jx jx' + jy jy'), s = TexelSampling::sigma. In an orthonormal frame of the triangle's plane
// that is a symmetric 2x2 matrix, whose eigenvectors are the axes of the disc.
//
// A whole triangle as one Gaussian (it holds no texel's centre, is smaller than a texel, or has no
// image) takes the second moments of its own area instead: (v0 v0' + v1 v1' + v2 v2') / 12 with v
// from its centroid. The unit square's are 1/12 along each side, so the same s relates the two:
// s^2 (v0 v0' + v1 v1' + v2 v2').
//
// Splitting (TexelSampling::spacing) makes the surface uniformly dense where texels are large: a
// texel of area n d^2, d the spacing, becomes a grid of about n parts, each what a texel is else,
// at a place between texels. n < 1.5 is left alone, so that at most three times as many Gaussians
// come out as the surface has texels and squares of d together. Triangles without image get texels
// of edge d in their own plane.
//
// The matrix of a thin triangle loses its smaller eigenvalue to rounding: that one comes from the
// determinant, which is the square of an area.
//
// Neighbours (the second half of this file): a texel's colour may be averaged with those beside it
// only where the surface goes on. Beside each other in the image is not enough, for charts touch;
// near each other in space is not enough either, for a fold's two sides do. Both together are. A
// raster of the block and a margin notes for every texel where on the surface it is, up to four
// times where charts overlap.
#include "gaussian/texel_gaussians.h"

#include <algorithm>
#include <cmath>

#include "core/directions.h"
#include "mesh/uv_raster.h"

namespace pounce::gaussian {
namespace {

Vec3d unit(Vec3d v) { return v * (1 / length(v)); }

/// A symmetric 2x2 matrix and its determinant, which is known better than from its entries.
struct Metric {
  double xx = 0, xy = 0, yy = 0;
  void add(Vec2d v) {
    xx += v.x * v.x;
    xy += v.x * v.y;
    yy += v.y * v.y;
  }
};

}  // namespace

/// One triangle, unfolded to double precision: the raster, the shapes and the splitting read this
/// and nothing else, so they agree on which texels a triangle has.
struct MeshGaussians::Corners {
  Vec3d positions[3], normals[3];
  std::array<Vec2d, 3> texels{}, whole_texels{};
  Vec3d face;                             // unit, on the front side
  double doubled_area = 0;                // in space
  double texel_area = 0;                  // doubled, with the sign of its direction in the image
  std::int64_t split_x = 1, split_y = 1;  // parts of a texel: `texels` counts parts
  bool from_plane = false;                // no image: texels were laid into its plane
};

MeshGaussians::Corners MeshGaussians::corners(std::uint32_t triangle) const {
  Corners c;
  Vec3d shading{};
  for (std::size_t k = 0; k < 3; ++k) {
    const std::uint16_t v = block_.triangles[triangle][k];
    c.positions[k] = Vec3d(block_.positions[v]);
    c.normals[k] = Vec3d(block_.normals[v]);
    shading = shading + c.normals[k];
  }
  const Vec3d doubled = cross(c.positions[1] - c.positions[0], c.positions[2] - c.positions[0]);
  c.doubled_area = length(doubled);
  c.face = doubled * (1 / c.doubled_area);
  if (dot(shading, c.face) < 0) c.face = c.face * -1.0;
  if (lattice_.width != 0) {
    c.texels = c.whole_texels = block_.texel_corners(lattice_, triangle);
    c.texel_area = mesh::doubled_area(c.texels[0], c.texels[1], c.texels[2]);
  }
  if (sampling_.spacing > 0) split(c);
  return c;
}

/// Makes texels of their parts where they are larger than the spacing.
void MeshGaussians::split(Corners& c) const {
  constexpr double kWorthIt = 1.5, kMostParts = 4096;
  const double square = sampling_.spacing * sampling_.spacing;
  const Vec3d e1 = c.positions[1] - c.positions[0], e2 = c.positions[2] - c.positions[0];
  if (lattice_.width == 0) {
    if (!(c.doubled_area / 2 >= kWorthIt * square)) return;
    const Vec3d right = unit(e1), up = cross(c.face, right);
    const auto flat = [&](Vec3d v) {
      return Vec2d{dot(v, right) / sampling_.spacing - 0.5, dot(v, up) / sampling_.spacing - 0.5};
    };
    c.texels = {flat({}), flat(e1), flat(e2)};
    c.texel_area = mesh::doubled_area(c.texels[0], c.texels[1], c.texels[2]);
    c.from_plane = true;
    return;
  }
  if (is_single(c)) return;
  const double parts = c.doubled_area / std::abs(c.texel_area) / square;
  if (!(parts >= kWorthIt)) return;
  const Vec2d t1 = c.texels[1] - c.texels[0], t2 = c.texels[2] - c.texels[0];
  const double edge_x = length((e1 * t2.y - e2 * t1.y) * (1 / c.texel_area));
  const double edge_y = length((e2 * t1.x - e1 * t2.x) * (1 / c.texel_area));
  // The longer edge first; the other one takes what is left of the number of parts.
  const double n = std::min(std::round(parts), kMostParts);
  const double along = std::clamp(std::round(std::max(edge_x, edge_y) / sampling_.spacing), 1.0, n);
  const auto longer = static_cast<std::int64_t>(along);
  const auto shorter = static_cast<std::int64_t>(std::max(1.0, std::round(n / along)));
  c.split_x = edge_x >= edge_y ? longer : shorter;
  c.split_y = edge_x >= edge_y ? shorter : longer;
  const auto sx = static_cast<double>(c.split_x), sy = static_cast<double>(c.split_y);
  for (Vec2d& t : c.texels) t = {t.x * sx + (sx - 1) / 2, t.y * sy + (sy - 1) / 2};
  c.texel_area *= sx * sy;
}

/// Is the triangle's own size its Gaussian's? A texel of a triangle smaller than a texel would
/// overhang it, by any amount.
bool MeshGaussians::is_single(const Corners& c) const { return std::abs(c.texel_area) < 2; }

Vec4f MeshGaussians::colour_at(std::uint32_t triangle, double w0, double w1, double w2) const {
  if (block_.colours.empty()) return {1, 1, 1, 1};
  const auto& corners = block_.triangles[triangle];
  const Vec4f &a = block_.colours[corners[0]], &b = block_.colours[corners[1]],
              &c = block_.colours[corners[2]];
  const auto between = [&](float x, float y, float z) {
    return static_cast<float>(x * w0 + y * w1 + z * w2);
  };
  return {between(a.x, b.x, c.x), between(a.y, b.y, c.y), between(a.z, b.z, c.z),
          between(a.w, b.w, c.w)};
}

/// The texels (or parts of texels) that a triangle has in this block. A whole triangle is stored
/// with one block, wherever its texels are. One that is cut is stored with every block it meets,
/// and each block takes only its own window, so that together they have each texel exactly once.
template <class Span>
void MeshGaussians::raster(const Corners& c, const Span& span) const {
  const std::int64_t x = std::int64_t{block_.x} * mesh::kBlockEdge;
  const std::int64_t y = std::int64_t{block_.y} * mesh::kBlockEdge;
  const bool whole = c.from_plane || mesh::is_whole(c.whole_texels, lattice_);
  constexpr std::int64_t kFar = std::int64_t{1} << 40;
  mesh::raster_triangle(
      c.texels,
      whole ? mesh::TexelWindow{-kFar, -kFar, kFar, kFar}
            : mesh::TexelWindow{x * c.split_x, y * c.split_y, (x + mesh::kBlockEdge) * c.split_x,
                                (y + mesh::kBlockEdge) * c.split_y},
      span);
}

/// Counts now, makes later: the store is sized from the counts, and visit() finds the triangle of
/// any Gaussian by bisection. The same raster runs both times.
MeshGaussians::MeshGaussians(const store::GeometryBlock& block, const mesh::Lattice& lattice,
                             const TexelSampling& sampling)
    : block_(block), lattice_(lattice), sampling_(sampling), first_(block.triangles.size() + 1, 0) {
  for (std::uint32_t t = 0; t < block.triangles.size(); ++t) {
    const Corners c = corners(t);
    std::uint64_t count = 0;
    if (c.doubled_area > 0 && std::isfinite(1 / c.doubled_area)) {
      if (c.texel_area != 0) {
        raster(c, [&count](std::int64_t, std::int64_t begin, std::int64_t end) {
          count += static_cast<std::uint64_t>(end - begin);
        });
      }
      if (count == 0 && (lattice.width == 0 || mesh::is_whole(c.whole_texels, lattice))) count = 1;
      const double each =
          is_single(c) ? c.doubled_area / 2 : c.doubled_area / std::abs(c.texel_area);
      area_ += static_cast<double>(count) * each;
    }
    first_[t + 1] = first_[t] + count;
  }
}

void MeshGaussians::visit(std::uint64_t begin, std::uint64_t end,
                          const std::function<void(const MeshGaussian&)>& each) const {
  auto t = static_cast<std::uint32_t>(std::upper_bound(first_.begin(), first_.end(), begin) -
                                      first_.begin() - 1);
  for (; t < block_.triangles.size() && first_[t] < end; ++t) {
    if (first_[t] == first_[t + 1]) continue;
    const Corners c = corners(t);
    const auto at = [&](Vec2d texel, double w1, double w2) {
      MeshGaussian g{};
      const double w0 = 1 - w1 - w2;
      g.mean = Vec3f(c.positions[0] * w0 + c.positions[1] * w1 + c.positions[2] * w2);
      const Vec3d n = c.normals[0] * w0 + c.normals[1] * w1 + c.normals[2] * w2;
      g.normal = Vec3f(dot(n, n) > 1e-12 ? unit(n) : c.face);
      g.triangle = t;
      g.colour = colour_at(t, w0, w1, w2);
      g.x = static_cast<std::int32_t>(std::floor(texel.x));
      g.y = static_cast<std::int32_t>(std::floor(texel.y));
      g.frac_x = static_cast<float>(texel.x - std::floor(texel.x));
      g.frac_y = static_cast<float>(texel.y - std::floor(texel.y));
      each(g);
    };
    bool any = false;
    std::uint64_t next = first_[t];
    const auto span = [&](std::int64_t y, std::int64_t from, std::int64_t to) {
      any = true;
      const std::uint64_t length = static_cast<std::uint64_t>(to - from);
      const std::uint64_t skip = std::min(length, begin > next ? begin - next : 0);
      const std::uint64_t stop = std::min(length, end > next ? end - next : 0);
      for (std::uint64_t i = skip; i < stop; ++i) {
        const Vec2d p{static_cast<double>(from) + static_cast<double>(i), static_cast<double>(y)};
        const Vec2d texel{(p.x + 0.5) / static_cast<double>(c.split_x) - 0.5,
                          (p.y + 0.5) / static_cast<double>(c.split_y) - 0.5};
        at(c.from_plane ? Vec2d{} : texel,
           mesh::doubled_area(c.texels[0], p, c.texels[2]) / c.texel_area,
           mesh::doubled_area(c.texels[0], c.texels[1], p) / c.texel_area);
      }
      next += length;
    };
    if (c.texel_area != 0) raster(c, span);
    if (any) continue;
    const auto& w = c.whole_texels;
    at({(w[0].x + w[1].x + w[2].x) / 3, (w[0].y + w[1].y + w[2].y) / 3}, 1.0 / 3, 1.0 / 3);
  }
}

Footprint MeshGaussians::footprint(std::uint32_t triangle) const {
  const Corners c = corners(triangle);
  const Vec3d e1 = c.positions[1] - c.positions[0], e2 = c.positions[2] - c.positions[0];
  const Vec3d right = unit(e1), up = cross(c.face, right);
  const auto flat = [&](Vec3d v) { return Vec2d{dot(v, right), dot(v, up)}; };
  Metric m;
  double area;  // of the square whose side is one standard deviation, if that were a texel
  if (is_single(c)) {
    const Vec3d centroid = (e1 + e2) * (1.0 / 3);
    m.add(flat(centroid));
    m.add(flat(e1 - centroid));
    m.add(flat(e2 - centroid));
    // The determinant of sum v v' over three vectors that add up to zero: 3 (v1 x v2)^2.
    area = c.doubled_area / std::sqrt(3.0);
  } else {
    const double x1 = c.texels[1].x - c.texels[0].x, y1 = c.texels[1].y - c.texels[0].y;
    const double x2 = c.texels[2].x - c.texels[0].x, y2 = c.texels[2].y - c.texels[0].y;
    m.add(flat((e1 * y2 - e2 * y1) * (1 / c.texel_area)));
    m.add(flat((e2 * x1 - e1 * x2) * (1 / c.texel_area)));
    area = c.doubled_area / std::abs(c.texel_area);
  }
  const double half = (m.xx - m.yy) / 2, root = std::sqrt(half * half + m.xy * m.xy);
  const double large = (m.xx + m.yy) / 2 + root;
  // (large - yy, xy) and (xy, large - xx) are both the eigenvector; the longer one is the exact
  // one. A circle has neither: its texel's x axis will do.
  Vec2d axis = half >= 0 ? Vec2d{half + root, m.xy} : Vec2d{m.xy, root - half};
  const double size = std::sqrt(axis.x * axis.x + axis.y * axis.y);
  axis = size > large * 1e-12 ? Vec2d{axis.x / size, axis.y / size} : Vec2d{1, 0};
  const Vec3d long_axis = right * axis.x + up * axis.y;
  Footprint f{};
  f.sigma[0] = sampling_.sigma * std::sqrt(large);
  f.sigma[1] = sampling_.sigma * area / std::sqrt(large);
  f.sigma[2] = kFlatness * f.sigma[1];
  const auto q = quaternion_of({long_axis, cross(c.face, long_axis), c.face});
  for (std::size_t k = 0; k < q.size(); ++k) f.rotation[k] = q[0] < 0 ? -q[k] : q[k];
  return f;
}

TexelFrame MeshGaussians::frame(std::uint32_t triangle) const {
  const Corners c = corners(triangle);
  const Vec3d e1 = c.positions[1] - c.positions[0], e2 = c.positions[2] - c.positions[0];
  const Vec2d t1 = c.texels[1] - c.texels[0], t2 = c.texels[2] - c.texels[0];
  return {c.texels, c.texel_area,
          std::max(length(e1 * t2.y - e2 * t1.y), length(e2 * t1.x - e1 * t2.x)) /
              std::abs(c.texel_area)};
}

TexelNeighbours::TexelNeighbours() : spots_(std::size_t{kEdge} * kEdge) {}

void TexelNeighbours::start(std::int32_t block_x, std::int32_t block_y) {
  left_ = std::int64_t{block_x} * mesh::kBlockEdge - kMargin;
  top_ = std::int64_t{block_y} * mesh::kBlockEdge - kMargin;
  std::fill(spots_.begin(), spots_.end(), Spot{});
}

void TexelNeighbours::add(const store::GeometryBlock& block, const mesh::Lattice& lattice) {
  const std::int64_t x0 = std::int64_t{block.x} * mesh::kBlockEdge,
                     y0 = std::int64_t{block.y} * mesh::kBlockEdge;
  for (std::size_t t = 0; t < block.triangles.size(); ++t) {
    const std::array<Vec2d, 3> texels = block.texel_corners(lattice, t);
    const double area = mesh::doubled_area(texels[0], texels[1], texels[2]);
    if (area == 0) continue;
    const auto corner = [&](std::size_t k) {
      return Vec3d(block.positions[block.triangles[t][k]]);
    };
    const Vec3d origin = corner(0), e1 = corner(1) - origin, e2 = corner(2) - origin;
    mesh::TexelWindow window{left_, top_, left_ + kEdge, top_ + kEdge};
    if (!mesh::is_whole(texels, lattice)) {  // its other parts are in other blocks
      window = {std::max(window.x0, x0), std::max(window.y0, y0),
                std::min(window.x1, x0 + mesh::kBlockEdge),
                std::min(window.y1, y0 + mesh::kBlockEdge)};
    }
    mesh::raster_triangle(texels, window, [&](std::int64_t y, std::int64_t from, std::int64_t to) {
      for (std::int64_t x = from; x < to; ++x) {
        Spot& spot = spots_[static_cast<std::size_t>((y - top_) * kEdge + x - left_)];
        if (spot.layers == kLayers) continue;
        const Vec2d p{static_cast<double>(x), static_cast<double>(y)};
        const double w1 = mesh::doubled_area(texels[0], p, texels[2]) / area;
        const double w2 = mesh::doubled_area(texels[0], texels[1], p) / area;
        spot.places[spot.layers++] = Vec3f(origin + e1 * w1 + e2 * w2);
      }
    });
  }
}

bool TexelNeighbours::continues(const MeshGaussian& g, const TexelFrame& frame, int dx,
                                int dy) const {
  const std::int64_t x = std::int64_t{g.x} + dx, y = std::int64_t{g.y} + dy;
  if (x >= left_ && x < left_ + kEdge && y >= top_ && y < top_ + kEdge) {
    const Spot& spot = spots_[static_cast<std::size_t>((y - top_) * kEdge + x - left_)];
    // On a flat surface it is a texel's edge away for each step; twice that allows for bends.
    const double reach = 2 * frame.edge * std::sqrt(static_cast<double>(dx * dx + dy * dy));
    const Vec3d here(g.mean);
    for (std::size_t k = 0; k < spot.layers; ++k) {
      const Vec3d to = Vec3d(spot.places[k]) - here;
      if (dot(to, to) <= reach * reach) return true;
    }
    return false;
  }
  const Vec2d p{static_cast<double>(x), static_cast<double>(y)};
  const auto& t = frame.texels;
  for (std::size_t k = 0; k < 3; ++k) {
    if (mesh::doubled_area(t[k], t[(k + 1) % 3], p) * frame.doubled_area < 0) return false;
  }
  return true;
}

}  // namespace pounce::gaussian
