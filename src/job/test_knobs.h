// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "core/file.h"

namespace pounce::job {

/// What tests and benchmarks turn besides a job's options. The result depends on none of it but the
/// last.
struct TestKnobs {
  std::uint64_t tile_cap_bytes = 0;  ///< of a spatial tile; 0 = usual
  std::uint32_t stripe_rows = 0;     ///< rows handed to the padder at once; 0 = a row of blocks
  std::string isa = "";              ///< "sse2", "avx2" or "avx512"; empty = as POUNCE_ISA says
  FileSystem* files = nullptr;  ///< holds every store; one in memory: the streamed path's reference
  std::size_t most_ellipses = 0;  ///< drawn at once, of a scene's views; 0 = what the budget holds
  bool keeps_isolated = false;    ///< do not fade isolated Gaussians: for references of the blend
};

}  // namespace pounce::job
