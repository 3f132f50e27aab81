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
  const double fine_edge = std::min(texel.edge, limits.fine_edge);
  const double fine = kFootprint * fine_edge * fine_edge;
  const double footprint = fine + (texel.edge * texel.edge - fine_edge * fine_edge) / 12;
  const auto sigma = covariance(splat);
  const Vec3d su = times(sigma, u), sv = times(sigma, v);
  const double bare_a = dot(u, su), b = dot(u, sv), bare_c = dot(v, sv);
  const double a = bare_a + footprint, c = bare_c + footprint;
  const double det = a * c - b * b;
  const double dx = dot(u, away), dy = dot(v, away);
  const double ix = (c * dx - b * dy) / det, iy = (a * dy - b * dx) / det;  // M^-1 D
  const double squared = dx * ix + dy * iy;
  out.unsure = std::abs(squared / (kCutOff * kCutOff) - 1) < 1e-4;
  if (!(squared <= kCutOff * kCutOff)) return out;
  out.t = dot(n, away) - (dot(n, su) * ix + dot(n, sv) * iy);
  out.unsure = out.unsure || std::abs(std::abs(out.t) / limits.reach - 1) < 1e-5;
  if (!(std::abs(out.t) <= limits.reach)) return out;

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
  const double cosine = dot(axis, n);
  if (has_normal && cosine < limits.min_cosine) return out;
  out.disc = cosine * cosine * planarity * needle;

  const double fine_det = (bare_a + fine) * (bare_c + fine) - b * b;
  const double kept = std::max(0.0, bare_a * bare_c - b * b) / fine_det;
  const double peak =
      splat.alpha * std::pow(kept, limits.antialiased ? 0.5 : 0.25) * std::sqrt(fine_det / det);
  out.alpha = std::min(0.99, peak * std::exp(-squared / 2));
  out.mass = 0.4 * peak * (1 - squared / (kCutOff * kCutOff));
  return out;
}

namespace {

constexpr int kBins = 26;
using Bins = std::array<double, kBins>;

/// 1 2 1 twice, nothing beyond the bins.
double smoothed(const Bins& bins, int k) {
  constexpr std::array<double, 5> kWeights{1, 4, 6, 4, 1};
  double sum = 0;
  for (int i = -2; i <= 2; ++i) {
    if (k + i >= 0 && k + i < kBins)
      sum += kWeights[static_cast<std::size_t>(i + 2)] * bins[static_cast<std::size_t>(k + i)];
  }
  return sum / 16;
}

Bins visible(const Bins& mass) {
  Bins out{};
  double before = 0;
  for (std::size_t k = 0; k < kBins; ++k) {
    out[k] = std::exp(-before) * (1 - std::exp(-mass[k]));
    before += mass[k];
  }
  return out;
}

/// The bin of which most is there and most is seen.
template <class Prior>
int peak_bin(const Bins& mass, const Prior& prior, bool& unsure) {
  const Bins seen = visible(mass);
  double best = -1, second = -1;
  int at = 0;
  for (int k = 0; k < kBins; ++k) {
    const double value = smoothed(seen, k) * smoothed(mass, k) * prior(k);
    if (value > best) {
      second = best;
      best = value;
      at = k;
    } else {
      second = std::max(second, value);
    }
  }
  unsure = unsure || (best > 0 && second > best * (1 - 2e-3));
  return at;
}

}  // namespace

double reference_discness(const std::vector<ReferenceSplat>& scene) {
  std::vector<double> roundness, thickness;
  for (const ReferenceSplat& splat : scene) {
    auto sigma = splat.sigma;
    std::sort(sigma.begin(), sigma.end());
    roundness.push_back(sigma[1] / sigma[2]);
    thickness.push_back(sigma[1] > 0 ? sigma[0] / sigma[1] : 0);
  }
  std::sort(roundness.begin(), roundness.end());
  std::sort(thickness.begin(), thickness.end());
  const double x = std::clamp((roundness[roundness.size() / 2] - 0.45) / 0.25, 0.0, 1.0);
  const double y = std::clamp((thickness[thickness.size() / 4] - 0.25) / 0.2, 0.0, 1.0);
  return x * x * (3 - 2 * x) * (1 - y * y * (3 - 2 * y));
}

double reference_fine_edge(const std::vector<ReferenceSplat>& scene) {
  std::vector<double> sizes;
  for (const ReferenceSplat& splat : scene)
    sizes.push_back(*std::max_element(splat.sigma.begin(), splat.sigma.end()));
  std::sort(sizes.begin(), sizes.end());
  return 1.75 * sizes[sizes.size() / 2];
}

void look_where_found(const TargetReport& target, ReferenceLimits& limits) {
  if (!target.fit || *target.fit < 0.5) return;
  const double spread = target.scene_spread, offset = target.scene_offset;
  if (2 * spread > limits.reach / 3 && std::abs(offset) > spread) {
    limits.expected = 0;
    limits.deviation = limits.reach / 12;
    return;
  }
  limits.expected = target.scene_offset;
  limits.deviation = std::clamp(2 * target.scene_spread, limits.reach / 12, limits.reach / 3);
}

ReferenceBlend reference_blend(const std::vector<ReferenceSplat>& scene,
                               const ReferenceTexel& texel, const ReferenceLimits& limits) {
  ReferenceBlend out;
  std::vector<Contribution> all;
  for (const ReferenceSplat& splat : scene) {
    const Contribution c = contribution(splat, texel, limits);
    out.unsure = out.unsure || c.unsure;
    if (c.alpha > 0) all.push_back(c);
  }
  const double window = std::max(limits.window, texel.edge / 2);
  const double width = std::max(window / 2, limits.reach / 12);
  const double deviation = limits.reach / 3;
  const auto depth = [&](int k) { return limits.reach - k * width; };
  const auto bell = [](double x) { return std::exp(-std::min(x * x / 2, 4.5)); };

  Bins mass{};
  for (const Contribution& c : all) {
    const double at = (limits.reach - c.t) / width;
    const auto low = static_cast<std::size_t>(at);
    mass[low] += c.mass * (1 - (at - std::floor(at)));
    mass[low + 1] += c.mass * (at - std::floor(at));
  }
  const double prior = limits.deviation > 0 ? limits.deviation : deviation;
  const auto near_target = [&](int k) { return bell((depth(k) - limits.expected) / prior); };
  const int first = peak_bin(mass, near_target, out.unsure);
  const double anchor = std::max(depth(first), 0.0);
  const auto fade = [&](double t) { return bell(std::max(t - anchor, 0.0) / deviation); };
  double passed = 0;
  std::array<double, kBins + 1> until{};  // all before bin k
  for (int k = 0; k < kBins; ++k) {
    mass[static_cast<std::size_t>(k)] *= fade(depth(k));
    until[static_cast<std::size_t>(k + 1)] = passed += mass[static_cast<std::size_t>(k)];
  }
  double focus = anchor;
  if (limits.discness > 0) {
    const int peak = peak_bin(mass, near_target, out.unsure);
    const Bins seen = visible(mass);
    double weights = 0, places = 0;
    for (int k = 0; k < kBins; ++k) {
      const double z = (k - peak) * width / window;
      const double weight =
          std::exp(-std::min(z * z / 2, 18.0)) * seen[static_cast<std::size_t>(k)];
      weights += weight;
      places += weight * k;
    }
    focus = limits.reach - width * (weights > 0 ? places / weights : peak);
  }

  double total = 0, depths = 0;
  for (const Contribution& c : all) {
    const double at = std::max((limits.reach - c.t) / width - 0.5 - 1.5 * limits.discness + 1, 0.0);
    const auto low = static_cast<std::size_t>(at);
    const double share = at - std::floor(at);
    const double before =
        until[low] * (1 - share) + until[std::min<std::size_t>(low + 1, kBins)] * share;
    const double z = (c.t - focus) / window;
    const double weight = c.alpha * fade(c.t) * std::exp(-before) *
                          (1 - limits.discness + limits.discness * c.disc) *
                          std::exp(-std::min(limits.discness * z * z / 2, 18.0));
    total += weight;
    depths += weight * c.t;
    out.colour = out.colour + c.colour * weight;
  }
  out.opacity = 1 - std::exp(-passed);
  out.unsure = out.unsure || std::abs(out.opacity - 0.1) < 1e-3 || (total > 0 && total < 1e-4);
  if (total == 0 || out.opacity < 0.1) return out;
  out.covered = true;
  out.distance = depths / total;
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
