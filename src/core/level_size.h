// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pounce/options.h"

namespace pounce {

/// Of an output: half as large, rounded down, at least 1 each way, as maketx and renderers have it.
constexpr ImageSize next_level_size(ImageSize size) {
  return {size.width > 1 ? size.width / 2 : 1, size.height > 1 ? size.height / 2 : 1};
}

}  // namespace pounce
