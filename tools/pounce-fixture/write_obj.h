// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "grid_chart.h"

namespace pounce::fixture {

/// Writes charts as an OBJ (UV set 0, v up) with a material `skin` in an MTL beside it, whose
/// map_Kd is `texture` (a file name beside it; empty: no MTL and no material). Numbers are the
/// shortest that read back to the same float, so the OBJ holds exactly the GLB's positions.
/// Streams; throws Error(storage).
void write_obj(const std::string& path, const GridMesh& mesh, const std::string& texture);

}  // namespace pounce::fixture
