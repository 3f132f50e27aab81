// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <string>

#include "scene.h"
#include "support/splat_ply_builder.h"
#include "support/test_data.h"

namespace pounce::test {

inline constexpr double kC0 = 0.28209479177387814;

/// A flat disc across z through (0, 0, z), round with a standard deviation of 0.2.
inline SplatPlyBuilder::Row disc(double z, double opacity, Vec3d colour) {
  return {{"z", z},
          {"f_dc_0", (colour.x - 0.5) / kC0},
          {"f_dc_1", (colour.y - 0.5) / kC0},
          {"f_dc_2", (colour.z - 0.5) / kC0},
          {"opacity", std::log(opacity / (1 - opacity))},
          {"scale_0", std::log(0.2)},
          {"scale_1", std::log(0.2)},
          {"scale_2", std::log(0.001)},
          {"rot_0", 1}};
}

inline score::Scene scene_of(const SplatPlyBuilder& ply) {
  const TempFolder folder;
  ply.write(folder.file("s.ply"));
  return score::read_scene(folder.file("s.ply"));
}

inline constexpr Vec3d kFront{0.9, 0.1, 0.2}, kBack{0.1, 0.6, 0.8};

/// A disc of opacity 0.6 at z = 1 and one of 0.8 at z = 0.
inline score::Scene two_discs() {
  SplatPlyBuilder ply;
  ply.rows = {disc(0, 0.8, kBack), disc(1, 0.6, kFront)};
  return scene_of(ply);
}

}  // namespace pounce::test
