// SPDX-License-Identifier: Apache-2.0
#include "pounce/report.h"

namespace pounce {

std::span<const LeftOutReason> left_out_reasons() {
  static constexpr std::array<LeftOutReason, 11> kReasons{{
      {"outside_box", "outside of --box"},
      {"faint", "below --min-opacity"},
      {"too_large", "above --max-scale"},
      {"out_of_reach", "farther from the target than any texel looks (--near-target)"},
      {"less_important", "beyond --count"},
      {"transparent", "transparent"},
      {"far", "far away from the scene"},
      {"exploded", "larger than the whole scene"},
      {"sizeless", "without size"},
      {"zero_quaternion", "without rotation"},
      {"not_finite", "not finite"},
  }};
  return kReasons;
}

}  // namespace pounce
