// SPDX-License-Identifier: Apache-2.0
//
// The candidates of a group, as arrays that kernels read sixteen at a time. A scene's group may
// have many thousands; what they may take is leased before (`most`), so arrays grow up to that and
// never beyond.
#include "projection/splat_packet.h"

#include <algorithm>

#include "core/instruction_set.h"

namespace pounce::projection {

namespace sse2 {
extern const SplatKernels kSplatKernels;
}
namespace avx2 {
extern const SplatKernels kSplatKernels;
}
namespace avx512 {
extern const SplatKernels kSplatKernels;
}

const SplatKernels& splat_kernels(const std::string& isa) {
  const std::string chosen = instruction_set(isa);
  return chosen == "avx512" ? avx512::kSplatKernels
         : chosen == "avx2" ? avx2::kSplatKernels
                            : sse2::kSplatKernels;
}

SplatCandidates::SplatCandidates(std::size_t most) : most_((most + kLanes - 1) / kLanes * kLanes) {}

void SplatCandidates::add(const gaussian::SplatSet& set, std::size_t i) {
  if (count_ == radius_.size()) {
    const std::size_t room = std::min(count_ + std::max(count_, 52UL * kLanes), most_);
    const auto grow = [room](auto& column) {
      column.reserve(room);  // no more: resize() alone doubles what there is
      column.resize(room);
    };
    for (auto& axis : centre_) grow(axis);
    grow(radius_);
    for (auto& column : covariance_) grow(column);
    grow(shapes_);
  }
  const gaussian::SplatSpheres& spheres = set.levels[0];
  // Copied out of the block, shapes by reference: the copies are what every packet of the group
  // culls by.
  for (std::size_t k = 0; k < 3; ++k) centre_[k][count_] = spheres.centre[k][i];
  radius_[count_] = spheres.radius[i];
  for (std::size_t c = 0; c < 6; ++c) covariance_[c][count_] = set.covariance[c][i];
  shapes_[count_++] = &set.shapes[i];
}

}  // namespace pounce::projection
