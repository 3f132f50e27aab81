// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "core/hash.h"

namespace pounce {

/// From one colour space to another where no matrix and curve do: what a colour configuration says.
/// Thread-safe.
class ColourTransform {
 public:
  virtual ~ColourTransform() = default;
  /// r, g, b in place, of any size and sign. Single precision; its last bits may differ from one
  /// kind of processor to another.
  virtual void apply(std::array<double, 3>& rgb) const noexcept = 0;
  /// The same for transforms that do the same.
  virtual Hash128 identity() const = 0;
};

}  // namespace pounce
