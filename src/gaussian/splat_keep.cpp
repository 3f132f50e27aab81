// SPDX-License-Identifier: Apache-2.0
#include "gaussian/splat_keep.h"

#include <algorithm>
#include <cmath>

namespace pounce::gaussian {
namespace {

using store::SplatFilter;

/// Rounding of cells and boxes decides nothing: what is this much farther counts as near, too.
constexpr float kSlack = 1.001F;

void add(Hasher& hash, const Vec3f& v) {
  for (const float c : {v.x, v.y, v.z}) hash.add(c);
}

template <class T>
void add(Hasher& hash, const std::optional<T>& value) {
  hash.add(value.has_value());
  if (value) hash.add(*value);
}

bool holds(const Box3f& box, const Vec3f& p) { return box.overlaps({p, p}); }

}  // namespace

NearSurface::NearSurface(const mesh::Mesh& target, double distance)
    : rows_(static_cast<std::size_t>(kCells) * kCells) {
  const float grow = static_cast<float>(distance) * kSlack;
  for (const auto& triangle : target.triangles) {
    for (const std::uint32_t corner : triangle) box_.extend(target.positions[corner]);
  }
  if (box_.empty()) return;
  box_ = box_.grown(grow);
  const Vec3f size = box_.hi - box_.lo;
  cell_ = std::max({size.x, size.y, size.z, 1e-30F}) / kCells;
  if (!std::isfinite(cell_)) return;  // everything is near
  for (const auto& triangle : target.triangles) {
    Box3f near;
    for (const std::uint32_t corner : triangle) near.extend(target.positions[corner]);
    near = near.grown(grow);
    const Cell first = cell_of(near.lo), last = cell_of(near.hi);
    const std::uint64_t bits = (~0ULL << first[0]) & (~0ULL >> (kCells - 1 - last[0]));
    for (int z = first[2]; z <= last[2]; ++z) {
      for (int y = first[1]; y <= last[1]; ++y)
        rows_[static_cast<std::size_t>(z * kCells + y)] |= bits;
    }
  }
}

NearSurface::Cell NearSurface::cell_of(Vec3f at) const {
  const auto along = [&](float v, float lo) {
    return static_cast<int>(std::clamp((v - lo) / cell_, 0.0F, static_cast<float>(kCells - 1)));
  };
  return {along(at.x, box_.lo.x), along(at.y, box_.lo.y), along(at.z, box_.lo.z)};
}

bool NearSurface::meets(const Box3f& box) const {
  if (!std::isfinite(cell_)) return true;
  if (!box_.overlaps(box)) return false;
  const Cell first = cell_of(box.lo), last = cell_of(box.hi);
  const std::uint64_t bits = (~0ULL << first[0]) & (~0ULL >> (kCells - 1 - last[0]));
  for (int z = first[2]; z <= last[2]; ++z) {
    for (int y = first[1]; y <= last[1]; ++y) {
      if ((rows_[static_cast<std::size_t>(z * kCells + y)] & bits) != 0) return true;
    }
  }
  return false;
}

void NearSurface::add_to(Hasher& hash) const {
  add(hash, box_.lo);
  add(hash, box_.hi);
  for (const std::uint64_t row : rows_) hash.add(row);
}

std::optional<SplatFilter> SplatKeep::filter(const store::Splat& splat) const {
  if (min_alpha && splat.alpha < *min_alpha) return SplatFilter::faint;
  if (max_sigma && store::size_of(splat) > *max_sigma) return SplatFilter::too_large;
  if (box && !holds(*box, splat.mean)) return SplatFilter::outside_box;
  if (!near.empty()) {
    const Box3f reach = store::splat_box(splat);
    const bool meets =
        std::any_of(near.begin(), near.end(), [&](const auto& one) { return one->meets(reach); });
    if (!meets) return SplatFilter::out_of_reach;
  }
  return lattice ? lattice->filter(splat) : std::nullopt;
}

void SplatKeep::add_to(Hasher& hash) const {
  add(hash, min_alpha);
  add(hash, max_sigma);
  hash.add(box.has_value());
  if (box) {
    add(hash, box->lo);
    add(hash, box->hi);
  }
  hash.add(static_cast<std::uint64_t>(near.size()));
  for (const auto& one : near) one->add_to(hash);
}

}  // namespace pounce::gaussian
