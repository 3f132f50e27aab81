// SPDX-License-Identifier: Apache-2.0
//
// The definition of the transfer, written down as directly as possible:
//
//   target texel -> its point p and normal n, interpolated over the triangle that owns it
//   every source triangle -> where does the line p + t n meet its plane, and is that inside it, or
//     outside by no more than one source texel (never more than the triangle's own size)?
//   the winner has the least (|t| + distance outside) / target texel edge; ties: file order
//   the value is the bilinear lookup of the winner's texture there
//
// The product counts keys in steps of 1/1024 in single precision, so rivals within two steps of the
// best are ambiguous unless they would give the same value.
#include "support/reference_transfer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "core/vec.h"
#include "io/read_mesh.h"
#include "support/target_raster.h"
#include "support/whole_image.h"

namespace pounce::test {
namespace {

constexpr double kTie = 2.0 / 1024;
constexpr double kSameValue = 1e-5;
constexpr double kDoubt = 1e-4;  // relative: nearer to a limit than this, rounding decides

using Value = std::array<double, 4>;

struct SourceTriangle {
  std::array<Vec3d, 3> p;
  Vec3d normal;  ///< unit, towards the front
  double doubled_area = 0;
  double tolerance = 0;
  const WholeImage* image = nullptr;  ///< null: `constant`
  std::array<Vec2d, 3> uv;            ///< transformed, 0..1 over the image
  mesh::Wrap wrap_u = mesh::Wrap::repeat, wrap_v = mesh::Wrap::repeat;
  Value constant{};
  bool usable = false;
};

struct Hit {
  double key = 0;
  const SourceTriangle* triangle = nullptr;
  std::array<double, 3> weights{};
  bool sure = false;
};

/// Texel index of an axis after glTF's wrap modes.
std::int64_t wrap(std::int64_t i, std::int64_t n, mesh::Wrap mode) {
  switch (mode) {
    case mesh::Wrap::clamp:
      return i < 0 ? 0 : i >= n ? n - 1 : i;
    case mesh::Wrap::repeat:
      while (i < 0) i += n;
      return i % n;
    case mesh::Wrap::mirror:
      break;
  }
  while (i < 0) i += 2 * n;
  i %= 2 * n;
  return i < n ? i : 2 * n - 1 - i;
}

Value bilinear(const SourceTriangle& triangle, double u, double v) {
  const WholeImage& image = *triangle.image;
  const double x = u * image.width - 0.5, y = v * image.height - 0.5;
  const double left = std::floor(x), top = std::floor(y);
  Value value{};
  for (int k = 0; k < 4; ++k) {
    const int right = k % 2, below = k / 2;
    const double weight =
        (right != 0 ? x - left : 1 - (x - left)) * (below != 0 ? y - top : 1 - (y - top));
    const auto column = wrap(static_cast<std::int64_t>(left) + right, image.width, triangle.wrap_u);
    const auto row = wrap(static_cast<std::int64_t>(top) + below, image.height, triangle.wrap_v);
    const auto texel = static_cast<std::size_t>(row * image.width + column);
    for (std::size_t c = 0; c < image.channels; ++c) value[c] += weight * image.at(texel, c);
  }
  return value;
}

double to_linear(double coded) {
  return coded <= 0.04045 ? coded / 12.92 : std::pow((coded + 0.055) / 1.055, 2.4);
}
double to_coded(double linear) {
  return linear <= 0.0031308 ? linear * 12.92 : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

class Reference {
 public:
  Reference(const TransferOptions& options, Channel channel, std::uint32_t channels, bool linear)
      : options_(options),
        channel_(channel),
        channels_(channels),
        linear_(linear),
        source_(io::read_mesh(options.source)),
        target_(io::read_mesh(options.targets.front())) {
    images_.resize(source_.images.size());
    for (std::size_t t = 0; t < source_.triangles.size(); ++t) triangles_.push_back(set_up(t));
    limit_ = max_distance();
  }

  ReferenceResult run() {
    const ImageSize size = options_.size.value();
    const TargetRaster raster = raster_target(target_, size.width, size.height);
    ReferenceResult out{size.width, size.height, channels_, {}, {}};
    out.verdicts.assign(raster.owner.size(), Verdict::outside);
    out.samples.assign(raster.owner.size() * channels_, 0);
    for (std::size_t i = 0; i < raster.owner.size(); ++i) {
      if (raster.on_edge[i] != 0) {
        out.verdicts[i] = Verdict::ambiguous;
      } else if (raster.covered(i)) {
        out.verdicts[i] = texel(raster, i, out.samples.data() + i * channels_);
      }
    }
    return out;
  }

 private:
  SourceTriangle set_up(std::size_t t) {
    SourceTriangle s;
    const auto& corners = source_.triangles[t];
    Vec3d shading{};
    for (std::size_t k = 0; k < 3; ++k) {
      s.p[k] = Vec3d(source_.positions[corners[k]]);
      shading = shading + Vec3d(source_.normals[corners[k]]);
    }
    const Vec3d n = cross(s.p[1] - s.p[0], s.p[2] - s.p[0]);
    s.doubled_area = length(n);
    if (s.doubled_area == 0) return s;
    s.usable = true;
    s.normal = n * ((dot(shading, n) < 0 ? -1 : 1) / s.doubled_area);
    s.tolerance = std::sqrt(s.doubled_area / 2);
    const mesh::Material& material = source_.materials[source_.triangle_material[t]];
    const auto& binding = material.textures[static_cast<std::size_t>(channel_)];
    if (!binding) {
      const auto& factor = material.factors[static_cast<std::size_t>(channel_)];
      for (std::size_t c = 0; c < 4; ++c) {
        // Factors are linear; images of colour channels are sRGB-coded.
        s.constant[c] = is_colour() && !linear_ && c < 3 ? to_coded(double{factor[c]}) : factor[c];
      }
      return s;
    }
    if (!images_[binding->image])
      images_[binding->image] = read_whole_image(source_.images[binding->image]);
    s.image = &*images_[binding->image];
    s.wrap_u = binding->wrap_u;
    s.wrap_v = binding->wrap_v;
    const mesh::UvTransform& m = binding->transform;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec2d uv(Vec2d{source_.uv_sets[binding->uv_set][corners[k]].x,
                           source_.uv_sets[binding->uv_set][corners[k]].y});
      s.uv[k] = {m.a * uv.x + m.b * uv.y + m.c, m.d * uv.x + m.e * uv.y + m.f};
    }
    const Vec2d e1 = s.uv[1] - s.uv[0], e2 = s.uv[2] - s.uv[0];
    const double texels =
        std::abs(e1.x * e2.y - e1.y * e2.x) * s.image->width * s.image->height / 2;
    if (texels > 0) s.tolerance *= std::min(1.0, std::sqrt(1 / texels));
    return s;
  }

  bool is_colour() const {
    return channel_ == Channel::base_color || channel_ == Channel::emissive;
  }

  Verdict texel(const TargetRaster& raster, std::size_t i, double* out) const {
    const auto& corners = target_.triangles[static_cast<std::size_t>(raster.owner[i])];
    std::array<Vec3d, 3> p, n;
    std::array<Vec2d, 3> at;
    for (std::size_t k = 0; k < 3; ++k) {
      p[k] = Vec3d(target_.positions[corners[k]]);
      n[k] = Vec3d(target_.normals[corners[k]]);
      const Vec2f uv = target_.uv_sets[0][corners[k]];
      at[k] = {double{uv.x} * raster.width - 0.5, double{uv.y} * raster.height - 0.5};
    }
    const auto area = [](Vec2d a, Vec2d b, Vec2d c) {
      return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    };
    const Vec2d centre{raster.x[i], raster.y[i]};
    const double whole = area(at[0], at[1], at[2]);
    const double w0 = area(centre, at[1], at[2]) / whole, w1 = area(at[0], centre, at[2]) / whole;
    const double w2 = 1 - w0 - w1;
    const Vec3d point = p[0] * w0 + p[1] * w1 + p[2] * w2;
    Vec3d normal = n[0] * w0 + n[1] * w1 + n[2] * w2;
    if (!(length(normal) > 0)) return Verdict::empty;
    normal = normal * (1 / length(normal));
    const double edge = std::sqrt(length(cross(p[1] - p[0], p[2] - p[0])) / std::abs(whole));

    std::vector<Hit> hits;
    for (const SourceTriangle& triangle : triangles_) {
      if (const auto hit = try_triangle(triangle, point, normal, edge)) hits.push_back(*hit);
    }
    return choose(hits, out);
  }

  /// A hit, also one that only rounding may let through.
  std::optional<Hit> try_triangle(const SourceTriangle& s, Vec3d point, Vec3d normal,
                                  double edge) const {
    if (!s.usable) return std::nullopt;
    const double facing = dot(s.normal, normal);
    const double least = std::cos(options_.max_angle_deg * std::numbers::pi / 180);
    if (facing < least - kDoubt) return std::nullopt;
    const double t = dot(s.normal, s.p[0] - point) / facing;
    if (std::abs(t) > limit_ * (1 + kDoubt)) return std::nullopt;
    const Vec3d hit = point + normal * t;
    const auto part = [&](Vec3d a, Vec3d b, Vec3d c) {
      return dot(cross(b - a, c - a), cross(s.p[1] - s.p[0], s.p[2] - s.p[0])) /
             (s.doubled_area * s.doubled_area);
    };
    double w1 = std::max(part(s.p[0], hit, s.p[2]), 0.0);
    double w2 = std::max(part(s.p[0], s.p[1], hit), 0.0);
    if (w1 + w2 > 1) {
      const double sum = w1 + w2;
      w1 /= sum;
      w2 /= sum;
    }
    const std::array<double, 3> weights{1 - w1 - w2, w1, w2};
    const Vec3d nearest = s.p[0] * weights[0] + s.p[1] * weights[1] + s.p[2] * weights[2];
    const double outside = length(hit - nearest);
    if (outside > s.tolerance * (1 + kDoubt)) return std::nullopt;
    const double farthest = std::max(limit_, edge / 1024);
    if (std::abs(t) + outside > farthest * (1 + kDoubt)) return std::nullopt;
    const bool sure = facing > least + kDoubt &&
                      std::abs(t) + outside < farthest * (1 - kDoubt) - edge / 1024 &&
                      outside < s.tolerance * (1 - kDoubt);
    return Hit{(std::abs(t) + outside) / edge, &s, weights, sure};
  }

  Verdict choose(const std::vector<Hit>& hits, double* out) const {
    const Hit* best = nullptr;  // hits are in file order: the first of equals stays
    for (const Hit& hit : hits) {
      if (hit.sure && (best == nullptr || hit.key < best->key)) best = &hit;
    }
    if (best == nullptr) return hits.empty() ? Verdict::empty : Verdict::ambiguous;
    const Value value = coded(*best);
    std::copy_n(value.begin(), channels_, out);
    for (const Hit& hit : hits) {
      if (hit.key > best->key + kTie) continue;
      const Value rival = coded(hit);
      for (std::size_t c = 0; c < channels_; ++c) {
        if (std::abs(rival[c] - value[c]) > kSameValue) return Verdict::ambiguous;
      }
    }
    return Verdict::found;
  }

  /// The value at a hit in the output's channels and coding.
  Value coded(const Hit& hit) const {
    const SourceTriangle& s = *hit.triangle;
    if (s.image == nullptr) return s.constant;
    double u = 0, v = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      u += s.uv[k].x * hit.weights[k];
      v += s.uv[k].y * hit.weights[k];
    }
    const Value in = bilinear(s, u, v);
    const std::uint32_t given = s.image->channels;
    const bool has_alpha = given == 2 || given == 4, wants_alpha = channels_ == 2 || channels_ == 4;
    Value out{};
    for (std::uint32_t c = 0; c < channels_; ++c) {
      if (wants_alpha && c + 1 == channels_) {
        out[c] = has_alpha ? in[given - 1] : 1;
        continue;
      }
      out[c] = in[given < 3 ? 0 : c];
      if (is_colour() && linear_ && !s.image->linear) out[c] = to_linear(out[c]);
      if (is_colour() && !linear_ && s.image->linear) out[c] = to_coded(out[c]);
    }
    return out;
  }

  double max_distance() const {
    if (!options_.max_distance.is_percent) return options_.max_distance.value;
    Vec3d lo{1e300, 1e300, 1e300}, hi{-1e300, -1e300, -1e300};
    for (const auto& triangle : target_.triangles) {
      for (const std::uint32_t v : triangle) {
        const Vec3d p(target_.positions[v]);
        lo = {std::min(lo.x, p.x), std::min(lo.y, p.y), std::min(lo.z, p.z)};
        hi = {std::max(hi.x, p.x), std::max(hi.y, p.y), std::max(hi.z, p.z)};
      }
    }
    return options_.max_distance.value / 100 * length(hi - lo);
  }

  const TransferOptions& options_;
  const Channel channel_;
  const std::uint32_t channels_;
  const bool linear_;
  const mesh::Mesh source_, target_;
  std::vector<std::optional<WholeImage>> images_;
  std::vector<SourceTriangle> triangles_;
  double limit_ = 0;  ///< of |t|
};

}  // namespace

std::uint64_t ReferenceResult::count(Verdict verdict) const {
  return static_cast<std::uint64_t>(std::count(verdicts.begin(), verdicts.end(), verdict));
}

ReferenceResult reference_transfer(const TransferOptions& options, Channel channel,
                                   std::uint32_t channels, bool linear_output) {
  return Reference(options, channel, channels, linear_output).run();
}

}  // namespace pounce::test
