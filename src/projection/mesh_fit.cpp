// SPDX-License-Identifier: Apache-2.0
//
// That another head lies off by three per cent is no fault; that the same head does is one, and a
// user wants to hear what would bring them together. So the places of the target are moved to where
// they lie best on the source, by least squares of their distances from the planes of the nearest
// places there; where that is much nearer than as they are, they are misaligned. Where they start
// too far away for that, each of the 48 ways to name axes is tried, with both brought to one centre
// and size.
//
// A report and a warning come of it, nothing else: no texel depends on it. So it works on places
// strewn over both surfaces, 256 and 4096, and costs the same for meshes of any size. The search is
// iterative closest point with distances to planes. Its result is only believed where it brings the
// surfaces much nearer than they are, since least squares always find something.
#include "projection/mesh_fit.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "surface/place_tree.h"

namespace pounce::projection {
namespace {

using surface::Place;
using surface::PlaceTree;

constexpr double kReach = 0.05;      // of the target's size: farther away is not near at all
constexpr double kNear = 0.005;      // of the same: nearer is at the surface
constexpr double kLateral = 3;       // of the reach: no place of the source is near
constexpr double kFacing = 0.25;     // cosine: places of one side of a surface face alike
constexpr int kRounds = 14;          // of least squares: what starts within the reach has settled
constexpr double kLeastGain = 0.12;  // of nearness
constexpr double kSettled = 0.5;     // of the distance: what moving leaves of it, where it helps
constexpr double kMovedNear = 0.70;  // of the places lie near then
constexpr double kMostOff = 0.9;     // of the places: how far these are off is what is judged
constexpr double kOffAsIs = 0.004;   // of the target's size: no farther off is on the surface
constexpr double kSame = 0.35;       // of that, and of how they are off as they are: one surface

Vec3d unit(Vec3d v) {
  const double size = length(v);
  return size > 0 ? v * (1 / size) : v;
}

/// Where each place of the target lies, in a pose.
struct Found {
  Vec3d point, normal;
  double distance = 0;  ///< from the plane, along its normal
  bool is_near = false;
};

double scale_of(const Pose& pose) {
  return std::cbrt(std::abs(dot(pose.columns[0], cross(pose.columns[1], pose.columns[2]))));
}

double quantile(std::vector<double> values, double part) {
  if (values.empty()) return 0;
  const auto at = static_cast<std::size_t>(part * static_cast<double>(values.size()));
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(at);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

/// Clothes, cages and proxies lie off by about one distance all over: what is judged is how far
/// places are off from that.
void leave_out_layer(std::vector<Found>& found) {
  std::vector<double> distances;
  for (const Found& f : found) {
    if (f.is_near) distances.push_back(f.distance);
  }
  const double layer = quantile(std::move(distances), 0.5);
  for (Found& f : found) f.distance -= f.is_near ? layer : 0;
}

std::vector<Found> find(std::span<const Place> target, double facing, const PlaceTree& source,
                        const Pose& pose, double reach) {
  std::vector<Found> found(target.size());
  for (std::size_t i = 0; i < target.size(); ++i) {
    const Vec3d p = pose.point(Vec3d(target[i].position));
    const Vec3d n = unit(pose.direction(Vec3d(target[i].normal))) * facing;
    const Place* const at = source.nearest(Vec3f(p), Vec3f(n), static_cast<float>(kFacing),
                                           static_cast<float>(kLateral * reach));
    found[i].point = p;
    if (at == nullptr) continue;
    found[i].normal = Vec3d(at->normal);
    found[i].distance = dot(Vec3d(at->position) - p, found[i].normal);
    found[i].is_near = std::abs(found[i].distance) < reach;
  }
  return found;
}

/// 1: all lie on the source; 0: none is within reach.
double nearness(const std::vector<Found>& found, double reach) {
  double sum = 0;
  for (const Found& f : found) sum += f.is_near ? 1 - std::abs(f.distance) / reach : 0;
  return sum / static_cast<double>(found.size());
}

double part_within(const std::vector<Found>& found, double distance) {
  const auto count = std::count_if(found.begin(), found.end(), [&](const Found& f) {
    return f.is_near && std::abs(f.distance) < distance;
  });
  return static_cast<double>(count) / static_cast<double>(found.size());
}

/// How far off most places are.
double off_by(const std::vector<Found>& found, double reach) {
  std::vector<double> distances;
  for (const Found& f : found) distances.push_back(f.is_near ? std::abs(f.distance) : reach);
  return quantile(std::move(distances), kMostOff);
}

// --- least squares -------------------------------------------------------------------------------

constexpr std::size_t kUnknowns = 7;  // a turn, a shift and a growth
using Row = std::array<double, kUnknowns>;

/// Solves the normal equations by elimination; false where they say nothing.
bool solve(std::array<Row, kUnknowns> a, Row b, Row& x) {
  for (std::size_t k = 0; k < kUnknowns; ++k) {
    std::size_t pivot = k;
    for (std::size_t i = k + 1; i < kUnknowns; ++i) {
      if (std::abs(a[i][k]) > std::abs(a[pivot][k])) pivot = i;
    }
    if (!(std::abs(a[pivot][k]) > 0)) return false;
    std::swap(a[k], a[pivot]);
    std::swap(b[k], b[pivot]);
    for (std::size_t i = k + 1; i < kUnknowns; ++i) {
      const double factor = a[i][k] / a[k][k];
      for (std::size_t j = k; j < kUnknowns; ++j) a[i][j] -= factor * a[k][j];
      b[i] -= factor * b[k];
    }
  }
  for (std::size_t k = kUnknowns; k-- > 0;) {
    double sum = b[k];
    for (std::size_t j = k + 1; j < kUnknowns; ++j) sum -= a[k][j] * x[j];
    x[k] = sum / a[k][k];
  }
  return true;
}

std::array<Vec3d, 3> turn(Vec3d by) {
  const double angle = length(by);
  std::array<Vec3d, 3> columns{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  if (!(angle > 0)) return columns;
  const Vec3d k = by * (1 / angle);
  // Rodrigues. A turn is small each time, and what is reported is rounded.
  const double s = std::sin(angle), c = 1 - std::cos(angle);
  for (Vec3d& v : columns) v = v + cross(k, v) * s + cross(k, cross(k, v)) * c;
  return columns;
}

/// Moves the pose to where the places found lie nearer; false where nothing can be said.
bool improve(const std::vector<Found>& found, double reach, double size, bool grows, Pose& pose) {
  Vec3d middle;
  double count = 0;
  for (const Found& f : found) {
    if (!f.is_near) continue;
    middle = middle + f.point;
    ++count;
  }
  constexpr double kEnough = 20;
  if (count < kEnough) return false;
  middle = middle * (1 / count);
  std::array<Row, kUnknowns> a{};
  Row b{}, x{};
  double trace = 0;
  for (const Found& f : found) {
    if (!f.is_near) continue;
    const Vec3d q = (f.point - middle) * (1 / size);
    const Vec3d t = cross(q, f.normal);
    const Row row{t.x, t.y, t.z, f.normal.x, f.normal.y, f.normal.z, dot(q, f.normal)};
    const double off = f.distance / (reach / 2), weight = 1 / (1 + off * off);
    for (std::size_t i = 0; i < kUnknowns; ++i) {
      for (std::size_t j = 0; j < kUnknowns; ++j) a[i][j] += weight * row[i] * row[j];
      b[i] += weight * row[i] * f.distance;
      trace += weight * row[i] * row[i];
    }
  }
  // A ball turns and a plane slides for nothing: then neither does.
  constexpr double kStiffness = 1e-3;
  // What the places do not determine gets no weight from them, and without this would take any
  // value.
  for (std::size_t i = 0; i < kUnknowns; ++i) a[i][i] += kStiffness * trace / kUnknowns;
  if (!grows) {  // row and column of the growth say that there is none
    for (std::size_t i = 0; i < kUnknowns; ++i) a[i][6] = a[6][i] = i == 6 ? 1 : 0;
    b[6] = 0;
  }
  if (!solve(a, b, x)) return false;
  // The equations are linear in the growth, which holds for small steps only.
  const double growth = std::clamp(1 + x[6] / size, 0.8, 1.25);
  const auto turned = turn({x[0] / size, x[1] / size, x[2] / size});
  const auto moved = [&](Vec3d v) {
    return (turned[0] * v.x + turned[1] * v.y + turned[2] * v.z) * growth;
  };
  const Vec3d centre = moved(pose.centre + pose.shift - middle) + middle + Vec3d{x[3], x[4], x[5]};
  for (Vec3d& column : pose.columns) column = moved(column);
  pose.shift = centre - pose.centre;
  return true;
}

Pose settle(std::span<const Place> target, double facing, const PlaceTree& source, Pose pose,
            double reach, bool grows) {
  for (int round = 0; round < kRounds; ++round) {
    // Wide at first, to be drawn from afar; then what is off no more draws.
    const double now = round < kRounds / 2 ? 2 * reach : reach;
    std::vector<Found> found = find(target, facing, source, pose, now);
    // With a growth among the unknowns, a constant distance all around is a difference in size,
    // which is what is asked for then.
    if (!grows) leave_out_layer(found);
    if (!improve(found, now, reach / kReach, grows, pose)) break;
  }
  return pose;
}

// --- from far away -------------------------------------------------------------------------------

/// All ways to name axes, those that files differ by first.
std::vector<Axes> all_axes() {
  std::vector<Axes> all;
  constexpr std::array<std::array<std::uint8_t, 3>, 6> kOrders{
      {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {2, 1, 0}, {1, 2, 0}, {2, 0, 1}}};
  for (const auto& order : kOrders) {
    for (const int mirrors : {0, 1}) {
      for (int bits = 0; bits < 8; ++bits) {
        Axes axes;
        axes.from = order;
        for (std::size_t i = 0; i < 3; ++i)
          axes.sign[i] = static_cast<std::int8_t>((bits >> i & 1) != 0 ? -1 : 1);
        if (axes.mirrors() == (mirrors == 1)) all.push_back(axes);
      }
    }
  }
  return all;
}

std::array<Vec3d, 3> columns_of(const Axes& axes, double scale) {
  std::array<Vec3d, 3> columns;
  columns[0] = axes.apply(Vec3d{scale, 0, 0});
  columns[1] = axes.apply(Vec3d{0, scale, 0});
  columns[2] = axes.apply(Vec3d{0, 0, scale});
  return columns;
}

struct Extent {
  Vec3d centre;
  double radius = 0;  ///< root of the mean square
};

Extent extent_of(std::span<const Place> places) {
  Extent extent;
  const double count = static_cast<double>(places.size());
  for (const Place& place : places) extent.centre = extent.centre + Vec3d(place.position);
  extent.centre = extent.centre * (1 / count);
  for (const Place& place : places) {
    const Vec3d from = Vec3d(place.position) - extent.centre;
    extent.radius += dot(from, from);
  }
  extent.radius = std::sqrt(extent.radius / count);
  return extent;
}

/// Every n-th place, so that there are no more than this.
std::vector<Place> thinned(std::span<const Place> places, std::size_t most) {
  std::vector<Place> some;
  const std::size_t step = (places.size() + most - 1) / most;
  for (std::size_t i = 0; i < places.size(); i += step) some.push_back(places[i]);
  return some;
}

/// Poses of axes, with a shift and scale that make both as large and at one place, from which least
/// squares find the best: the most likely ones, of equal ones those that files differ by first.
std::vector<Pose> from_afar(std::span<const Place> target, double facing,
                            std::span<const Place> source, double diagonal) {
  constexpr std::size_t kTries = 4;
  const Extent there = extent_of(source), here = extent_of(target);
  const double scale = here.radius > 0 ? there.radius / here.radius : 1;
  const std::vector<Place> few = thinned(target, 128), some = thinned(source, 2048);
  const PlaceTree tree(some);
  const double reach = kReach * diagonal * scale;
  std::vector<std::pair<double, Pose>> tried;
  // All 48 are cheap to try on few places. Least squares run only for the best of them.
  for (const Axes& axes : all_axes()) {
    const Pose pose{columns_of(axes, scale), here.centre, there.centre - here.centre};
    // Of what looks the same in a mirror, the one that needs none.
    constexpr double kMirrored = 0.05;
    const double near = nearness(find(few, facing, tree, pose, reach), reach);
    tried.emplace_back(near - (axes.mirrors() ? kMirrored : 0), pose);
  }
  std::stable_sort(tried.begin(), tried.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<Pose> poses;
  for (std::size_t i = 0; i < kTries; ++i) poses.push_back(tried[i].second);
  return poses;
}

/// Do the places of the target that lie next to the source face the other way?
bool is_opposed(std::span<const Place> target, const PlaceTree& source, double reach) {
  std::size_t against = 0, near = 0;
  for (const Place& place : target) {
    constexpr float kAnyFacing = -2;
    const Place* const best =
        source.nearest(place.position, place.normal, kAnyFacing, static_cast<float>(reach));
    if (best == nullptr) continue;
    ++near;
    against += dot(best->normal, place.normal) < 0 ? 1 : 0;
  }
  return 2 * near > target.size() && 5 * against > 4 * near;
}

/// Do normals look to where the surface's middle is, on the whole?
bool is_inward(std::span<const Place> places) {
  const Vec3d centre = extent_of(places).centre;
  double outward = 0;
  for (const Place& place : places)
    outward += dot(Vec3d(place.position) - centre, Vec3d(place.normal));
  return outward < 0;
}

}  // namespace

PoseParts parts_of(const Pose& pose) {
  PoseParts parts;
  parts.scale = scale_of(pose);
  std::array<Vec3d, 3> columns = pose.columns;
  for (Vec3d& column : columns) column = column * (1 / parts.scale);
  double most = 0;
  // The nearest of the 48 namings of axes, by the trace of the product; the first of equal ones is
  // the one that files differ by.
  for (const Axes& axes : all_axes()) {
    const auto other = columns_of(axes, 1);
    const double alike =
        dot(columns[0], other[0]) + dot(columns[1], other[1]) + dot(columns[2], other[2]);
    if (alike <= most + 1e-9) continue;
    most = alike;
    parts.axes = axes;
  }
  // What is left to turn after the axes: columns * axes^-1.
  const auto left = [&](Vec3d v) {
    const Vec3d u = parts.axes.undo(v);
    return columns[0] * u.x + columns[1] * u.y + columns[2] * u.z;
  };
  const Vec3d x = left({1, 0, 0}), y = left({0, 1, 0}), z = left({0, 0, 1});
  const double cosine = std::clamp((x.x + y.y + z.z - 1) / 2, -1.0, 1.0);
  parts.degrees = std::acos(cosine) * (180 / 3.14159265358979323846);
  parts.about = unit({y.z - z.y, z.x - x.z, x.y - y.x});
  return parts;
}

MeshFit fit_of(std::span<const Place> target, std::span<const Place> source, double diagonal) {
  MeshFit fit;
  if (target.empty() || source.empty() || !(diagonal > 0)) return fit;
  const double reach = kReach * diagonal;
  const PlaceTree tree(source);
  fit.opposed = is_opposed(target, tree, reach);
  fit.target_inward = fit.opposed && is_inward(target);
  fit.source_inward = fit.opposed && is_inward(source);
  const double facing = fit.opposed ? -1 : 1;
  Pose as_is;
  as_is.centre = extent_of(target).centre;
  auto now = find(target, facing, tree, as_is, reach);
  fit.lie_near = part_within(now, kNear * diagonal);
  leave_out_layer(now);
  const double near = nearness(now, reach), off = off_by(now, reach);
  if (off < kOffAsIs * diagonal) return fit;
  double best = 0;
  const auto consider = [&](Pose pose, bool grows, bool must_be_one) {
    pose = settle(target, facing, tree, pose, reach * scale_of(pose), grows);
    const double scale = scale_of(pose), scaled = reach * scale;
    auto then = find(target, facing, tree, pose, scaled);
    const double would_lie_near = part_within(then, kNear * diagonal * scale);
    leave_out_layer(then);
    const double moved = nearness(then, scaled);
    // Compared over the same places, those that are near after the move: others would favour a move
    // that loses them.
    std::vector<double> before, after;
    for (std::size_t i = 0; i < then.size(); ++i) {
      if (!then[i].is_near) continue;
      before.push_back(now[i].is_near ? std::abs(now[i].distance) : reach);
      after.push_back(std::abs(then[i].distance) / scale);
    }
    const bool is_nearer = moved - near > kLeastGain && moved > kMovedNear &&
                           quantile(after, 0.5) < kSettled * quantile(before, 0.5);
    const bool is_one = off_by(then, scaled) / scale < kSame * off && moved > near;
    constexpr double kMuchBetter = 0.01;  // or it is the same in other words
    if (!(is_one || (is_nearer && !must_be_one)) || moved < best + kMuchBetter) return;
    best = moved;
    fit.fit = near / moved;
    fit.better = pose;
    fit.would_lie_near = would_lie_near;
  };
  // From the cheap explanation to the dear one: moved, moved and scaled, other axes. A later one
  // has to be clearly better to replace an earlier one.
  consider(as_is, false, false);
  if (!fit.better) consider(as_is, true, true);
  constexpr double kDone = 0.9;
  if (fit.would_lie_near < kDone) {
    for (const Pose& pose : from_afar(target, facing, source, diagonal))
      consider(pose, true, false);
  }
  return fit;
}

}  // namespace pounce::projection
