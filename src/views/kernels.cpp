// SPDX-License-Identifier: Apache-2.0
#include "views/kernels.h"

#include "core/instruction_set.h"

namespace pounce::views {

namespace sse2 {
extern const ViewKernels kViewKernels;
}
namespace avx2 {
extern const ViewKernels kViewKernels;
}
namespace avx512 {
extern const ViewKernels kViewKernels;
}

const ViewKernels& view_kernels(const std::string& isa) {
  const std::string chosen = instruction_set(isa);
  return chosen == "avx512" ? avx512::kViewKernels
         : chosen == "avx2" ? avx2::kViewKernels
                            : sse2::kViewKernels;
}

}  // namespace pounce::views
