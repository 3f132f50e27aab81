// SPDX-License-Identifier: Apache-2.0
#include "scene.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "core/portable_math.h"
#include "io/splats/scene.h"

namespace pounce::score {
namespace {

Vec3d axis_of(const std::array<float, 4>& q, std::size_t k) {
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  if (k == 0) return {1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)};
  if (k == 1) return {2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)};
  return {2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)};
}

Gaussian gaussian_of(const store::Splat& splat) {
  Gaussian g;
  g.mean = Vec3d(splat.mean);
  g.alpha = splat.alpha;
  g.colour = Vec3d(splat.colour);
  const std::array<double, 3> sigma{splat.sigma.x, splat.sigma.y, splat.sigma.z};
  std::array<std::size_t, 3> order{0, 1, 2};
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return sigma[a] > sigma[b]; });
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3d a = g.axis[k] = axis_of(splat.rotation, order[k]);
    const double s = g.sigma[k] = sigma[order[k]];
    const std::array<double, 6> outer{a.x * a.x, a.x * a.y, a.x * a.z,
                                      a.y * a.y, a.y * a.z, a.z * a.z};
    for (std::size_t i = 0; i < 6; ++i) g.covariance[i] += s * s * outer[i];
  }
  return g;
}

}  // namespace

Scene read_scene(const std::string& path) {
  const auto file = io::open_splat_scene(path, Axes{});
  file->prepare({&posix_file_system(), std::filesystem::temp_directory_path().string()}, [] {});
  const io::SplatSceneInfo& info = file->info();
  store::SplatRows rows;
  rows.lobes = store::kLobesOfDegree[std::min<std::size_t>(info.sh_degree, 3)];
  store::SplatCounts filtered{};
  file->read(0, info.splats, rows, filtered);
  Scene scene;
  scene.antialiased = info.model == store::SplatModel::antialiased;
  scene.lobes = rows.lobes;
  for (const store::Splat& splat : rows.splats) {
    Gaussian& g = scene.gaussians.emplace_back(gaussian_of(splat));
    g.sh = static_cast<std::uint32_t>(scene.sh.size());
    const auto coefficient = [&](std::size_t at) {
      return static_cast<double>(half_to_float(rows.sh[3 * std::size_t{g.sh} + at]));
    };
    for (std::size_t k = 0; k < rows.lobes; ++k)
      scene.sh.push_back({coefficient(3 * k), coefficient(3 * k + 1), coefficient(3 * k + 2)});
  }
  return scene;
}

Vec3d times(const std::array<double, 6>& m, Vec3d v) {
  return {m[0] * v.x + m[1] * v.y + m[2] * v.z, m[1] * v.x + m[3] * v.y + m[4] * v.z,
          m[2] * v.x + m[4] * v.y + m[5] * v.z};
}

Vec3d colour_along(const Scene& scene, const Gaussian& gaussian, Vec3d d, bool harmonics) {
  Vec3d sum = gaussian.colour;
  if (harmonics && scene.lobes > 0) {
    const double xx = d.x * d.x, yy = d.y * d.y, zz = d.z * d.z;
    const std::array<double, 15> basis{-0.4886025119029199 * d.y,
                                       0.4886025119029199 * d.z,
                                       -0.4886025119029199 * d.x,
                                       1.0925484305920792 * d.x * d.y,
                                       -1.0925484305920792 * d.y * d.z,
                                       0.31539156525252005 * (2 * zz - xx - yy),
                                       -1.0925484305920792 * d.x * d.z,
                                       0.5462742152960396 * (xx - yy),
                                       -0.5900435899266435 * d.y * (3 * xx - yy),
                                       2.890611442640554 * d.x * d.y * d.z,
                                       -0.4570457994644658 * d.y * (4 * zz - xx - yy),
                                       0.3731763325901154 * d.z * (2 * zz - 3 * xx - 3 * yy),
                                       -0.4570457994644658 * d.x * (4 * zz - xx - yy),
                                       1.445305721320277 * d.z * (xx - yy),
                                       -0.5900435899266435 * d.x * (xx - 3 * yy)};
    for (std::size_t k = 0; k < scene.lobes; ++k) sum = sum + scene.sh[gaussian.sh + k] * basis[k];
  }
  return {std::max(sum.x, 0.0), std::max(sum.y, 0.0), std::max(sum.z, 0.0)};
}

}  // namespace pounce::score
