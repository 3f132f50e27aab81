// SPDX-License-Identifier: Apache-2.0
#include "around.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "surface/place_tree.h"
#include "views.h"

namespace pounce::score {
namespace {

/// One direction's pictures of the scene and of the target.
struct Shot {
  View view;
  Seen scene, target;
};

/// Sums over the views that see a point; those in which nothing of the scene lies before it count
/// apart.
struct Sum {
  Vec3d colour, clear_colour;
  double weight = 0, clear_weight = 0;
};

void add(const Shot& shot, const Point& point, double diagonal, const AroundOptions& o, Sum& sum) {
  const View& view = shot.view;
  const double cosine = -dot(point.normal, view.forward);
  if (cosine < o.least_cosine) return;
  const Vec3d from = point.position - view.corner;
  const double x = dot(view.right, from) / view.pixel, y = dot(view.down, from) / view.pixel,
               depth = dot(view.forward, from);
  const double x0 = std::floor(x), y0 = std::floor(y), last = view.size - 1.0;
  if (x0 < 0 || y0 < 0 || x0 >= last || y0 >= last) return;
  const std::size_t first = static_cast<std::size_t>(y0) * view.size + static_cast<std::size_t>(x0);
  const std::array<std::size_t, 4> pixels{first, first + 1, first + view.size,
                                          first + view.size + 1};
  const std::array<double, 4> shares{(1 - (x - x0)) * (1 - (y - y0)), (x - x0) * (1 - (y - y0)),
                                     (1 - (x - x0)) * (y - y0), (x - x0) * (y - y0)};
  double off = 1e300, hidden = -1e300, alpha = 0;
  Vec3d colour;
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t at = pixels[i];
    off = std::min(off, std::abs(shot.target.depth[at] - depth));
    hidden = std::max(hidden, depth - shot.scene.depth[at]);
    alpha += shares[i] * shot.scene.cover[at];
    colour = colour + shot.scene.colours[at] * (shares[i] * shot.scene.cover[at]);
  }
  if (!(off <= o.on_target * diagonal) || alpha < o.least_alpha) return;
  const double weight = std::pow(cosine, o.exponent);
  colour = colour * (weight / alpha);
  sum.colour = sum.colour + colour;
  sum.weight += weight;
  if (hidden > o.hidden * diagonal) return;
  sum.clear_colour = sum.clear_colour + colour;
  sum.clear_weight += weight;
}

/// Each pixel moves away from the mean of eight around it, as far as opposite ones both show the
/// same surface.
void sharpen(Shot& shot, double diagonal, const AroundOptions& o) {
  const double radius = o.ring * diagonal / shot.view.pixel;
  const Seen before = shot.scene;
  const int size = static_cast<int>(shot.view.size);
  const auto index = [&](int x, int y) { return static_cast<std::size_t>(y * size + x); };
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      for (int pair = 0; pair < 4; ++pair) {
        const double angle = pair * std::numbers::pi / 4;
        const int dx = static_cast<int>(std::lround(std::round(radius) * std::cos(angle))),
                  dy = static_cast<int>(std::lround(std::round(radius) * std::sin(angle)));
        bool is_same = true;
        Vec3d mean;
        for (const int side : {-1, 1}) {
          const int nx = x + side * dx, ny = y + side * dy;
          is_same = is_same && nx >= 0 && ny >= 0 && nx < size && ny < size &&
                    std::abs(before.depth[index(nx, ny)] - before.depth[index(x, y)]) <=
                        2 * o.ring * diagonal;
          if (is_same) mean = mean + before.colours[index(nx, ny)] * 0.5;
        }
        if (!is_same) continue;
        Vec3d& colour = shot.scene.colours[index(x, y)];
        colour = colour + (before.colours[index(x, y)] - mean) * (o.sharpened / 4);
      }
    }
  }
}

}  // namespace

std::vector<AroundColour> around(const Scene& scene, const mesh::Mesh& target, const Points& points,
                                 const AroundOptions& o) {
  const std::vector<Vec3d> ways = directions(o.views);
  std::vector<Shot> shots(ways.size());
  tbb::parallel_for(std::size_t{0}, ways.size(), [&](std::size_t i) {
    shots[i].view = view_along(target, ways[i], o.size);
    shots[i].scene = see_scene(scene, shots[i].view, o.harmonics, 1);
    shots[i].target = see_mesh(target, nullptr, shots[i].view, 1);
    if (o.sharpened > 0) sharpen(shots[i], points.diagonal, o);
  });
  std::vector<AroundColour> out(points.points.size());
  tbb::parallel_for(std::size_t{0}, out.size(), [&](std::size_t p) {
    Sum sum;
    for (const Shot& shot : shots) add(shot, points.points[p], points.diagonal, o, sum);
    const bool clear = sum.clear_weight > 0;
    out[p].weight = clear ? sum.clear_weight : sum.weight;
    if (out[p].weight > 0)
      out[p].colour = (clear ? sum.clear_colour : sum.colour) * (1 / out[p].weight);
  });
  return out;
}

std::vector<Vec3d> nearest_colours(const Scene& scene, const Points& points) {
  // A place has a normal, which nobody asks for here: it carries the colour.
  std::vector<surface::Place> places;
  for (const Gaussian& g : scene.gaussians) places.push_back({Vec3f(g.mean), Vec3f(g.colour)});
  const surface::PlaceTree tree(places);
  std::vector<Vec3d> out(points.points.size());
  tbb::parallel_for(std::size_t{0}, out.size(), [&](std::size_t p) {
    constexpr float kAnyFacing = -2, kFar = 1e18F;
    out[p] = Vec3d(tree.nearest(Vec3f(points.points[p].position), {}, kAnyFacing, kFar)->normal);
  });
  return out;
}

}  // namespace pounce::score
