// SPDX-License-Identifier: Apache-2.0
#include "render.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/bounds.h"

namespace pounce::score {
namespace {

constexpr double kFootprint = 0.3;  // of a squared pixel or texel edge
constexpr double kCutOff = 3;       // standard deviations
constexpr double kMostAlpha = 0.99, kLeastAlpha = 1.0 / 255;

struct Frame {
  Vec3d u, v, w;
};

Frame frame_along(Vec3d w) {
  const Vec3d helper = std::abs(w.x) < 0.6 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  Vec3d u = cross(w, helper);
  u = u * (1 / length(u));
  return {u, cross(w, u), w};
}

/// A Gaussian's marginal across a direction, with a footprint.
struct Marginal {
  double xx, xy, yy;      ///< inverse
  double grown = 1;       ///< det / det'
  double lean_x, lean_y;  ///< of the best hit along the direction, per offset
  double half_x, half_y;  ///< of the box out to the cut-off

  Marginal(const Gaussian& g, const Frame& f, double footprint) {
    const Vec3d su = times(g.covariance, f.u), sv = times(g.covariance, f.v);
    const double a = dot(f.u, su), b = dot(f.u, sv), c = dot(f.v, sv);
    const double ga = a + footprint, gc = c + footprint, det = ga * gc - b * b;
    xx = gc / det, xy = -b / det, yy = ga / det;
    grown = std::max(a * c - b * b, 0.0) / det;
    const double wu = dot(f.w, su), wv = dot(f.w, sv);
    lean_x = wu * xx + wv * xy;
    lean_y = wu * xy + wv * yy;
    half_x = kCutOff * std::sqrt(ga);
    half_y = kCutOff * std::sqrt(gc);
  }
  double squared(double dx, double dy) const {
    return xx * dx * dx + 2 * xy * dx * dy + yy * dy * dy;
  }
};

/// Points in the cells of a plane.
class PlaneCells {
 public:
  PlaneCells(std::span<const Point> points, const Frame& f) {
    double lo[2] = {1e300, 1e300}, hi[2] = {-1e300, -1e300};
    for (const Point& p : points) {
      place_.push_back({dot(f.u, p.position), dot(f.v, p.position)});
      lo[0] = std::min(lo[0], place_.back().x), hi[0] = std::max(hi[0], place_.back().x);
      lo[1] = std::min(lo[1], place_.back().y), hi[1] = std::max(hi[1], place_.back().y);
    }
    for (int k = 0; k < 2; ++k) {
      lo_[k] = lo[k];
      step_[k] = std::max((hi[k] - lo[k]) / kEdge, 1e-300);
    }
    begin_.assign(kEdge * kEdge + 1, 0);
    for (const Vec2d& at : place_) ++begin_[cell(at.x, at.y) + 1];
    std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
    index_.resize(points.size());
    std::vector<std::uint32_t> next = begin_;
    for (std::uint32_t i = 0; i < place_.size(); ++i)
      index_[next[cell(place_[i].x, place_[i].y)]++] = i;
  }

  /// use(index, x, y) for the points of a box, and some around it.
  template <class Use>
  void visit(double x, double y, double half_x, double half_y, const Use& use) const {
    const int x0 = axis(x - half_x, 0), x1 = axis(x + half_x, 0), y0 = axis(y - half_y, 1),
              y1 = axis(y + half_y, 1);
    for (int cy = y0; cy <= y1; ++cy) {
      for (std::uint32_t i = begin_[static_cast<std::size_t>(cy * kEdge + x0)];
           i < begin_[static_cast<std::size_t>(cy * kEdge + x1) + 1]; ++i) {
        use(index_[i], place_[index_[i]].x, place_[index_[i]].y);
      }
    }
  }

 private:
  static constexpr int kEdge = 128;
  int axis(double value, int k) const {
    return static_cast<int>(std::clamp((value - lo_[k]) / step_[k], 0.0, kEdge - 1.0));
  }
  std::size_t cell(double x, double y) const {
    return static_cast<std::size_t>(axis(y, 1) * kEdge + axis(x, 0));
  }
  double lo_[2], step_[2];
  std::vector<Vec2d> place_;
  std::vector<std::uint32_t> begin_, index_;
};

}  // namespace

std::vector<Pixel> render(const Scene& scene, std::span<const Point> points, Vec3d direction,
                          double pixel, bool harmonics) {
  const Frame frame = frame_along(direction);
  const PlaneCells cells(points, frame);
  std::vector<std::uint32_t> order(scene.gaussians.size());
  std::iota(order.begin(), order.end(), 0U);
  std::vector<double> depth;
  for (const Gaussian& g : scene.gaussians) depth.push_back(dot(direction, g.mean));
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return depth[a] < depth[b]; });
  std::vector<Pixel> pixels(points.size());
  std::vector<double> through(points.size(), 1);
  for (Pixel& p : pixels) p.median_depth = std::numeric_limits<double>::infinity();
  for (const std::uint32_t i : order) {
    const Gaussian& g = scene.gaussians[i];
    const Marginal m(g, frame, kFootprint * pixel * pixel);
    const double x = dot(frame.u, g.mean), y = dot(frame.v, g.mean);
    const double opacity = g.alpha * (scene.antialiased ? std::sqrt(m.grown) : 1);
    const Vec3d colour = colour_along(scene, g, direction, harmonics);
    cells.visit(x, y, m.half_x, m.half_y, [&](std::uint32_t p, double px, double py) {
      const double q = m.squared(px - x, py - y);
      if (q > kCutOff * kCutOff || through[p] < 1e-5) return;
      const double alpha = std::min(kMostAlpha, opacity * std::exp(-q / 2));
      if (alpha < kLeastAlpha) return;
      pixels[p].colour = pixels[p].colour + colour * (through[p] * alpha);
      const double before = through[p];
      through[p] *= 1 - alpha;
      if (before > 0.5 && through[p] <= 0.5)
        pixels[p].median_depth = depth[i] + m.lean_x * (px - x) + m.lean_y * (py - y);
    });
  }
  for (std::size_t p = 0; p < pixels.size(); ++p) {
    pixels[p].opacity = 1 - through[p];
    if (pixels[p].opacity > 0) pixels[p].colour = pixels[p].colour * (1 / pixels[p].opacity);
  }
  return pixels;
}

std::vector<std::vector<Hit>> hits(const Scene& scene, std::span<const Point> points, double above,
                                   double below) {
  // Cells of space, as long as the rays: a Gaussian's sphere, grown by half a ray, meets few.
  const double half = (above + below) / 2;
  Box3f box;
  std::vector<Vec3d> middle;
  for (const Point& p : points) {
    middle.push_back(p.position + p.normal * ((above - below) / 2));
    box.extend(Vec3f(middle.back()));
  }
  const double cell = std::max(2 * half, length(Vec3d(box.hi) - Vec3d(box.lo)) / 100);
  const auto axis = [&](double v, double lo) {
    return static_cast<int>(std::floor((v - lo) / cell));
  };
  const Vec3d lo(box.lo);
  const int nx = axis(box.hi.x, lo.x) + 1, ny = axis(box.hi.y, lo.y) + 1,
            nz = axis(box.hi.z, lo.z) + 1;
  std::vector<std::vector<std::uint32_t>> cells(static_cast<std::size_t>(nx) * ny * nz);
  const auto index = [&](int x, int y, int z) {
    return (static_cast<std::size_t>(z) * ny + static_cast<std::size_t>(y)) * nx +
           static_cast<std::size_t>(x);
  };
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const auto in = [](int v, int n) { return std::clamp(v, 0, n - 1); };
    cells[index(in(axis(middle[i].x, lo.x), nx), in(axis(middle[i].y, lo.y), ny),
                in(axis(middle[i].z, lo.z), nz))]
        .push_back(i);
  }
  std::vector<std::vector<Hit>> out(points.size());
  std::vector<Frame> frames;
  for (const Point& p : points) frames.push_back(frame_along(p.normal));
  for (std::uint32_t i = 0; i < scene.gaussians.size(); ++i) {
    const Gaussian& g = scene.gaussians[i];
    const double reach = kCutOff * g.sigma[0] + half + cell * 0.05;
    const int x0 = std::max(axis(g.mean.x - reach, lo.x), 0),
              x1 = std::min(axis(g.mean.x + reach, lo.x), nx - 1);
    const int y0 = std::max(axis(g.mean.y - reach, lo.y), 0),
              y1 = std::min(axis(g.mean.y + reach, lo.y), ny - 1);
    const int z0 = std::max(axis(g.mean.z - reach, lo.z), 0),
              z1 = std::min(axis(g.mean.z + reach, lo.z), nz - 1);
    for (int z = z0; z <= z1; ++z) {
      for (int y = y0; y <= y1; ++y) {
        for (int x = x0; x <= x1; ++x) {
          for (const std::uint32_t p : cells[index(x, y, z)]) {
            const Point& point = points[p];
            const Vec3d d = point.position - g.mean;
            const Frame& f = frames[p];
            const double dx = dot(f.u, d), dy = dot(f.v, d);
            const double wide = kCutOff * (g.sigma[0] + point.edge);
            if (dx * dx + dy * dy > wide * wide) continue;
            const Marginal m(g, f, kFootprint * point.edge * point.edge);
            const double q = m.squared(dx, dy);
            if (!(q <= kCutOff * kCutOff)) continue;
            const double t = m.lean_x * dx + m.lean_y * dy - dot(f.w, d);
            if (t > above || t < -below) continue;
            const double opacity = g.alpha * (scene.antialiased ? std::sqrt(m.grown) : 1);
            const double alpha = std::min(kMostAlpha, opacity * std::exp(-q / 2));
            if (alpha >= kLeastAlpha) out[p].push_back({t, alpha, i});
          }
        }
      }
    }
  }
  return out;
}

Vec3d composite(const Scene& scene, std::vector<Hit> hits) {
  std::stable_sort(hits.begin(), hits.end(), [](const Hit& a, const Hit& b) { return a.t > b.t; });
  Vec3d sum;
  double through = 1;
  for (const Hit& hit : hits) {
    const Vec3d c = scene.gaussians[hit.gaussian].colour;
    sum = sum +
          Vec3d{std::max(c.x, 0.0), std::max(c.y, 0.0), std::max(c.z, 0.0)} * (through * hit.alpha);
    through *= 1 - hit.alpha;
  }
  if (through > 1 - 1e-6) return {0.5, 0.5, 0.5};
  return sum * (1 / (1 - through));
}

}  // namespace pounce::score
