// SPDX-License-Identifier: Apache-2.0
//
// A batch of a piece: most have 50 to 250 patches, which no grid finds as fast as a comparison with
// all of them, sixteen at a time. A list needs no cells to be chosen, counted and filled, either.
#include "grid/batch_patches.h"

#include <algorithm>

namespace pounce::grid {
namespace {

constexpr std::size_t kRegister = 16;  // floats

constexpr std::size_t whole_registers(std::size_t count) {
  return (count + kRegister - 1) / kRegister * kRegister;
}

}  // namespace

void PatchSpheres::reserve(std::size_t count) {
  // Arrays grow by whole registers, so that kernels may load sixteen from any multiple of sixteen.
  const std::size_t room = whole_registers(count);
  if (room <= radius_.size()) return;
  for (auto& axis : centre_) axis.resize(room);
  radius_.resize(room);
  facets_.resize(room);
}

void PatchSpheres::add(Vec3f centre, float radius, const surface::Facet* facet) {
  reserve(count_ + 1);
  centre_[0][count_] = centre.x;
  centre_[1][count_] = centre.y;
  centre_[2][count_] = centre.z;
  radius_[count_] = radius;
  facets_[count_++] = facet;
}

void PatchSpheres::add(const PatchSpheres& from, std::size_t i) {
  add({*from.x(i), *from.y(i), *from.z(i)}, *from.radius(i), from.facets_[i]);
}

BatchPatches::BatchPatches(std::span<const surface::SourceBlock* const> blocks, const Box3f& region,
                           std::size_t most_listed) {
  std::size_t count = 0;
  for (const auto* block : blocks) {
    for (const surface::Patch& patch : block->patches) count += patch.box.overlaps(region) ? 1 : 0;
  }
  if (count > std::min(most_listed, kMostListed)) {
    grid_.emplace(blocks, region);
    return;
  }
  list_.reserve(count);
  for (const auto* block : blocks) {
    for (const surface::Patch& patch : block->patches) {
      if (patch.box.overlaps(region))
        list_.add(patch.centre, patch.radius, &block->facets[patch.facet]);
    }
  }
}

}  // namespace pounce::grid
