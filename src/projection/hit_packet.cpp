// SPDX-License-Identifier: Apache-2.0
//
// Which build of the kernels runs, and the lists that they run over.
//
// One source is compiled per instruction set (kernels.cpp.in), each in a namespace of its own.
// Inline functions that two builds shared under one name would be merged by the linker, and a
// processor could meet instructions that it does not have. All builds give the same bits, so the
// choice shows in time only.
#include "projection/hit_packet.h"

#include <algorithm>

#include "pounce/error.h"

namespace pounce::projection {

namespace sse2 {
extern const Kernels kKernels;
}
namespace avx2 {
extern const Kernels kKernels;
}
namespace avx512 {
extern const Kernels kKernels;
}

const Kernels& kernels(const std::string& isa) {
  const bool has_avx512 =
      __builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512dq") != 0 &&
      __builtin_cpu_supports("avx512vl") != 0 && __builtin_cpu_supports("avx512bw") != 0;
  const bool has_avx2 = __builtin_cpu_supports("avx2") != 0;
  // A set that is asked for by name is not replaced: tests and benchmarks want this one or an
  // error.
  if (isa == "avx512" && has_avx512) return avx512::kKernels;
  if (isa == "avx2" && has_avx2) return avx2::kKernels;
  if (isa == "sse2") return sse2::kKernels;
  if (!isa.empty()) {
    throw Error(ErrorKind::usage,
                "this processor has no \"" + isa + "\" kernels (choose sse2, avx2 or avx512)");
  }
  return has_avx512 ? avx512::kKernels : has_avx2 ? avx2::kKernels : sse2::kKernels;
}

void Candidates::add(const grid::GridItem& item) {
  // Arrays grow by whole registers, so that kernels may load sixteen from any multiple of sixteen.
  // Capacity stays from group to group.
  if (count_ == radius_.size()) {
    const std::size_t room = count_ + kLanes;
    for (auto& axis : centre_) axis.resize(room);
    radius_.resize(room);
    facets_.resize(room);
  }
  centre_[0][count_] = item.centre.x;
  centre_[1][count_] = item.centre.y;
  centre_[2][count_] = item.centre.z;
  radius_[count_] = item.radius;
  facets_[count_++] = item.facet;
}

void clear(HitPacket& best) {
  best = HitPacket{};
  std::fill(std::begin(best.key), std::end(best.key), kNoHit);
  std::fill(std::begin(best.id), std::end(best.id), kNoHit);
}

}  // namespace pounce::projection
