// SPDX-License-Identifier: Apache-2.0
//
// Does a scene lie at a target? Two ways to say yes, since each alone refuses good pairs:
//
//   agree      the distances found are about one, which texels nearly reach: half an object, an
//              offset target
//   complete   nearly all places find a surface, at distances that scatter from place to place, but
//              whose medians over neighbourhoods are small: a target that is off here and there
//
// Another object of about the same size is found everywhere, too. But there it lies off over whole
// regions, which a median over neighbours keeps, where a rough scene's scatter goes.
#include "projection/splat_fit.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace pounce::projection {
namespace {

// By docs/decisions/026-evidence.md.
constexpr double kStraySure = 0.15, kStrayNever = 0.28;  // of the reach
constexpr double kFoundSure = 0.90, kFoundNever = 0.84;  // of the places
constexpr double kOffSure = 0.40, kOffNever = 0.44;      // of the usual reach
constexpr double kAwaySure = 0.55, kAwayNever = 0.65;    // the same of distances that agree
constexpr double kFoundEnough = 0.05;                    // of the places, to say that they agree
constexpr std::size_t kNeighbours = 25;                  // a place among them
/// Median of absolute deviations to the standard deviation of normally spread numbers.
constexpr double kDeviationOverMedian = 1.4826;

/// 0 at `none`, 1 at `all`, straight between.
double ramp(double value, double none, double all) {
  return std::clamp((value - none) / (all - none), 0.0, 1.0);
}

/// The number that this part of them is below. Replaces their order.
double quantile(std::span<double> values, double part) {
  const auto at = static_cast<std::size_t>(part * static_cast<double>(values.size()));
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(at);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

double median(std::span<double> values) { return quantile(values, 0.5); }

std::vector<double> distances_of(std::span<const FoundPlace> found) {
  std::vector<double> distances;
  for (const FoundPlace& place : found) distances.push_back(place.distance);
  return distances;
}

/// How far distances stray from one.
double stray_of(std::span<const FoundPlace> found) {
  std::vector<double> distances = distances_of(found);
  const double middle = median(distances);
  for (double& d : distances) d = std::abs(d - middle);
  return kDeviationOverMedian * median(distances);
}

/// The median distance of the places nearest to this one. `order` is scratch.
double distance_around(std::span<const FoundPlace> found, const Vec3f& position,
                       std::vector<std::pair<double, std::size_t>>& order) {
  order.clear();
  for (std::size_t i = 0; i < found.size(); ++i) {
    const Vec3d to = Vec3d(found[i].position) - Vec3d(position);
    order.emplace_back(dot(to, to), i);  // of places equally far the first ones
  }
  const std::size_t count = std::min(kNeighbours, order.size());
  std::nth_element(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(count) - 1,
                   order.end());
  std::vector<double> distances;
  for (std::size_t k = 0; k < count; ++k) distances.push_back(found[order[k].second].distance);
  return median(distances);
}

/// How far off the scene lies over regions, at three quarters of the places.
double off_by(std::span<const FoundPlace> found) {
  std::vector<std::pair<double, std::size_t>> order;
  std::vector<double> around;
  for (const FoundPlace& place : found)
    around.push_back(std::abs(distance_around(found, place.position, order)));
  return quantile(around, 0.75);
}

/// No farther from `from` are nine places in ten.
double distance_of_most(std::span<const FoundPlace> found, double from) {
  std::vector<double> distances = distances_of(found);
  for (double& d : distances) d = std::abs(d - from);
  return quantile(distances, 0.9);
}

}  // namespace

SplatFit fit_of(std::span<const FoundPlace> found, std::size_t places, const FitLengths& lengths) {
  if (found.empty()) return {};
  const double part = static_cast<double>(found.size()) / static_cast<double>(places);
  const double off = off_by(found) / lengths.usual;
  const double agree = std::min(ramp(stray_of(found) / lengths.reach, kStrayNever, kStraySure),
                                ramp(off, kAwayNever, kAwaySure));
  const double complete =
      std::min(ramp(part, kFoundNever, kFoundSure), ramp(off, kOffNever, kOffSure));
  const double sure = std::max(agree, complete);
  std::vector<double> distances = distances_of(found);
  const double middle = median(distances);
  return {sure < kLeastFit ? 0 : sure * ramp(part, 0, kFoundEnough), distance_of_most(found, 0),
          middle, distance_of_most(found, middle)};
}

std::vector<FoundPlace> found_places(const SplatLimits& limits, const SplatState& state) {
  std::vector<FoundPlace> places;
  for (std::size_t p = 0; p < state.packets.size(); ++p) {
    const TexelPacket& packet = state.packets[p];
    if (const auto found = findings(limits, state, p)[0])
      places.push_back({{packet.px[0], packet.py[0], packet.pz[0]}, found->distance});
  }
  return places;
}

}  // namespace pounce::projection
