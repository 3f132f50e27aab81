// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "unwrap/charts.h"
#include "unwrap/outline.h"

namespace pounce::unwrap {

/// The area of the hull around a chart.
double hull_area(const Outline& outline);

/// Where a straight line cuts a chart best: of each of its triangles, on which side its middle is.
/// That is where the hulls around both parts are smallest together, with so much more for each unit
/// of the cut. None: there is no cut, or `if_smaller` and none is smaller than the chart's own
/// hull.
std::vector<char> halves(const Chart& chart, const Outline& outline, double per_length,
                         bool if_smaller);

}  // namespace pounce::unwrap
