// SPDX-License-Identifier: Apache-2.0
#include "support/reference_gaussians.h"

#include <algorithm>
#include <cmath>

namespace pounce::test {
namespace {

constexpr double kCutOff = 3;

Vec3d times(const std::array<double, 6>& s, Vec3d v) {
  return {s[0] * v.x + s[1] * v.y + s[2] * v.z, s[1] * v.x + s[3] * v.y + s[4] * v.z,
          s[2] * v.x + s[4] * v.y + s[5] * v.z};
}

struct Response {
  double squared = 1e300;  ///< Mahalanobis distance of the ray
  double t = 0;            ///< where it is nearest
  double value() const { return squared <= kCutOff * kCutOff ? std::exp(-squared / 2) : 0; }
};

/// Of a Gaussian along x + t n: tangent basis, 2x2 marginal, its inverse, the conditional mean.
Response response(const TexelAsGaussian& g, const ReferenceTexel& texel) {
  const Vec3d n = texel.normal;
  const Vec3d across = std::abs(n.x) < 0.5 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  Vec3d u = cross(n, across);
  u = u * (1 / length(u));
  const Vec3d v = cross(n, u);
  const Vec3d su = times(g.covariance, u), sv = times(g.covariance, v);
  const double a = dot(u, su), b = dot(u, sv), c = dot(v, sv), det = a * c - b * b;
  Response out;
  if (!(det > 0)) return out;
  const Vec3d d = g.mean - texel.position;
  const double x = dot(u, d), y = dot(v, d);
  const double ix = (c * x - b * y) / det, iy = (a * y - b * x) / det;
  out.squared = x * ix + y * iy;
  out.t = dot(n, d) - (dot(n, su) * ix + dot(n, sv) * iy);
  return out;
}

}  // namespace

std::vector<TexelAsGaussian> texels_as_gaussians(const mesh::Mesh& mesh, const WholeImage& image,
                                                 double sigma, double thickness) {
  const TargetRaster raster = raster_target(mesh, image.width, image.height);
  std::vector<TexelAsGaussian> out;
  for (std::size_t i = 0; i < raster.owner.size(); ++i) {
    const auto texel = reference_texel(mesh, raster, i);
    if (!texel) continue;
    const auto& corner = mesh.triangles[static_cast<std::size_t>(raster.owner[i])];
    std::array<Vec2d, 3> at;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec2f uv = mesh.uv_sets[0][corner[k]];
      at[k] = {double{uv.x} * image.width, double{uv.y} * image.height};
    }
    const Vec2d s = at[1] - at[0], t = at[2] - at[0];
    const Vec3d p(mesh.positions[corner[0]]);
    const Vec3d e = Vec3d(mesh.positions[corner[1]]) - p, f = Vec3d(mesh.positions[corner[2]]) - p;
    const double area = s.x * t.y - s.y * t.x;
    const Vec3d a = (e * t.y - f * s.y) * (sigma / area), b = (f * s.x - e * t.x) * (sigma / area);
    const Vec3d n = cross(a, b);
    const double large =
        (dot(a, a) + dot(b, b)) / 2 + std::hypot((dot(a, a) - dot(b, b)) / 2, dot(a, b));
    const Vec3d c = n * (thickness / std::sqrt(large));  // |n| / sqrt(large) is the smaller width
    TexelAsGaussian g;
    g.mean = texel->position;
    g.normal = texel->normal;
    const auto sum = [&](double Vec3d::*x, double Vec3d::*y) {
      return a.*x * a.*y + b.*x * b.*y + c.*x * c.*y;
    };
    g.covariance = {sum(&Vec3d::x, &Vec3d::x), sum(&Vec3d::x, &Vec3d::y),
                    sum(&Vec3d::x, &Vec3d::z), sum(&Vec3d::y, &Vec3d::y),
                    sum(&Vec3d::y, &Vec3d::z), sum(&Vec3d::z, &Vec3d::z)};
    g.colour = {image.colour(i, 0), image.colour(i, 1), image.colour(i, 2)};
    if (image.channels == 4) g.alpha = image.at(i, 3);
    out.push_back(g);
  }
  return out;
}

RayBlend ray_blend(const std::vector<TexelAsGaussian>& gaussians, const ReferenceTexel& texel,
                   const RayBlendLimits& limits) {
  struct Met {
    double t, plain;
    const TexelAsGaussian* gaussian;
  };
  std::vector<Met> met;
  for (const TexelAsGaussian& g : gaussians) {
    const Vec3d d = g.mean - texel.position;
    const double width = kCutOff * std::sqrt(g.covariance[0] + g.covariance[3] + g.covariance[5]);
    if (length(cross(d, texel.normal)) > width) continue;
    const double cosine = dot(g.normal, texel.normal);
    if (cosine < limits.min_cosine) continue;
    const Response r = response(g, texel);
    if (r.value() > 0) met.push_back({std::abs(r.t), r.value() * cosine, &g});
  }
  RayBlend out;
  double reach = std::min(limits.first_reach, limits.max_distance);
  for (;;) {
    double weights = 0, plain = 0;
    Vec3d colour;
    for (const Met& m : met) {
      if (std::abs(m.t - reach) < 1e-4 * reach) out.unsure = true;
      if (m.t >= reach) continue;
      const double weight = m.plain * std::max(m.gaussian->alpha, 0x1p-20);
      plain += m.plain;
      weights += weight;
      colour = colour + m.gaussian->colour * weight;
    }
    if (weights > 0) {
      out.covered = true;
      out.colour = colour * (1 / weights);
      out.alpha = weights / plain;
      return out;
    }
    if (reach >= limits.max_distance) return out;
    reach = std::min(2 * reach, limits.max_distance);
  }
}

LiteralBlend::LiteralBlend(const std::vector<TexelAsGaussian>& gaussians,
                           const std::vector<ReferenceTexel>& target)
    : gaussians_(gaussians), low_{1e30, 1e30, 1e30}, high_{-1e30, -1e30, -1e30} {
  for (const ReferenceTexel& texel : target) {
    const Vec3d p = texel.position;
    low_ = {std::min(low_.x, p.x), std::min(low_.y, p.y), std::min(low_.z, p.z)};
    high_ = {std::max(high_.x, p.x), std::max(high_.y, p.y), std::max(high_.z, p.z)};
  }
  axis_ = std::floor(std::cbrt(static_cast<double>(target.size()))) + 1;
}

std::array<int, 3> LiteralBlend::cell(Vec3d p) const {
  const auto along = [&](double v, double low, double high) {
    return static_cast<int>(
        std::clamp((v - low) * axis_ / std::max(high - low, 1e-30), 0.0, axis_ - 1));
  };
  return {along(p.x, low_.x, high_.x), along(p.y, low_.y, high_.y), along(p.z, low_.z, high_.z)};
}

std::optional<Vec3d> LiteralBlend::colour(const ReferenceTexel& texel) const {
  const auto own = cell(texel.position);
  Vec3d colour;
  double weights = 0;
  for (const TexelAsGaussian& g : gaussians_) {
    const Vec3d reach{kCutOff * std::sqrt(g.covariance[0]), kCutOff * std::sqrt(g.covariance[3]),
                      kCutOff * std::sqrt(g.covariance[5])};
    const auto low = cell(g.mean - reach), high = cell(g.mean + reach);
    bool listed = true;
    for (std::size_t k = 0; k < 3; ++k) listed = listed && low[k] <= own[k] && own[k] <= high[k];
    if (!listed) continue;
    const double weight = response(g, texel).value();
    weights += weight;
    colour = colour + g.colour * weight;
  }
  if (!(weights > 0)) return std::nullopt;
  return colour * (1 / weights);
}

}  // namespace pounce::test
