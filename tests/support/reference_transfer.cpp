// SPDX-License-Identifier: Apache-2.0
//
// The definition of the transfer, written down as directly as possible:
//
//   target texel -> its point p and normal n, interpolated over the triangle that owns it; and p',
//     the same point moved off that triangle's edges by 32 steps (a step: four last places of the
//     triangle's largest coordinate), at most 1/16 texel, at most to the triangle's middle
//   every source triangle -> where does the line p' + t n meet its plane (as if it rose by at least
//     1/64 per unit), is that inside it, or outside by no more than one source texel (never more
//     than the triangle's own size), and does the surface face n there?
//   the winner has the least |t| + distance outside; ties: file order
//   the value is the bilinear lookup of the winner's texture where p + t n meets it; where the
//     texel covers more than one of that texture's, the value is a mean, which is not tried here
//
// The product counts distances in those steps in single precision, of a neighbour in the image if
// those are coarser, so rivals within sixteen steps of the best are ambiguous unless they would
// give the same value.
#include "support/reference_transfer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "core/vec.h"
#include "io/read_mesh.h"
#include "support/whole_image.h"

namespace pounce::test {
namespace {

constexpr double kTieSteps = 16, kInsetSteps = 32;
constexpr double kLeastRise = 1.0 / 64;
constexpr double kSameValue = 1e-5;
constexpr double kCoarse = 1.01;  // texels of the source
constexpr double kDoubt = 1e-4;   // relative: nearer to a limit than this, rounding decides

using Value = std::array<double, 4>;

struct SourceTriangle {
  std::array<Vec3d, 3> p, shading;
  Vec3d normal;  ///< unit, of the plane
  double doubled_area = 0;
  double tolerance = 0;
  const WholeImage* image = nullptr;  ///< null: `constant`
  std::array<Vec2d, 3> uv;            ///< transformed, 0..1 over the image
  mesh::Wrap wrap_u = mesh::Wrap::repeat, wrap_v = mesh::Wrap::repeat;
  Value constant{};
  bool usable = false;
};

/// A target texel as the search sees it.
struct Ray {
  Vec3d start, own, normal;
  double step = 0;  ///< what distances from it are rounded to
};

/// Where a line meets a triangle's plane.
struct Meeting {
  double t = 0, outside = 0;
  std::array<double, 3> weights{};  ///< clamped into the triangle
};

struct Hit {
  double key = 0;
  const SourceTriangle* triangle = nullptr;
  std::array<double, 3> weights{};  ///< of the texel's own point
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

}  // namespace

class Reference::Search {
 public:
  Search(const TransferOptions& options, Channel channel, std::uint32_t channels, bool linear)
      : options_(options),
        channel_(channel),
        channels_(channels),
        linear_(linear),
        source_(io::read_mesh(options.source)),
        target_(io::read_mesh(options.targets.front())) {
    images_.resize(source_.images.size());
    for (const SourceTexture& given : options.material.textures) {
      if (given.channel == channel) images_.emplace_back(read_whole_image(given.path));
    }
    for (std::size_t t = 0; t < source_.triangles.size(); ++t) triangles_.push_back(set_up(t));
    measure();
    const ImageSize size = options_.image.size.value();
    raster_ = raster_target(target_, size.width, size.height);
  }

  Verdict texel(std::size_t i, double* out) const {
    if (raster_.on_edge[i] != 0) return Verdict::ambiguous;
    if (!raster_.covered(i)) return Verdict::outside;
    const std::optional<Ray> line = ray(i);
    if (!line) return Verdict::empty;
    std::vector<Hit> hits;
    for (const SourceTriangle& triangle : triangles_) {
      if (const auto hit = try_triangle(triangle, *line)) hits.push_back(*hit);
    }
    return choose(hits, i, line->step, out);
  }

  void own(std::size_t i, double* out) const {
    const SourceTriangle& owner = triangles_.at(static_cast<std::size_t>(raster_.owner[i]));
    const auto weights = weights_at(texel_corners(i), {raster_.x[i], raster_.y[i]});
    const Value value = coded({0, &owner, weights, true});
    std::copy_n(value.begin(), channels_, out);
  }

  const TargetRaster& raster() const { return raster_; }

 private:
  SourceTriangle set_up(std::size_t t) {
    SourceTriangle s;
    const auto& corners = source_.triangles[t];
    for (std::size_t k = 0; k < 3; ++k) {
      s.p[k] = Vec3d(source_.positions[corners[k]]);
      s.shading[k] = Vec3d(source_.normals[corners[k]]);
    }
    const Vec3d n = cross(s.p[1] - s.p[0], s.p[2] - s.p[0]);
    s.doubled_area = length(n);
    if (s.doubled_area == 0) return s;
    s.usable = true;
    s.normal = n * (1 / s.doubled_area);
    for (Vec3d& shading : s.shading) {
      if (!(length(shading) > 0)) shading = s.normal;
    }
    s.tolerance = std::sqrt(s.doubled_area / 2);
    const mesh::Material& material = source_.materials[source_.triangle_material[t]];
    auto binding = material.textures[static_cast<std::size_t>(channel_)];
    if (images_.size() > source_.images.size()) {  // a given texture stands for the materials' own
      if (!binding) binding.emplace();
      binding->image = static_cast<std::uint32_t>(source_.images.size());
    }
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

  /// Barycentrics of a point of the image in a triangle of the target.
  static std::array<double, 3> weights_at(const std::array<Vec2d, 3>& at, Vec2d point) {
    const double whole = doubled(at[0], at[1], at[2]);
    const double w0 = doubled(point, at[1], at[2]) / whole;
    const double w1 = doubled(at[0], point, at[2]) / whole;
    return {w0, w1, 1 - w0 - w1};
  }
  static double doubled(Vec2d a, Vec2d b, Vec2d c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
  }
  static Vec3d mix(const std::array<Vec3d, 3>& v, const std::array<double, 3>& w) {
    return v[0] * w[0] + v[1] * w[1] + v[2] * w[2];
  }

  std::array<Vec2d, 3> texel_corners(std::size_t i) const {
    const auto& corners = target_.triangles[static_cast<std::size_t>(raster_.owner[i])];
    std::array<Vec2d, 3> at;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec2f uv = target_.uv_sets[0][corners[k]];
      at[k] = {double{uv.x} * raster_.width - 0.5, double{uv.y} * raster_.height - 0.5};
    }
    return at;
  }

  std::optional<Ray> ray(std::size_t i) const {
    const auto& corners = target_.triangles[static_cast<std::size_t>(raster_.owner[i])];
    std::array<Vec3d, 3> p, n;
    for (std::size_t k = 0; k < 3; ++k) {
      p[k] = Vec3d(target_.positions[corners[k]]);
      n[k] = Vec3d(target_.normals[corners[k]]);
    }
    const std::array<Vec2d, 3> at = texel_corners(i);
    const double whole = doubled(at[0], at[1], at[2]);
    const double edge = std::sqrt(length(cross(p[1] - p[0], p[2] - p[0])) / std::abs(whole));
    const Vec2d centre{raster_.x[i], raster_.y[i]};
    double around = 0;
    for (std::size_t k = 0; k < 3; ++k)
      around += std::hypot(at[(k + 1) % 3].x - at[k].x, at[(k + 1) % 3].y - at[k].y);
    const double step = step_of(p);
    const double inset = std::min({kInsetSteps * step / edge, 1.0 / 16, std::abs(whole) / around});
    Vec2d moved = centre;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec2d a = at[k], b = at[(k + 1) % 3], c = at[(k + 2) % 3];
      const double size = std::hypot(b.x - a.x, b.y - a.y);
      Vec2d inward{-(b.y - a.y) / size, (b.x - a.x) / size};
      if (inward.x * (c.x - a.x) + inward.y * (c.y - a.y) < 0) inward = {-inward.x, -inward.y};
      const double distance = inward.x * (centre.x - a.x) + inward.y * (centre.y - a.y);
      const double lacking = std::max(inset - distance, 0.0);
      moved = {moved.x + inward.x * lacking, moved.y + inward.y * lacking};
    }
    const Vec3d normal = mix(n, weights_at(at, centre));
    if (!(length(normal) > 0)) return std::nullopt;
    return Ray{mix(p, weights_at(at, moved)), mix(p, weights_at(at, centre)),
               normal * (1 / length(normal)), step};
  }

  static double step_of(const std::array<Vec3d, 3>& corners) {
    double largest = 0;
    for (const Vec3d& p : corners)
      largest = std::max({largest, std::abs(p.x), std::abs(p.y), std::abs(p.z)});
    return largest > 0 ? std::ldexp(1.0, std::ilogb(largest) - 21) : 0;
  }

  static Meeting meet(const SourceTriangle& s, Vec3d point, Vec3d normal) {
    double rise = dot(s.normal, normal);
    if (std::abs(rise) < kLeastRise) {
      // Which side is up shows in the shading, not in the winding.
      const Vec3d up = s.shading[0] + s.shading[1] + s.shading[2];
      const bool turned = dot(up, s.normal) < 0;
      rise = (turned ? -rise : rise) < 0 ? -kLeastRise : kLeastRise;
      if (turned) rise = -rise;
    }
    Meeting out;
    out.t = dot(s.normal, s.p[0] - point) / rise;
    const Vec3d hit = point + normal * out.t;
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
    out.weights = {1 - w1 - w2, w1, w2};
    out.outside = length(hit - mix(s.p, out.weights));
    return out;
  }

  /// A hit, also one that only rounding may let through.
  std::optional<Hit> try_triangle(const SourceTriangle& s, const Ray& ray) const {
    if (!s.usable) return std::nullopt;
    const Meeting at = meet(s, ray.start, ray.normal);
    if (std::abs(at.t) > limit_ * (1 + kDoubt)) return std::nullopt;
    if (at.outside > s.tolerance * (1 + kDoubt)) return std::nullopt;
    const double key = std::abs(at.t) + at.outside;
    const double farthest = std::max(limit_, ray.step);
    if (key > farthest * (1 + kDoubt)) return std::nullopt;
    const Vec3d surface = mix(s.shading, at.weights);
    const double least = std::cos(options_.search.max_angle_deg * std::numbers::pi / 180);
    const double facing = dot(surface, ray.normal) / length(surface);
    if (!(facing >= least - kDoubt)) return std::nullopt;
    const bool sure = facing > least + kDoubt && key < farthest * (1 - kDoubt) - ray.step &&
                      at.outside < s.tolerance * (1 - kDoubt);
    return Hit{key, &s, meet(s, ray.own, ray.normal).weights, sure};
  }

  /// Does a step to the next texel, put straight onto the hit triangle, go on by more than a texel
  /// of its image?
  bool is_coarse(const SourceTriangle& s, std::size_t i) const {
    if (s.image == nullptr) return false;
    const auto& corners = target_.triangles[static_cast<std::size_t>(raster_.owner[i])];
    std::array<Vec3d, 3> p;
    for (std::size_t k = 0; k < 3; ++k) p[k] = Vec3d(target_.positions[corners[k]]);
    const Vec2d centre{raster_.x[i], raster_.y[i]};
    const auto place = [&](Vec2d texel) {
      const Vec3d at = mix(p, weights_at(texel_corners(i), texel));
      const Vec3d normal = s.normal * s.doubled_area;
      const double whole = s.doubled_area * s.doubled_area;
      const double w1 = dot(cross(at - s.p[0], s.p[2] - s.p[0]), normal) / whole;
      const double w2 = dot(cross(s.p[1] - s.p[0], at - s.p[0]), normal) / whole;
      const Vec2d uv{s.uv[0].x + w1 * (s.uv[1].x - s.uv[0].x) + w2 * (s.uv[2].x - s.uv[0].x),
                     s.uv[0].y + w1 * (s.uv[1].y - s.uv[0].y) + w2 * (s.uv[2].y - s.uv[0].y)};
      return Vec2d{uv.x * s.image->width, uv.y * s.image->height};
    };
    const Vec2d here = place(centre);
    for (const Vec2d next : {Vec2d{centre.x + 1, centre.y}, Vec2d{centre.x, centre.y + 1}}) {
      const Vec2d there = place(next);
      if (std::hypot(there.x - here.x, there.y - here.y) > kCoarse) return true;
    }
    return false;
  }

  Verdict choose(const std::vector<Hit>& hits, std::size_t i, double step, double* out) const {
    const Hit* best = nullptr;  // hits are in file order: the first of equals stays
    for (const Hit& hit : hits) {
      if (hit.sure && (best == nullptr || hit.key < best->key)) best = &hit;
    }
    if (best == nullptr) return hits.empty() ? Verdict::empty : Verdict::ambiguous;
    const Value value = coded(*best);
    std::copy_n(value.begin(), channels_, out);
    for (const Hit& hit : hits) {
      if (hit.key > best->key + kTieSteps * step + 1e-6 * best->key) continue;
      const Value rival = coded(hit);
      for (std::size_t c = 0; c < channels_; ++c) {
        if (std::abs(rival[c] - value[c]) > kSameValue) return Verdict::ambiguous;
      }
    }
    return is_coarse(*best->triangle, i) ? Verdict::coarse : Verdict::found;
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

  void measure() {
    Vec3d lo{1e300, 1e300, 1e300}, hi{-1e300, -1e300, -1e300};
    for (const auto& triangle : target_.triangles) {
      for (const std::uint32_t v : triangle) {
        const Vec3d p(target_.positions[v]);
        lo = {std::min(lo.x, p.x), std::min(lo.y, p.y), std::min(lo.z, p.z)};
        hi = {std::max(hi.x, p.x), std::max(hi.y, p.y), std::max(hi.z, p.z)};
      }
    }
    const Length distance = options_.search.max_distance.value_or(Length{5, true});
    limit_ = distance.is_percent ? distance.value / 100 * length(hi - lo) : distance.value;
  }

  const TransferOptions& options_;
  const Channel channel_;
  const std::uint32_t channels_;
  const bool linear_;
  const mesh::Mesh source_, target_;
  std::vector<std::optional<WholeImage>> images_;
  std::vector<SourceTriangle> triangles_;
  TargetRaster raster_;
  double limit_ = 0;  ///< of |t|
};

std::uint64_t ReferenceResult::count(Verdict verdict) const {
  return static_cast<std::uint64_t>(std::count(verdicts.begin(), verdicts.end(), verdict));
}

Reference::Reference(const TransferOptions& options, Channel channel, std::uint32_t channels,
                     bool linear_output)
    : search_(std::make_unique<Search>(options, channel, channels, linear_output)) {}
Reference::~Reference() = default;

const TargetRaster& Reference::raster() const { return search_->raster(); }
Verdict Reference::texel(std::size_t texel, double* samples) const {
  return search_->texel(texel, samples);
}
void Reference::own(std::size_t texel, double* samples) const { search_->own(texel, samples); }

ReferenceResult reference_transfer(const TransferOptions& options, Channel channel,
                                   std::uint32_t channels, bool linear_output) {
  const Reference reference(options, channel, channels, linear_output);
  const TargetRaster& raster = reference.raster();
  ReferenceResult out{raster.width, raster.height, channels, {}, {}};
  out.samples.assign(raster.owner.size() * channels, 0);
  for (std::size_t i = 0; i < raster.owner.size(); ++i)
    out.verdicts.push_back(reference.texel(i, out.samples.data() + i * channels));
  return out;
}

}  // namespace pounce::test
