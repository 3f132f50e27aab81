// SPDX-License-Identifier: Apache-2.0
#include "views.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace pounce::score {
namespace {

constexpr Vec3d kGrey{0.5, 0.5, 0.5};
constexpr int kHalfWindow = 5;

Vec3d clamped(Vec3d c) {
  return {std::clamp(c.x, 0.0, 1.0), std::clamp(c.y, 0.0, 1.0), std::clamp(c.z, 0.0, 1.0)};
}

double grey(Vec3d c) { return 0.299 * c.x + 0.587 * c.y + 0.114 * c.z; }

double decibels(double squares, std::size_t pixels) {
  return -10 * std::log10(squares / (3 * static_cast<double>(pixels)));
}

/// Each pixel's mean over its window; what the window has beyond the picture does not count.
std::vector<double> blurred(const std::vector<double>& values, std::uint32_t edge) {
  std::array<double, 2 * kHalfWindow + 1> weights{};
  for (int i = -kHalfWindow; i <= kHalfWindow; ++i)
    weights[static_cast<std::size_t>(i + kHalfWindow)] = std::exp(-i * i / (2 * 1.5 * 1.5));
  const auto pass = [&](const std::vector<double>& in, bool along) {
    std::vector<double> out(in.size());
    const int size = static_cast<int>(edge);
    const auto at = [&](int x, int y) { return static_cast<std::size_t>(y * size + x); };
    for (int y = 0; y < size; ++y) {
      for (int x = 0; x < size; ++x) {
        double sum = 0, all = 0;
        for (int i = -kHalfWindow; i <= kHalfWindow; ++i) {
          const int nx = along ? x + i : x, ny = along ? y : y + i;
          if (nx < 0 || ny < 0 || nx >= size || ny >= size) continue;
          const double weight = weights[static_cast<std::size_t>(i + kHalfWindow)];
          sum += weight * in[at(nx, ny)];
          all += weight;
        }
        out[at(x, y)] = sum / all;
      }
    }
    return out;
  };
  return pass(pass(values, true), false);
}

}  // namespace

std::vector<Vec3d> directions(std::size_t count, double turn) {
  std::vector<Vec3d> all;
  for (std::size_t i = 0; i < count; ++i) {
    const double z = 1 - (2 * static_cast<double>(i) + 1) / static_cast<double>(count);
    const double angle = 2 * std::numbers::pi * (static_cast<double>(i) / std::numbers::phi + turn);
    const double across = std::sqrt(1 - z * z);
    all.push_back({across * std::cos(angle), across * std::sin(angle), z});
  }
  return all;
}

View view_along(const mesh::Mesh& mesh, Vec3d direction, std::uint32_t size) {
  Framing framing;
  framing.from = direction * -1.0;
  framing.up = std::abs(direction.y) < 0.9 ? Vec3d{0, 1, 0} : Vec3d{0, 0, 1};
  framing.size = size;
  return view_of(mesh, framing);
}

void Likeness::add(const Likeness& other) {
  either_squares += other.either_squares;
  both_squares += other.both_squares;
  either += other.either;
  both += other.both;
  ssim += other.ssim;
  gradient += other.gradient;
  scene_gradient += other.scene_gradient;
  depths.insert(depths.end(), other.depths.begin(), other.depths.end());
  trusted.insert(trusted.end(), other.trusted.begin(), other.trusted.end());
}

double Likeness::either_db() const { return decibels(either_squares, either); }
double Likeness::both_db() const { return decibels(both_squares, both); }
double Likeness::iou() const { return static_cast<double>(both) / static_cast<double>(either); }
double Likeness::mean_ssim() const { return ssim / static_cast<double>(either); }
double Likeness::sharpness() const { return gradient / scene_gradient; }

double Likeness::depth(double quantile) const {
  if (depths.empty()) return 0;
  std::vector<double> sorted = depths;
  const auto nth = sorted.begin() +
                   static_cast<std::ptrdiff_t>(quantile * static_cast<double>(sorted.size() - 1));
  std::nth_element(sorted.begin(), nth, sorted.end());
  return *nth;
}

std::vector<double> ssim(const std::vector<Vec3d>& a, const std::vector<Vec3d>& b,
                         std::uint32_t edge) {
  std::vector<double> x, y, xx, yy, xy;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double p = grey(a[i]), q = grey(b[i]);
    x.push_back(p), y.push_back(q);
    xx.push_back(p * p), yy.push_back(q * q), xy.push_back(p * q);
  }
  x = blurred(x, edge), y = blurred(y, edge);
  xx = blurred(xx, edge), yy = blurred(yy, edge), xy = blurred(xy, edge);
  constexpr double kLight = 0.01 * 0.01, kContrast = 0.03 * 0.03;
  std::vector<double> out;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double vx = xx[i] - x[i] * x[i], vy = yy[i] - y[i] * y[i], c = xy[i] - x[i] * y[i];
    out.push_back((2 * x[i] * y[i] + kLight) * (2 * c + kContrast) /
                  ((x[i] * x[i] + y[i] * y[i] + kLight) * (vx + vy + kContrast)));
  }
  return out;
}

Likeness likeness(const Seen& scene, const Seen& mesh, const Seen* trust, std::uint32_t size,
                  double diagonal) {
  Likeness out;
  std::vector<Vec3d> a, b;
  for (std::size_t i = 0; i < scene.cover.size(); ++i) {
    a.push_back(clamped(scene.before(i, kGrey)));
    b.push_back(clamped(mesh.before(i, kGrey)));
  }
  const std::vector<double> alike = ssim(a, b, size);
  const auto in_both = [&](std::size_t i) { return scene.cover[i] > 0.5 && mesh.cover[i] > 0.5; };
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!(scene.cover[i] > 0.5) && !(mesh.cover[i] > 0.5)) continue;
    const Vec3d off = a[i] - b[i];
    out.either_squares += dot(off, off);
    out.ssim += alike[i];
    ++out.either;
    if (!in_both(i)) continue;
    out.both_squares += dot(off, off);
    ++out.both;
    if (trust != nullptr)
      out.trusted.emplace_back(trust->colours[i].x,
                               (std::abs(off.x) + std::abs(off.y) + std::abs(off.z)) / 3);
    if (std::isfinite(scene.depth[i]) && std::isfinite(mesh.depth[i]))
      out.depths.push_back(std::abs(scene.depth[i] - mesh.depth[i]) / diagonal);
    for (const std::size_t step : {std::size_t{1}, std::size_t{size}}) {
      const bool is_last = step == 1 ? i % size + 1 == size : i / size + 1 == size;
      if (is_last || !in_both(i + step)) continue;
      const Vec3d of_scene = a[i + step] - a[i], of_mesh = b[i + step] - b[i];
      out.scene_gradient += dot(of_scene, of_scene);
      out.gradient += dot(of_mesh, of_mesh);
    }
  }
  return out;
}

std::array<double, 4> errors_by_trust(std::vector<std::pair<double, double>> trusted) {
  std::stable_sort(trusted.begin(), trusted.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::array<double, 4> errors{};
  const std::size_t count = trusted.size();
  for (std::size_t q = 0; q < 4; ++q) {
    const std::size_t first = q * count / 4, last = (q + 1) * count / 4;
    for (std::size_t i = first; i < last; ++i) errors[q] += trusted[i].second;
    errors[q] /= static_cast<double>(std::max<std::size_t>(last - first, 1));
  }
  return errors;
}

}  // namespace pounce::score
