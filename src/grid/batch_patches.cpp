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

void PatchSpheres::take(const PatchSpheres& from, std::span<const std::uint16_t> places) {
  reserve(places.size());
  count_ = places.size();
  for (std::size_t i = 0; i < places.size(); ++i) {
    const std::size_t at = places[i];
    for (std::size_t axis = 0; axis < 3; ++axis) centre_[axis][i] = from.centre_[axis][at];
    radius_[i] = from.radius_[at];
    facets_[i] = from.facets_[at];
  }
}

BatchPatches::BatchPatches(std::span<const surface::SourceBlock* const> blocks, const Box3f& region,
                           std::size_t most_listed) {
  std::size_t patches = 0;
  for (const auto* block : blocks) patches += block->patches.size();
  const std::size_t most = std::min(most_listed, kMostListed);
  list_.reserve(std::min(patches, most));
  for (const auto* block : blocks) {
    for (const surface::Patch& patch : block->patches) {
      if (!patch.box.overlaps(region)) continue;
      if (list_.size() == most) {
        list_ = {};
        grid_.emplace(blocks, region);
        return;
      }
      list_.add(patch.centre, patch.radius, &block->facets[patch.facet]);
    }
  }
}

}  // namespace pounce::grid
