// SPDX-License-Identifier: Apache-2.0
//
// The baseline: the method as the poster describes it, done to the letter.
//
// Every source texel is a Gaussian of its own, mean on the surface and covariance (half a texel)^2
// along the texel's two edges. The target's texels have position and normal. A uniform grid over
// the target has about as many cells as the target has texels; a Gaussian is listed in every cell
// that its three-sigma box touches. A target texel adds up the Gaussians of its cell, each weighted
// by its response along the normal: in the tangent plane with basis T that is exp(-1/2 D' (T S
// T')^-1 D), D = T (x - mean). Timed: mesh to Gaussians, grid, maps, projection and the 8-bit
// store; reading and writing files is not.
#include <algorithm>
#include <cmath>

#include "bench_input.h"
#include "mesh/uv_raster.h"

namespace pounce::bench {
namespace {

constexpr float kSigma = 0.5F;  // of a source texel
constexpr float kReach = 3.0F;  // sigmas
constexpr float kFlat = 1e-4F;  // thickness of a Gaussian along its normal, in texels

struct Gaussian {
  Vec3f mean;
  float cov[6];  ///< xx xy xz yy yz zz
  Vec3f colour;  ///< 0..255
};

/// The texture of the reference job, RGB.
struct Picture {
  std::uint32_t width = 0;
  std::vector<std::byte> rgb;

  explicit Picture(PreparedJob& job) : width(job.colours->directory().width) {
    const store::ColourDirectory& image = job.colours->directory();
    rgb.resize(std::size_t{width} * image.height * 3);
    const auto tiles = colour_tiles(job);
    for (std::uint32_t y = 0; y < image.height; ++y) {
      for (std::uint32_t x = 0; x < width; ++x) {
        const store::ColourTile& tile =
            tiles[y / mesh::kBlockEdge * image.tiles_x() + x / mesh::kBlockEdge];
        const std::size_t at = (y % mesh::kBlockEdge + store::kApron) * store::kColourTileEdge +
                               x % mesh::kBlockEdge + store::kApron;
        std::copy_n(&tile[at * image.texel_bytes()], 3, &rgb[(std::size_t{y} * width + x) * 3]);
      }
    }
  }
};

Gaussian make_gaussian(Vec3d mean, Vec3d du, Vec3d dv, const std::byte* rgb) {
  Gaussian g;
  g.mean = Vec3f(mean);
  const Vec3f a = Vec3f(du) * kSigma, b = Vec3f(dv) * kSigma;
  const Vec3f n = cross(a, b);
  const float thin = kFlat * length(a) / std::max(length(n), 1e-30F);
  const Vec3f c = n * thin;
  const auto sum = [&](float Vec3f::*i, float Vec3f::*j) {
    return a.*i * a.*j + b.*i * b.*j + c.*i * c.*j;
  };
  g.cov[0] = sum(&Vec3f::x, &Vec3f::x), g.cov[1] = sum(&Vec3f::x, &Vec3f::y);
  g.cov[2] = sum(&Vec3f::x, &Vec3f::z), g.cov[3] = sum(&Vec3f::y, &Vec3f::y);
  g.cov[4] = sum(&Vec3f::y, &Vec3f::z), g.cov[5] = sum(&Vec3f::z, &Vec3f::z);
  const auto sample = [&](int i) { return static_cast<float>(std::to_integer<int>(rgb[i])); };
  g.colour = {sample(0), sample(1), sample(2)};
  return g;
}

/// One Gaussian per texel centre that a source triangle covers.
std::vector<Gaussian> mesh_to_gaussians(const PreparedJob& job, const Picture& picture) {
  std::vector<Gaussian> gaussians;
  gaussians.reserve(job.source_texels());
  const mesh::Lattice& lattice = job.source_lattice();
  const std::int64_t width = lattice.width, height = lattice.height;
  for (std::uint32_t t = 0; t < job.source.triangles.size(); ++t) {
    const auto corners = mesh::texel_corners(job.source, lattice, {t, 0, 0});
    const auto& vertex = job.source.triangles[t];
    const Vec3d p0(job.source.positions[vertex[0]]);
    const Vec3d e1 = Vec3d(job.source.positions[vertex[1]]) - p0;
    const Vec3d e2 = Vec3d(job.source.positions[vertex[2]]) - p0;
    const Vec2d t1 = corners[1] - corners[0], t2 = corners[2] - corners[0];
    const double area = t1.x * t2.y - t1.y * t2.x;
    const Vec3d du = (e1 * t2.y - e2 * t1.y) * (1 / area);
    const Vec3d dv = (e2 * t1.x - e1 * t2.x) * (1 / area);
    mesh::raster_triangle(
        corners, {0, 0, width, height}, [&](std::int64_t y, std::int64_t begin, std::int64_t end) {
          for (std::int64_t x = begin; x < end; ++x) {
            const Vec3d mean = p0 + du * (static_cast<double>(x) - corners[0].x) +
                               dv * (static_cast<double>(y) - corners[0].y);
            gaussians.push_back(make_gaussian(
                mean, du, dv, &picture.rgb[static_cast<std::size_t>(y * width + x) * 3]));
          }
        });
  }
  return gaussians;
}

/// About one cell per target texel, if texels filled space.
class LiteralGrid {
 public:
  LiteralGrid(const std::vector<TargetTexel>& texels, const std::vector<Gaussian>& gaussians) {
    for (const TargetTexel& texel : texels) box_.extend(texel.position);
    axis_ = static_cast<std::uint32_t>(std::cbrt(static_cast<double>(texels.size()))) + 1;
    const Vec3f size = box_.hi - box_.lo;
    const auto cells = static_cast<float>(axis_);
    per_cell_ = {cells / std::max(size.x, 1e-30F), cells / std::max(size.y, 1e-30F),
                 cells / std::max(size.z, 1e-30F)};
    starts_.assign(std::size_t{axis_} * axis_ * axis_ + 1, 0);
    for (const Gaussian& g : gaussians) visit(g, [&](std::size_t cell) { ++starts_[cell + 1]; });
    for (std::size_t c = 1; c < starts_.size(); ++c) starts_[c] += starts_[c - 1];
    entries_.resize(starts_.back());
    std::vector<std::uint32_t> next(starts_.begin(), starts_.end() - 1);
    for (std::uint32_t i = 0; i < gaussians.size(); ++i)
      visit(gaussians[i], [&](std::size_t cell) { entries_[next[cell]++] = i; });
  }

  std::span<const std::uint32_t> at(Vec3f p) const {
    const std::size_t cell =
        index(along(p.x, box_.lo.x, per_cell_.x), along(p.y, box_.lo.y, per_cell_.y),
              along(p.z, box_.lo.z, per_cell_.z));
    return std::span(entries_).subspan(starts_[cell], starts_[cell + 1] - starts_[cell]);
  }

 private:
  std::uint32_t along(float v, float lo, float per_cell) const {
    return static_cast<std::uint32_t>(
        std::clamp((v - lo) * per_cell, 0.0F, static_cast<float>(axis_ - 1)));
  }
  std::size_t index(std::uint32_t x, std::uint32_t y, std::uint32_t z) const {
    return (std::size_t{z} * axis_ + y) * axis_ + x;
  }
  template <class Visit>
  void visit(const Gaussian& g, Visit&& visit) const {
    const Vec3f reach{kReach * std::sqrt(g.cov[0]), kReach * std::sqrt(g.cov[3]),
                      kReach * std::sqrt(g.cov[5])};
    const Vec3f lo = g.mean - reach, hi = g.mean + reach;
    if (!box_.overlaps({lo, hi})) return;
    for (std::uint32_t z = along(lo.z, box_.lo.z, per_cell_.z);
         z <= along(hi.z, box_.lo.z, per_cell_.z); ++z) {
      for (std::uint32_t y = along(lo.y, box_.lo.y, per_cell_.y);
           y <= along(hi.y, box_.lo.y, per_cell_.y); ++y) {
        for (std::uint32_t x = along(lo.x, box_.lo.x, per_cell_.x);
             x <= along(hi.x, box_.lo.x, per_cell_.x); ++x) {
          visit(index(x, y, z));
        }
      }
    }
  }

  Box3f box_;
  std::uint32_t axis_ = 1;
  Vec3f per_cell_;
  std::vector<std::uint32_t> starts_, entries_;
};

/// Response of a Gaussian along the ray through d (from its mean) with tangents a and b.
float response(const Gaussian& g, Vec3f d, Vec3f a, Vec3f b) {
  const auto times_cov = [&](Vec3f v) {
    return Vec3f{g.cov[0] * v.x + g.cov[1] * v.y + g.cov[2] * v.z,
                 g.cov[1] * v.x + g.cov[3] * v.y + g.cov[4] * v.z,
                 g.cov[2] * v.x + g.cov[4] * v.y + g.cov[5] * v.z};
  };
  const Vec3f ca = times_cov(a), cb = times_cov(b);
  const float aa = dot(a, ca), ab = dot(a, cb), bb = dot(b, cb);
  const float determinant = aa * bb - ab * ab;
  if (!(determinant > 0)) return 0;
  const float x = dot(a, d), y = dot(b, d);
  const float q = (bb * x * x - 2 * ab * x * y + aa * y * y) / determinant;
  return q < kReach * kReach ? std::exp(-0.5F * q) : 0;
}

struct LiteralResult {
  std::vector<std::uint8_t> rgba;
  std::uint64_t tested = 0, contributing = 0, covered = 0;
};

LiteralResult project_literally(const std::vector<TargetTexel>& texels,
                                const std::vector<Gaussian>& gaussians, const LiteralGrid& grid) {
  LiteralResult result;
  result.rgba.resize(texels.size() * 4);
  for (std::size_t i = 0; i < texels.size(); ++i) {
    const auto& [position, n] = texels[i];
    const Vec3f across = std::abs(n.x) < 0.5F ? Vec3f{1, 0, 0} : Vec3f{0, 1, 0};
    const Vec3f unscaled = cross(n, across);
    const Vec3f a = unscaled * (1 / std::max(length(unscaled), 1e-30F));
    const Vec3f b = cross(n, a);
    Vec3f sum;
    float weights = 0;
    for (const std::uint32_t g : grid.at(position)) {
      ++result.tested;
      const float weight = response(gaussians[g], position - gaussians[g].mean, a, b);
      if (weight == 0) continue;
      ++result.contributing;
      weights += weight;
      sum = sum + gaussians[g].colour * weight;
    }
    if (weights == 0) continue;
    ++result.covered;
    const auto stored = [&](float v) { return static_cast<std::uint8_t>(v / weights + 0.5F); };
    result.rgba[i * 4] = stored(sum.x);
    result.rgba[i * 4 + 1] = stored(sum.y);
    result.rgba[i * 4 + 2] = stored(sum.z);
    result.rgba[i * 4 + 3] = 255;
  }
  return result;
}

/// Compare with transfer_in_core's counter `kernel`.
void literal_same(benchmark::State& state) {
  PreparedJob& job = prepared_job(Shape::same, state.range(0));
  const Picture picture(job);
  LiteralResult result;
  for (auto _ : state) {
    const std::vector<Gaussian> gaussians = mesh_to_gaussians(job, picture);
    const std::vector<TargetTexel> texels = target_texels(job);
    const LiteralGrid grid(texels, gaussians);
    result = project_literally(texels, gaussians, grid);
  }
  const auto texels = static_cast<double>(job.target_texels());
  count_work(state, "texel", texels);
  state.counters["tested_per_texel"] = static_cast<double>(result.tested) / texels;
  state.counters["contributing_per_texel"] = static_cast<double>(result.contributing) / texels;
  state.counters["covered"] = static_cast<double>(result.covered) / texels;
}
BENCHMARK(literal_same)->Arg(1024)->Arg(2048)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace pounce::bench
