// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/vec.h"

namespace pounce::meshing {

/// How many triangles lie on each texel of a texture, which repeats. A triangle that spans more
/// than two of its periods tiles: it counts nowhere.
class UvCover {
 public:
  using Uvs = std::array<Vec2f, 3>;

  /// `edge`: texels along each side, above 0.
  explicit UvCover(std::uint32_t edge)
      : edge_(edge), counts_(std::size_t{edge} * edge), changes_(counts_.size()) {}
  std::uint32_t edge() const { return edge_; }
  /// Is it one that is counted?
  static bool counts(const Uvs& uvs);

  void add(const Uvs& uvs);
  /// Of the texel that the triangle's middle lies on.
  std::uint32_t at_middle(const Uvs& uvs) const;
  /// Puts triangles in the place of others. False, and nothing is done, where a texel would then
  /// have more triangles than before, and more than `most`.
  bool replace(std::span<const Uvs> old, std::span<const Uvs> fresh, std::uint32_t most);
  /// By the last replace(); a row counts as some.
  std::uint64_t texels_looked_at() const { return looked_at_; }
  /// Texels that more than one triangle lies on.
  std::uint64_t shared() const;

 private:
  /// Texels side by side.
  struct Run {
    std::uint32_t first = 0, count = 0;
  };
  void find_runs(const Uvs& uvs);

  std::uint32_t edge_;
  std::vector<std::uint16_t> counts_;
  std::vector<std::int16_t> changes_;  ///< by texel: of replace(), and 0 after it
  std::vector<Run> runs_;              ///< of replace()
  std::uint64_t looked_at_ = 0;
};

}  // namespace pounce::meshing
