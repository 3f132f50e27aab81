// SPDX-License-Identifier: Apache-2.0
#include "support/reference_splats.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>

namespace pounce::test {
namespace {

constexpr double kFootprint = 0.3;  // of a squared texel edge
constexpr double kCutOff = 3;       // standard deviations

std::array<double, 9> matrix(const std::array<double, 4>& q) {
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  const double w = q[0] / norm, x = q[1] / norm, y = q[2] / norm, z = q[3] / norm;
  return {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
          2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
          2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
}

Vec3d times(const std::array<double, 9>& m, Vec3d v) {
  return {m[0] * v.x + m[1] * v.y + m[2] * v.z, m[3] * v.x + m[4] * v.y + m[5] * v.z,
          m[6] * v.x + m[7] * v.y + m[8] * v.z};
}

}  // namespace

std::array<double, 9> covariance(const ReferenceSplat& splat) {
  const auto r = matrix(splat.rotation);
  std::array<double, 9> out{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      for (std::size_t k = 0; k < 3; ++k)
        out[3 * i + j] += r[3 * i + k] * splat.sigma[k] * splat.sigma[k] * r[3 * j + k];
    }
  }
  return out;
}

Contribution contribution(const ReferenceSplat& splat, const ReferenceTexel& texel,
                          const ReferenceLimits& limits) {
  Contribution out;
  out.colour = splat.colour;
  const Vec3d n = texel.normal;
  const Vec3d helper = std::abs(n.x) < 0.6 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  Vec3d u = cross(n, helper);
  u = u * (1 / length(u));
  const Vec3d v = cross(n, u);

  const Vec3d away = splat.mean - texel.position;
  const double footprint = kFootprint * texel.edge * texel.edge;
  const auto sigma = covariance(splat);
  const Vec3d su = times(sigma, u), sv = times(sigma, v);
  const double bare_a = dot(u, su), b = dot(u, sv), bare_c = dot(v, sv);
  const double a = bare_a + footprint, c = bare_c + footprint;
  const double det = a * c - b * b;
  const double dx = dot(u, away), dy = dot(v, away);
  const double ix = (c * dx - b * dy) / det, iy = (a * dy - b * dx) / det;  // M^-1 D
  const double squared = dx * ix + dy * iy;
  if (!(squared <= kCutOff * kCutOff)) return out;
  out.t = dot(n, away) - (dot(n, su) * ix + dot(n, sv) * iy);

  std::array<std::size_t, 3> order{0, 1, 2};
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t i, std::size_t j) { return splat.sigma[i] > splat.sigma[j]; });
  const double longest = splat.sigma[order[0]], middle = splat.sigma[order[1]],
               shortest = splat.sigma[order[2]];
  const double planarity = middle > 0 ? std::max(0.02, 1 - shortest / middle) : 0.02;
  const double needle = longest > 0 ? middle / longest : 1;
  const auto r = matrix(splat.rotation);
  const bool has_normal = length(splat.normal) > 0;
  const Vec3d axis =
      has_normal ? splat.normal : Vec3d{r[order[2]], r[3 + order[2]], r[6 + order[2]]};
  const double cosine = has_normal ? dot(axis, n) : std::abs(dot(axis, n));
  if (cosine < limits.min_cosine) return out;

  double alpha = splat.alpha;
  if (limits.antialiased) alpha *= std::sqrt(std::max(0.0, bare_a * bare_c - b * b) / det);
  out.evidence = alpha * std::exp(-squared / 2) * planarity * cosine * cosine;
  out.weight = out.evidence * needle;
  return out;
}

namespace {

/// Evidence by depth, in bins of `width`, each shared by the two bins around it; at(i) is smoothed.
class DepthProfile {
 public:
  DepthProfile(const std::vector<Contribution>& all, double width) : width_(width) {
    for (const Contribution& c : all) {
      const double at = c.t / width;
      const int low = static_cast<int>(std::floor(at));
      bins_[low] += c.evidence * (1 - (at - low));
      bins_[low + 1] += c.evidence * (at - low);
    }
  }
  double at(int i) const { return (bin(i - 1) + 2 * bin(i) + bin(i + 1)) / 2; }

  /// Every peak or other bin that at least `least` is found at, nearest first, front before back.
  bool find(int most, double least, double& depth, bool& unsure) const {
    for (int distance = 0; distance <= most; ++distance) {
      double best = 0;
      for (const int i : {distance, -distance}) {
        if (std::abs(at(i) / least - 1) < kSame) unsure = true;
        if (at(i) < least || at(i) < at(i - 1) || at(i) < at(i + 1) || at(i) <= best) continue;
        if (best > 0 && at(i) < best * (1 + kSame)) unsure = true;
        best = at(i);
        const double curve = at(i - 1) - 2 * at(i) + at(i + 1);
        depth = width_ * (curve < 0 ? i + 0.5 * (at(i - 1) - at(i + 1)) / curve : i);
      }
      if (best > 0) return true;
    }
    return false;
  }

 private:
  static constexpr double kSame = 1e-4;
  double bin(int i) const {
    const auto found = bins_.find(i);
    return found == bins_.end() ? 0 : found->second;
  }
  double width_;
  std::map<int, double> bins_;
};

/// The window's centre; the window's width in `width`.
bool find_centre(const std::vector<Contribution>& all, const ReferenceLimits& limits, double& width,
                 ReferenceBlend& out) {
  for (;; width *= 2) {
    const DepthProfile profile(all, width);
    const double bins = limits.max_distance / width;
    if (std::abs(bins - std::round(bins)) < 1e-4) out.unsure = true;
    const int most = static_cast<int>(std::floor(std::min(bins, 16.0)));
    double top = 0;
    for (int i = -most; i <= most; ++i) top = std::max(top, profile.at(i));
    if (bins > 16) {
      if (std::abs(top / 0.5 - 1) < 1e-4) out.unsure = true;
      if (top < 0.5) continue;
    }
    if (top < 1e-5) out.unsure = out.unsure || top > 0;  // next to nothing: steps decide
    if (top == 0) return false;
    if (profile.find(most, std::min(0.7, 0.35 * top), out.depth, out.unsure)) return true;
    if (bins > 16) continue;
    for (int distance = 0; distance <= most; ++distance) {
      for (const int i : {distance, -distance}) {
        if (profile.at(i) < top) continue;
        out.depth = i * width;
        return true;
      }
    }
  }
}

}  // namespace

ReferenceBlend reference_blend(const std::vector<ReferenceSplat>& scene,
                               const ReferenceTexel& texel, const ReferenceLimits& limits) {
  ReferenceBlend out;
  std::vector<Contribution> all;
  for (const ReferenceSplat& splat : scene) {
    const Contribution c = contribution(splat, texel, limits);
    if (c.weight > 0) all.push_back(c);
  }
  double width = std::max(limits.window, texel.edge / 2);
  if (!find_centre(all, limits, width, out)) return out;
  double total = 0;
  for (const Contribution& c : all) {
    const double x = (c.t - out.depth) / width;
    if (std::abs(x) > 3) continue;
    const double weight = c.weight * std::exp(-x * x / 2);
    total += weight;
    out.colour = out.colour + c.colour * weight;
  }
  if (total == 0) return out;
  out.covered = true;
  out.colour = out.colour * (1 / total);
  const auto inside = [](double v) { return std::clamp(v, 0.0, 1.0); };
  out.colour = {inside(out.colour.x), inside(out.colour.y), inside(out.colour.z)};
  return out;
}

std::vector<ReferenceSplat> read_reference_splats(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::size_t count = 0, stride = 0;
  std::map<std::string, std::size_t> offset;
  for (std::string line; std::getline(in, line) && line != "end_header";) {
    std::istringstream words(line);
    std::string first, second, third;
    words >> first >> second >> third;
    if (first == "element") count = std::stoull(third);
    if (first == "property") {
      offset[third] = stride;
      stride += 4;
    }
  }
  if (count == 0) throw std::runtime_error(path + ": no vertices");
  std::vector<char> row(stride);
  const auto at = [&](const char* name) {
    float value;
    std::memcpy(&value, row.data() + offset.at(name), sizeof value);
    return static_cast<double>(value);
  };
  std::vector<ReferenceSplat> scene(count);
  for (ReferenceSplat& s : scene) {
    in.read(row.data(), static_cast<std::streamsize>(stride));
    s.mean = {at("x"), at("y"), at("z")};
    s.sigma = {std::exp(at("scale_0")), std::exp(at("scale_1")), std::exp(at("scale_2"))};
    s.rotation = {at("rot_0"), at("rot_1"), at("rot_2"), at("rot_3")};
    s.alpha = 1 / (1 + std::exp(-at("opacity")));
    const auto base = [&](const char* name) {
      return std::max(0.0, 0.5 + 0.28209479177387814 * at(name));
    };
    s.colour = {base("f_dc_0"), base("f_dc_1"), base("f_dc_2")};
    if (offset.count("nx") != 0) {
      const Vec3d n{at("nx"), at("ny"), at("nz")};
      if (length(n) > 0) s.normal = n * (1 / length(n));
    }
  }
  if (!in) throw std::runtime_error(path + ": truncated");
  return scene;
}

void write_reference_splats(const std::string& path, const std::vector<ReferenceSplat>& scene,
                            const std::string& comment) {
  bool normals = false;
  for (const ReferenceSplat& s : scene) normals = normals || length(s.normal) > 0;
  std::ofstream out(path, std::ios::binary);
  out << "ply\nformat binary_little_endian 1.0\n";
  if (!comment.empty()) out << "comment " << comment << "\n";
  out << "element vertex " << scene.size() << "\n";
  std::string names =
      "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 "
      "rot_3";
  if (normals) names += " nx ny nz";
  std::istringstream words(names);
  for (std::string name; words >> name;) out << "property float " << name << "\n";
  out << "end_header\n";
  for (const ReferenceSplat& s : scene) {
    const auto dc = [](double colour) { return (colour - 0.5) / 0.28209479177387814; };
    std::vector<double> row{s.mean.x,
                            s.mean.y,
                            s.mean.z,
                            dc(s.colour.x),
                            dc(s.colour.y),
                            dc(s.colour.z),
                            std::log(s.alpha / (1 - s.alpha)),
                            std::log(s.sigma[0]),
                            std::log(s.sigma[1]),
                            std::log(s.sigma[2])};
    row.insert(row.end(), s.rotation.begin(), s.rotation.end());
    if (normals) row.insert(row.end(), {s.normal.x, s.normal.y, s.normal.z});
    for (const double value : row) {
      const auto rounded = static_cast<float>(value);
      out.write(reinterpret_cast<const char*>(&rounded), sizeof rounded);
    }
  }
}

std::optional<ReferenceTexel> reference_texel(const mesh::Mesh& mesh, const TargetRaster& raster,
                                              std::size_t texel) {
  if (!raster.covered(texel)) return std::nullopt;
  const auto& corner = mesh.triangles[static_cast<std::size_t>(raster.owner[texel])];
  std::array<Vec2d, 3> at;
  std::array<Vec3d, 3> p, n;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec2f uv = mesh.uv_sets[0][corner[k]];
    at[k] = {double{uv.x} * raster.width - 0.5, double{uv.y} * raster.height - 0.5};
    p[k] = Vec3d(mesh.positions[corner[k]]);
    n[k] = Vec3d(mesh.normals[corner[k]]);
  }
  const Vec2d a = at[1] - at[0], b = at[2] - at[0];
  const Vec2d d = Vec2d{raster.x[texel], raster.y[texel]} - at[0];
  const double area = a.x * b.y - a.y * b.x;
  const double w1 = (d.x * b.y - d.y * b.x) / area, w2 = (a.x * d.y - a.y * d.x) / area;
  const double w0 = 1 - w1 - w2;
  ReferenceTexel out;
  out.position = p[0] * w0 + p[1] * w1 + p[2] * w2;
  out.normal = n[0] * w0 + n[1] * w1 + n[2] * w2;
  out.edge = std::sqrt(length(cross(p[1] - p[0], p[2] - p[0])) / std::abs(area));
  if (!(length(out.normal) > 1e-6) || !(out.edge > 0)) return std::nullopt;
  out.normal = out.normal * (1 / length(out.normal));
  return out;
}

}  // namespace pounce::test
