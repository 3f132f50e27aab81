// SPDX-License-Identifier: Apache-2.0
#include "picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "mesh/uv_raster.h"
#include "points.h"
#include "pounce/error.h"
#include "render.h"

namespace pounce::score {
namespace {

constexpr std::uint32_t kFiner = 2;  // samples along a pixel's edge, of the mesh
constexpr double kMargin = 0.03;
constexpr Vec3d kGrey{0.5, 0.5, 0.5};

Vec3d unit(Vec3d v) { return v * (1 / length(v)); }

/// A triangle's corner where it is drawn: pixels (centres are whole numbers), depth.
struct Corner {
  Vec2d at;
  double depth;
};

struct Raster {
  std::uint32_t size;
  std::vector<double> depth;
  std::vector<Vec3d> colours;

  void draw(const std::array<Corner, 3>& c, const Shade& shade_of) {
    const double area = (c[1].at.x - c[0].at.x) * (c[2].at.y - c[0].at.y) -
                        (c[1].at.y - c[0].at.y) * (c[2].at.x - c[0].at.x);
    const mesh::TexelWindow window{0, 0, size, size};
    mesh::raster_triangle({c[0].at, c[1].at, c[2].at}, window,
                          [&](std::int64_t y, std::int64_t begin, std::int64_t end) {
                            for (std::int64_t x = begin; x < end; ++x)
                              shade(c, shade_of, area, static_cast<double>(x),
                                    static_cast<double>(y));
                          });
  }

 private:
  void shade(const std::array<Corner, 3>& c, const Shade& shade_of, double area, double x,
             double y) {
    const auto share = [&](std::size_t i) {
      const Vec2d a = c[(i + 1) % 3].at, b = c[(i + 2) % 3].at;
      return ((a.x - x) * (b.y - y) - (a.y - y) * (b.x - x)) / area;
    };
    const double s0 = share(0), s1 = share(1), s2 = share(2);
    const double here = s0 * c[0].depth + s1 * c[1].depth + s2 * c[2].depth;
    const std::size_t pixel = static_cast<std::size_t>(y) * size + static_cast<std::size_t>(x);
    if (here >= depth[pixel]) return;
    depth[pixel] = here;
    colours[pixel] = shade_of({s0, s1, s2});
  }
};

struct Sample {
  Vec3d colour;
  double cover, depth;
};

/// Pixels of `finer`^2 samples; sample(i) of a picture that is as much finer.
template <class Get>
Seen averaged(std::uint32_t size, std::uint32_t finer, const Get& sample) {
  Seen seen;
  const double share = 1.0 / (finer * finer);
  for (std::size_t y = 0; y < size; ++y) {
    for (std::size_t x = 0; x < size; ++x) {
      Vec3d colour;
      double cover = 0, depth = 0, deep = 0;
      for (std::size_t i = 0; i < std::size_t{finer} * finer; ++i) {
        const Sample s = sample((y * finer + i / finer) * size * finer + x * finer + i % finer);
        colour = colour + s.colour * s.cover;
        cover += s.cover;
        if (!std::isfinite(s.depth)) continue;
        depth += s.depth;
        ++deep;
      }
      seen.colours.push_back(cover > 0 ? colour * (1 / cover) : Vec3d{});
      seen.cover.push_back(cover * share);
      seen.depth.push_back(2 * deep >= finer * finer ? depth / deep
                                                     : std::numeric_limits<double>::infinity());
    }
  }
  return seen;
}

std::vector<Vec3d> before(const Seen& seen, Vec3d background) {
  std::vector<Vec3d> colours;
  for (std::size_t i = 0; i < seen.cover.size(); ++i) colours.push_back(seen.before(i, background));
  return colours;
}

}  // namespace

View view_of(const mesh::Mesh& mesh, const Framing& framing) {
  View view;
  view.size = framing.size;
  const double far = length(framing.from), across = length(cross(framing.from, framing.up));
  if (!(across > 1e-6 * far * length(framing.up)))
    throw Error(ErrorKind::usage, "--from and --up lie along one line; give another --up");
  view.forward = framing.from * (-1 / far);
  view.right = unit(cross(view.forward, framing.up));
  view.down = cross(view.forward, view.right);
  const auto seen = [&](Vec3d p) {
    return Vec3d{dot(view.right, p), dot(view.down, p), dot(view.forward, p)};
  };
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Vec3d lo{kInfinity, kInfinity, kInfinity}, hi = lo * -1.0;
  for (const Vec3f& position : mesh.positions) {
    const Vec3d p = seen(Vec3d(position));
    lo = {std::min(lo.x, p.x), std::min(lo.y, p.y), std::min(lo.z, p.z)};
    hi = {std::max(hi.x, p.x), std::max(hi.y, p.y), std::max(hi.z, p.z)};
  }
  const double whole = std::max(hi.x - lo.x, hi.y - lo.y) * (1 + 2 * kMargin);
  const double edge = framing.edge.value_or(whole);
  if (!(edge > 0)) throw Error(ErrorKind::input, mesh.path + ": has no size; nothing to draw");
  const Vec3d middle = framing.middle ? seen(*framing.middle) : (lo + hi) * 0.5;
  view.pixel = edge / view.size;
  const double half = (edge - view.pixel) / 2;
  view.corner =
      view.right * (middle.x - half) + view.down * (middle.y - half) + view.forward * lo.z;
  return view;
}

Seen see_scene(const Scene& scene, const View& view, bool harmonics, std::uint32_t finer) {
  const double step = 1.0 / finer, first = (step - 1) / 2;
  const std::uint32_t size = view.size * finer;
  std::vector<Point> points(std::size_t{size} * size);
  for (std::uint32_t y = 0; y < size; ++y) {
    for (std::uint32_t x = 0; x < size; ++x)
      points[std::size_t{y} * size + x].position = view.place(first + x * step, first + y * step);
  }
  const std::vector<Pixel> samples = render(scene, points, view.forward, view.pixel, harmonics);
  const double plane = dot(view.forward, view.corner);
  return averaged(view.size, finer, [&](std::size_t i) {
    return Sample{samples[i].colour, samples[i].opacity, samples[i].median_depth - plane};
  });
}

/// Bilinear, repeating; v down.
Vec3d lookup(const Image& image, double u, double v) {
  const auto part = [](double at, std::uint32_t size, std::array<std::size_t, 2>& texel) {
    const double x = at * size - 0.5, floor = std::floor(x), whole = size;
    texel[0] = static_cast<std::size_t>(floor - whole * std::floor(floor / whole));
    texel[1] = (texel[0] + 1) % size;
    return x - floor;
  };
  std::array<std::size_t, 2> x{}, y{};
  const double fx = part(u, image.width, x), fy = part(v, image.height, y);
  const auto row = [&](std::size_t r) {
    return image.at(x[0], r) * (1 - fx) + image.at(x[1], r) * fx;
  };
  return row(y[0]) * (1 - fy) + row(y[1]) * fy;
}

Seen see_triangles(const mesh::Mesh& mesh, const View& view, std::uint32_t finer,
                   const std::function<Shade(std::size_t triangle)>& shader_of) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const std::uint32_t size = view.size * finer;
  const std::size_t samples = std::size_t{size} * size;
  Raster raster{size, std::vector<double>(samples, kInfinity), std::vector<Vec3d>(samples, kGrey)};
  const auto corner = [&](std::uint32_t vertex) {
    const Vec3d d = Vec3d(mesh.positions[vertex]) - view.corner;
    const auto along = [&](Vec3d axis) { return (dot(axis, d) / view.pixel + 0.5) * finer - 0.5; };
    return Corner{{along(view.right), along(view.down)}, dot(view.forward, d)};
  };
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const auto& t = mesh.triangles[i];
    const Vec3d a(mesh.positions[t[0]]), b(mesh.positions[t[1]]), c(mesh.positions[t[2]]);
    if (view.one_sided && dot(cross(b - a, c - a), view.forward) >= 0) continue;
    raster.draw({corner(t[0]), corner(t[1]), corner(t[2])}, shader_of(i));
  }
  return averaged(view.size, finer, [&](std::size_t i) {
    return Sample{raster.colours[i], raster.depth[i] < kInfinity ? 1.0 : 0.0, raster.depth[i]};
  });
}

Seen see_mesh(const mesh::Mesh& mesh, const Image* texture, const View& view, std::uint32_t finer) {
  if (texture != nullptr && mesh.uv_sets.empty())
    throw Error(ErrorKind::input, mesh.path + ": has no UVs; unwrap it first");
  return see_triangles(mesh, view, finer, [&](std::size_t triangle) -> Shade {
    if (texture == nullptr) return [](const auto&) { return kGrey; };
    return [&mesh, texture, t = mesh.triangles[triangle]](const std::array<double, 3>& shares) {
      Vec2d uv{};
      for (std::size_t k = 0; k < 3; ++k) {
        const Vec2f own = mesh.uv_sets[0][t[k]];
        uv = uv + Vec2d{own.x, own.y} * shares[k];
      }
      return lookup(*texture, uv.x, uv.y);
    };
  });
}

std::vector<Vec3d> draw_scene(const Scene& scene, const View& view, bool harmonics,
                              Vec3d background) {
  return before(see_scene(scene, view, harmonics, 1), background);
}

std::vector<Vec3d> draw_mesh(const mesh::Mesh& mesh, const Image& texture, const View& view,
                             Vec3d background) {
  return before(see_mesh(mesh, &texture, view, kFiner), background);
}

std::vector<Vec3d> draw_wireframe(const mesh::Mesh& mesh, const View& view, Vec3d background) {
  constexpr double kLine = 0.45;  // pixels from an edge to either side
  constexpr Vec3d kEdge{0.1, 0.15, 0.25};
  const Vec3d lamp = unit(view.forward * -1.0 + view.right * 0.4 - view.down * 0.6);
  const auto shader_of = [&](std::size_t triangle) -> Shade {
    const auto& t = mesh.triangles[triangle];
    std::array<Vec3d, 3> p;
    for (std::size_t k = 0; k < 3; ++k) p[k] = Vec3d(mesh.positions[t[k]]);
    const Vec3d normal = cross(p[1] - p[0], p[2] - p[0]);
    const double light =
        length(normal) > 0 ? 0.45 + 0.5 * std::max(0.0, dot(unit(normal), lamp)) : 0.45;
    // How many pixels each corner is from the opposite edge, as the camera sees it.
    const double area = std::abs(dot(normal, view.forward));
    std::array<double, 3> heights{};
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3d edge = p[(k + 2) % 3] - p[(k + 1) % 3];
      const Vec3d seen = edge - view.forward * dot(edge, view.forward);
      heights[k] = length(seen) > 0 ? area / (length(seen) * view.pixel) : 0;
    }
    return [=](const std::array<double, 3>& shares) {
      for (std::size_t k = 0; k < 3; ++k) {
        if (shares[k] * heights[k] < kLine) return kEdge;
      }
      return Vec3d{1, 1, 1} * light;
    };
  };
  return before(see_triangles(mesh, view, 2 * kFiner, shader_of), background);
}

}  // namespace pounce::score
