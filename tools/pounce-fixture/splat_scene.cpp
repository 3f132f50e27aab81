// SPDX-License-Identifier: Apache-2.0
//
// A scene as a trainer leaves it behind, but with a known answer. Row i draws its numbers from a
// counter (seed, i), so rows can be made in any order by any thread. Its kind comes from
// i * stride mod count with a stride prime to the count: a permutation, so kinds are mixed through
// the file and still there are exactly as many of each as asked.
#include "splat_scene.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "pounce/error.h"

namespace pounce::fixture {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr float kC0 = 0.28209479177387814F;  // the constant basis function: colour = 0.5 + C0 dc

/// Any two unit vectors that make a right-handed frame with the unit vector `n`.
void tangents(Vec3d n, Vec3d& a, Vec3d& b) {
  a = normalized(cross(std::abs(n.y) < 0.9 ? Vec3d{0, 1, 0} : Vec3d{1, 0, 0}, n));
  b = cross(n, a);
}

/// A quaternion (w, x, y, z), not normalised, of the turn that takes z to `n` after a turn about z
/// by twice the angle of (c, s).
std::array<double, 4> to_normal(Vec3d n, double c, double s) {
  // (1 + n.z, z cross n) turns z to n; the other sign of n describes the same disc and keeps clear
  // of the place where that is all zeros.
  if (n.z < 0) n = n * -1.0;
  const double w = 1 + n.z, x = -n.y, y = n.x;
  return {w * c, x * c + y * s, y * c - x * s, w * s};
}

/// Area of the surface that a unit of solid angle shows: r^2 / (n . d).
double area_per_angle(const SurfacePoint& p, Vec3d direction) {
  return dot(p.position, p.position) / dot(p.normal, direction);
}

double surface_area(const HeadSurface& surface) {
  constexpr int kSamples = 4096;
  double sum = 0;
  for (int i = 0; i < kSamples; ++i) {  // evenly by height, turned by the golden angle
    const double y = 1 - (2 * i + 1.0) / kSamples, ring = std::sqrt(1 - y * y);
    const double turns = i * 0.61803398874989485;
    const Vec3d d{ring * cosine_turns(turns), y, ring * cosine_turns(turns - 0.25)};
    sum += area_per_angle(surface.point(d), d);
  }
  return sum / kSamples * 4 * kPi;
}

std::uint64_t share(std::uint64_t count, double part) {
  return static_cast<std::uint64_t>(std::llround(static_cast<double>(count) * part));
}

}  // namespace

/// Numbers of one row: splitmix64 over a counter.
struct SplatScene::Draw {
  std::uint64_t state;

  std::uint64_t bits() {
    std::uint64_t z = (state += 0x9E3779B97F4A7C15U);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9U;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBU;
    return z ^ (z >> 31);
  }
  double between(double low, double high) {
    return low + (high - low) * (static_cast<double>(bits() >> 11) * 0x1p-53);
  }
  /// Near normal, variance 1, never beyond 3.47: four uniforms added, and no function of libm.
  double normal() {
    const std::uint64_t b = bits();
    const std::uint64_t sum =
        (b & 0xFFFF) + ((b >> 16) & 0xFFFF) + ((b >> 32) & 0xFFFF) + (b >> 48);
    return (static_cast<double>(sum) + 2 - 131072) * (1.7320508075688772 / 65536);
  }
  /// A place in the unit disc, not its centre.
  Vec2d in_disc() {
    for (;;) {
      const Vec2d p{between(-1, 1), between(-1, 1)};
      const double square = p.x * p.x + p.y * p.y;
      if (square < 1 && square > 1e-4) return p;
    }
  }
  /// Uniform on the unit sphere.
  Vec3d direction() {
    const Vec2d p = in_disc();
    const double square = p.x * p.x + p.y * p.y, root = 2 * std::sqrt(1 - square);
    return {p.x * root, p.y * root, 1 - 2 * square};
  }
};

struct SplatScene::Splat {
  Vec3d mean, normal;
  Rgb colour;
  double opacity;       ///< logit
  double log_scale[3];  ///< two along the surface, one across
};

SplatScene::SplatScene(const SplatOptions& o)
    : surface_(o.shape == "sphere" ? unit_sphere() : source_head()),
      is_sphere_(o.shape == "sphere"),
      count_(o.count),
      seed_(o.seed),
      rest_(std::size_t{3} * (o.sh_degree + 1) * (o.sh_degree + 1) - 3) {
  counts_.broken = o.broken;
  counts_.interior = share(o.count, o.interior);
  counts_.floaters = share(o.count, o.floaters);
  counts_.haze = share(o.count, o.haze);
  const std::uint64_t others =
      counts_.broken * kBrokenKinds + counts_.interior + counts_.floaters + counts_.haze;
  if (others >= o.count) {
    throw Error(ErrorKind::usage,
                "nothing is left for the surface; lower --interior, --floaters, --haze or "
                "--broken, or raise --count");
  }
  counts_.needles = share(o.count - others, o.needles);
  counts_.surface = o.count - others - counts_.needles;
  spacing_ =
      std::sqrt(surface_area(surface_) / static_cast<double>(counts_.surface + counts_.needles));
  noise_ = o.noise * spacing_;
  stride_ = share(o.count, 0.61803398874989485) | 1U;
  while (std::gcd(stride_, count_) != 1) stride_ += 2;
}

SplatScene::Kind SplatScene::kind_of(std::uint64_t rank) const {
  const auto below = [&rank](std::uint64_t count) {
    if (rank < count) return true;
    rank -= count;
    return false;
  };
  if (below(counts_.interior)) return Kind::interior;
  if (below(counts_.floaters)) return Kind::floater;
  if (below(counts_.haze)) return Kind::haze;
  if (below(counts_.needles)) return Kind::needle;
  return Kind::surface;  // broken rows are surface splats before they break
}

Rgb SplatScene::colour(Vec3d d) const {
  if (!is_sphere_) return pattern_colour(d);
  const auto wave = [](double turns) {
    return static_cast<float>(0.5 + 0.4 * cosine_turns(turns));
  };
  return {wave(1.1 * d.x + 0.7 * d.y + 0.1), wave(1.3 * d.y - 0.6 * d.z + 0.4),
          wave(1.2 * d.z + 0.5 * d.x + 0.8)};
}

SplatScene::Splat SplatScene::place(Kind kind, Draw& draw) const {
  const Vec3d direction = draw.direction();
  const SurfacePoint p = surface_.point(direction);
  Splat s{p.position, p.normal, colour(direction), draw.between(-1, 3), {}};
  // As far from its neighbours as this part of the surface is stretched.
  const double area = area_per_angle(p, direction) * 4 * kPi;
  const double size = 0.5 * std::log(area / static_cast<double>(counts_.surface + counts_.needles));
  s.log_scale[0] = size + draw.between(-0.3, 0.3);
  s.log_scale[1] = size + draw.between(-0.3, 0.3);
  s.log_scale[2] = size + draw.between(-2.5, -1.5);
  const auto add_noise = [&] {
    s.mean = s.mean + s.normal * (noise_ * draw.normal());
    for (float& c : s.colour) c += static_cast<float>(0.02 * draw.normal());
  };
  switch (kind) {
    case Kind::surface:
      add_noise();
      break;
    case Kind::needle:
      add_noise();
      s.log_scale[0] = size + draw.between(1.2, 2.0);
      s.log_scale[1] = size + draw.between(-1.6, -0.9);
      s.log_scale[2] = s.log_scale[1] + draw.between(-0.3, 0);
      break;
    case Kind::interior:
      s.mean = s.mean * draw.between(0.85, 0.95);
      for (float& c : s.colour) c = 1 - c;
      break;
    case Kind::floater:
      s.mean = s.mean * draw.between(1.06, 1.5);
      for (float& c : s.colour) c = static_cast<float>(draw.between(0.2, 1));
      for (double& scale : s.log_scale) scale = size + draw.between(0, 1.5);
      break;
    case Kind::haze:
      s.mean = s.mean * draw.between(1.02, 1.3);
      s.colour = {0.6F, 0.6F, 0.65F};
      s.opacity = draw.between(-5, -3);  // 0.7 to 5 %
      for (double& scale : s.log_scale) scale = size + draw.between(1, 2);
      break;
  }
  // A trainer's normals are never exact: 0.15 radians about each tangent.
  Vec3d a, b;
  tangents(s.normal, a, b);
  s.normal = normalized(s.normal + a * (0.15 * draw.normal()) + b * (0.15 * draw.normal()));
  return s;
}

void SplatScene::fill(std::uint64_t index, std::span<float> row) const {
  Draw draw{seed_ * 0xD1342543DE82EF95U ^ index * 0xA24BAED4963EE407U};
  draw.state = draw.bits();  // neighbouring counters part here
  const std::uint64_t rank = index * stride_ % count_;
  const std::uint64_t first_broken = count_ - counts_.broken * kBrokenKinds;
  const Splat s = place(kind_of(rank), draw);
  const Vec2d turn = draw.in_disc();
  const double length_factor = draw.between(0.5, 2);  // trainers do not normalise
  const std::array<double, 4> q = to_normal(s.normal, turn.x, turn.y);
  const double unit =
      length_factor / std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  float* out = row.data();
  for (const double v : {s.mean.x, s.mean.y, s.mean.z, 0.0, 0.0, 0.0}) {
    *out++ = static_cast<float>(v);
  }
  for (const float c : s.colour) *out++ = (c - 0.5F) / kC0;
  for (std::size_t i = 0; i < rest_; ++i) *out++ = static_cast<float>(draw.between(-0.05, 0.05));
  *out++ = static_cast<float>(s.opacity);
  for (const double v : s.log_scale) *out++ = static_cast<float>(v);
  for (const double v : q) *out++ = static_cast<float>(v * unit);
  if (rank < first_broken) return;
  switch ((rank - first_broken) % kBrokenKinds) {
    case 0: {  // in any of the columns that a reader must look at
      const std::size_t choices[] = {0, 2, 6, 9 + rest_, 11 + rest_, 14 + rest_};
      row[choices[draw.bits() % std::size(choices)]] = std::numeric_limits<float>::quiet_NaN();
      break;
    }
    case 1:
      for (std::size_t i = 0; i < 4; ++i) row[13 + rest_ + i] = 0;
      break;
    case 2:
      row[10 + rest_ + draw.bits() % 3] = std::numeric_limits<float>::infinity();
      break;
    case 3:
      for (std::size_t i = 0; i < 3; ++i) row[i] *= 1e7F;
      break;
    default:
      row[9 + rest_] = -12;
  }
}

}  // namespace pounce::fixture
