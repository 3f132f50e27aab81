// SPDX-License-Identifier: Apache-2.0
#include "meshing/simplify_wedges.h"

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "meshing/collapse.h"
#include "meshing/fit.h"

namespace pounce::meshing {
namespace {

constexpr int kOnTheWay = 2, kAtLast = 4;  // rounds

/// Moves places; wedges go with them.
void fit_places(WedgeSurface& surface, const Surface& dense, int rounds,
                const std::function<void()>& poll) {
  Surface moved = welded(surface);
  fit(moved, dense, rounds, poll);
  surface.places = std::move(moved.positions);
}

std::uint64_t shared(const std::vector<UvCover>& covers) {
  std::uint64_t texels = 0;
  for (const UvCover& cover : covers) texels += cover.shared();
  return texels;
}

}  // namespace

SharedTexels simplify_fitted(WedgeSurface& surface, std::size_t triangles, std::uint32_t edge,
                             const std::function<void()>& poll) {
  std::vector<UvCover> covers = covers_of(surface, edge);
  SharedTexels texels{shared(covers), 0};
  const Surface dense = welded(surface);
  const std::size_t count = surface.triangles.size();
  while (surface.triangles.size() > triangles) {
    const std::size_t before = surface.triangles.size();
    collapse(surface, covers, std::max(triangles, before / 2),
             std::numeric_limits<double>::infinity(), poll);
    if (surface.triangles.size() == before) break;  // seams and layout allow no less
    fit_places(surface, dense, kOnTheWay, poll);
  }
  if (surface.triangles.size() < count) fit_places(surface, dense, kAtLast, poll);
  texels.after = shared(covers);
  return texels;
}

SharedTexels simplify_within(WedgeSurface& surface, double distance, std::uint32_t edge,
                             const std::function<void()>& poll) {
  std::vector<UvCover> covers = covers_of(surface, edge);
  SharedTexels texels{shared(covers), 0};
  const Surface dense = welded(surface);
  collapse(surface, covers, 0, distance, poll);
  fit_places(surface, dense, kAtLast, poll);
  texels.after = shared(covers);
  return texels;
}

}  // namespace pounce::meshing
