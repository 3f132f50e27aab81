// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "core/bounds.h"
#include "store/blocks/splat_store.h"

namespace pounce::store {

/// The order of a splat store: a size class, and within it a Morton code on one lattice for the
/// whole scene. The lattice's cells are equal cubes in the middle of the scene, 2^20 across the
/// widest side of what is left of a sample without its outer tenths; outside they grow with the
/// distance, so that a stray Gaussian far away costs no resolution. Thread-safe.
class SplatLattice {
 public:
  /// From Gaussians taken evenly from the scene. None give a lattice of unit cells. Takes 16 bytes
  /// for each of them meanwhile.
  explicit SplatLattice(std::span<const Splat> sample);

  /// Gaussians of no use to anybody: beyond 2^16 times the half width of the middle, or larger.
  std::optional<SplatFilter> filter(const Splat& splat) const;
  /// Smaller comes first. Only for Gaussians that filter() lets through.
  std::uint64_t key(const Splat& splat) const;
  static std::uint64_t key_size_class(std::uint64_t key) {
    return (key >> 63) == 0 ? 0 : key >> kClassShift & 63;
  }
  /// How far apart two neighbours in the order are: the level of the smallest lattice cube that
  /// holds both, largest where the class changes.
  static int distance(std::uint64_t key, std::uint64_t next);

  /// 0 for Gaussians that are not large against their neighbours', then one for each factor of 4.
  std::uint32_t size_class(float size) const;
  const Box3f& middle_box() const { return middle_; }
  double cell() const { return cell_; }

 private:
  static constexpr int kClassShift = 57;

  std::array<double, 3> centre_{};
  double cell_ = 1;         ///< a power of two
  double per_cell_ = 1;     ///< 1 / cell
  float class_0_size_ = 1;  ///< a power of two
  Box3f middle_;
};

/// Where to cut a block (or a tile) off the front of a sequence of keys, at most `most` long: at
/// the widest gap that leaves at least a quarter of `most`, the last such one. Everything if it is
/// no longer than `most` and `ended`. A change of size class always cuts.
std::size_t splat_cut(std::span<const std::uint64_t> keys, std::size_t most, bool ended);

}  // namespace pounce::store
