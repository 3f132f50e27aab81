// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <cstdlib>

namespace pounce::io {

/// The double with the fewest digits that names this float: JSON writes it as short as that.
inline double shortest(float value) {
  return std::strtod(fmt::format("{}", value).c_str(), nullptr);
}

}  // namespace pounce::io
