// SPDX-License-Identifier: Apache-2.0
#include "projection/splat_fit.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace pounce::projection {
namespace {

// By docs/decisions/026-evidence.md.
constexpr double kStraySure = 0.15, kStrayNever = 0.28;  // of the reach
constexpr double kFoundSure = 0.90, kFoundNever = 0.84;  // of the places
constexpr double kFoundEnough = 0.05;                    // of the places, to say that they agree
/// Median of absolute deviations to the standard deviation of normally spread numbers.
constexpr double kDeviationOverMedian = 1.4826;

/// 0 at `none`, 1 at `all`, straight between.
double ramp(double value, double none, double all) {
  return std::clamp((value - none) / (all - none), 0.0, 1.0);
}

double median(std::span<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

double fit_of(std::span<double> distances, std::size_t places, double reach) {
  if (distances.empty()) return 0;
  const double found = static_cast<double>(distances.size()) / static_cast<double>(places);
  const double middle = median(distances);
  for (double& d : distances) d = std::abs(d - middle);
  const double stray = kDeviationOverMedian * median(distances) / reach;
  const double agree = ramp(stray, kStrayNever, kStraySure) * ramp(found, 0, kFoundEnough);
  return std::max(agree, ramp(found, kFoundNever, kFoundSure));
}

double fit_of(const SplatLimits& limits, const SplatState& state) {
  std::vector<double> distances;
  for (std::size_t p = 0; p < state.packets.size(); ++p) {
    if (const auto found = finding(limits, state, p, 0)) distances.push_back(found->distance);
  }
  return fit_of(distances, state.packets.size(), double{limits.reach});
}

}  // namespace pounce::projection
