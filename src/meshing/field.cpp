// SPDX-License-Identifier: Apache-2.0
#include "meshing/field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

namespace pounce::meshing {

Lattice::Lattice(const Box3f& box, std::uint32_t cells) {
  const Vec3f size = box.hi - box.lo;
  cell = std::max({size.x, size.y, size.z, 1e-30F}) / static_cast<float>(cells);
  const auto along = [&](float length) {
    return static_cast<std::uint32_t>(std::ceil(length / cell)) + 1;
  };
  corners = {std::max(along(size.x), 2U), std::max(along(size.y), 2U), std::max(along(size.z), 2U)};
  // In the middle of the box, which need not be a multiple of cells.
  const auto half = [&](std::size_t axis) {
    return static_cast<float>(corners[axis] - 1) * cell / 2;
  };
  low = (box.lo + box.hi) * 0.5F - Vec3f{half(0), half(1), half(2)};
}

Field::Field(const Lattice& lattice)
    : lattice_(lattice), sums_(lattice.count()), seen_(lattice.count()) {}

std::uint64_t Field::bytes(const Lattice& lattice) {
  return round_to_pages(lattice.count() * sizeof(std::int32_t)) +
         round_to_pages(lattice.count() * sizeof(std::uint16_t));
}

namespace {

/// What is known of a pixel of which nothing is: it hides all.
constexpr std::uint16_t kUnknown = 0;

}  // namespace

bool Air::has(Vec3f place) const {
  std::array<std::uint32_t, 3> at{};
  const Vec3f cells = (place - lattice_.low) * (1 / lattice_.cell);
  const std::array<float, 3> along{cells.x, cells.y, cells.z};
  for (std::size_t k = 0; k < 3; ++k) {
    const float nearest = std::floor(along[k] + 0.5F);
    if (!(nearest >= 0 && nearest < static_cast<float>(lattice_.corners[k]))) return false;
    at[k] = static_cast<std::uint32_t>(nearest);
  }
  return has(lattice_.index(at[0], at[1], at[2]));
}

void forget_solid(const views::Grid& grid, const Air& air, std::uint32_t view,
                  std::span<std::uint16_t> depths) {
  const std::uint32_t edge = grid.edge();
  for (std::uint32_t y = 0; y < edge; ++y) {
    for (std::uint32_t x = 0; x < edge; ++x) {
      const views::Seen begin{static_cast<float>(x), static_cast<float>(y), grid.begin(view)};
      if (!air.has(grid.place(view, begin))) depths[std::size_t{y} * edge + x] = kUnknown;
    }
  }
}

void Field::add(const views::Grid& grid, const DepthView& view, std::uint32_t first,
                std::uint32_t last) {
  const float begin = grid.begins_within() ? grid.begin(view.view) : 0;
  const auto edge = static_cast<std::int32_t>(grid.edge());
  const float per_cell = 1 / grid.in_steps(lattice_.cell);
  for (std::uint32_t z = first; z < last; ++z) {
    for (std::uint32_t y = 0; y < lattice_.corners[1]; ++y) {
      for (std::uint32_t x = 0; x < lattice_.corners[0]; ++x) {
        const views::Seen seen = grid.see(view.view, lattice_.place(x, y, z));
        const auto px = static_cast<std::int32_t>(std::floor(seen.x + 0.5F)),
                   py = static_cast<std::int32_t>(std::floor(seen.y + 0.5F));
        if (px < 0 || py < 0 || px >= edge || py >= edge || seen.depth < begin) continue;
        const std::uint16_t depth =
            view.depths[static_cast<std::size_t>(py) * static_cast<std::size_t>(edge) +
                        static_cast<std::size_t>(px)];
        float cells = kTruncation;  // where nothing is, all is outside
        if (depth != views::kNoDepth) {
          cells = (static_cast<float>(depth) - seen.depth) * per_cell;
          if (cells < -kTruncation) continue;  // hidden
        }
        const std::uint64_t at = lattice_.index(x, y, z);
        sums_[at] +=
            static_cast<std::int32_t>(std::lround(std::min(cells / kTruncation, 1.0F) * kSteps));
        ++seen_[at];
      }
    }
  }
}

std::optional<Air> Field::air_around(Vec3f place, float cells,
                                     const std::function<void()>& poll) const {
  const float least = cells / kTruncation * kSteps;
  const auto is_free = [&](std::uint64_t at) {
    return seen_[at] > 0 && is_outside(at) && value(at) >= least;
  };
  const std::uint32_t nx = lattice_.corners[0], ny = lattice_.corners[1], nz = lattice_.corners[2];
  std::uint64_t start = lattice_.count();
  Vec3f start_at;
  double nearest = std::numeric_limits<double>::infinity();
  for (std::uint32_t z = 0; z < nz; ++z) {
    for (std::uint32_t y = 0; y < ny; ++y) {
      for (std::uint32_t x = 0; x < nx; ++x) {
        const std::uint64_t at = lattice_.index(x, y, z);
        if (!is_free(at)) continue;
        const Vec3d away(lattice_.place(x, y, z) - place);
        if (!(dot(away, away) < nearest)) continue;
        nearest = dot(away, away);
        start = at;
        start_at = lattice_.place(x, y, z);
      }
    }
  }
  if (start == lattice_.count()) return {};
  // Through the lattice to and fro until nothing comes: no list of what is waiting.
  Air air(lattice_, start_at);
  air.add(start);
  const auto visit = [&](std::uint32_t x, std::uint32_t y, std::uint32_t z) {
    const std::uint64_t at = lattice_.index(x, y, z);
    if (air.has(at) || !is_free(at)) return false;
    const std::uint64_t row = nx, layer = std::uint64_t{nx} * ny;
    const bool is_reached = (x > 0 && air.has(at - 1)) || (x + 1 < nx && air.has(at + 1)) ||
                            (y > 0 && air.has(at - row)) || (y + 1 < ny && air.has(at + row)) ||
                            (z > 0 && air.has(at - layer)) || (z + 1 < nz && air.has(at + layer));
    if (is_reached) air.add(at);
    return is_reached;
  };
  for (bool any = true; any;) {
    any = false;
    for (std::uint32_t z = 0; z < nz; ++z) {
      poll();
      for (std::uint32_t y = 0; y < ny; ++y) {
        for (std::uint32_t x = 0; x < nx; ++x) any = visit(x, y, z) || any;
      }
    }
    for (std::uint32_t z = nz; z-- > 0;) {
      poll();
      for (std::uint32_t y = ny; y-- > 0;) {
        for (std::uint32_t x = nx; x-- > 0;) any = visit(x, y, z) || any;
      }
    }
  }
  return air;
}

void Field::keep_air(const Air& air) {
  for (std::size_t i = 0; i < seen_.size(); ++i) {
    if (seen_[i] == 0 || !is_outside(i) || air.has(i)) continue;
    seen_[i] = 1;
    sums_[i] = -static_cast<std::int32_t>(kSteps);
  }
}

void Field::clear() {
  std::fill(sums_.begin(), sums_.end(), 0);
  std::fill(seen_.begin(), seen_.end(), std::uint16_t{0});
}

void Field::close() {
  for (std::size_t i = 0; i < seen_.size(); ++i) {
    if (seen_[i] > 0) continue;
    seen_[i] = 1;
    sums_[i] = -static_cast<std::int32_t>(kSteps);
  }
}

std::uint64_t Field::most_triangles() const {
  const std::uint32_t nx = lattice_.corners[0], ny = lattice_.corners[1], nz = lattice_.corners[2];
  std::uint64_t crossings = 0;
  const auto crosses = [&](std::uint64_t a, std::uint64_t b) {
    return seen_[a] > 0 && seen_[b] > 0 && is_outside(a) != is_outside(b);
  };
  for (std::uint32_t z = 0; z < nz; ++z) {
    for (std::uint32_t y = 0; y < ny; ++y) {
      for (std::uint32_t x = 0; x < nx; ++x) {
        const std::uint64_t here = lattice_.index(x, y, z);
        if (x + 1 < nx && crosses(here, lattice_.index(x + 1, y, z))) ++crossings;
        if (y + 1 < ny && crosses(here, lattice_.index(x, y + 1, z))) ++crossings;
        if (z + 1 < nz && crosses(here, lattice_.index(x, y, z + 1))) ++crossings;
      }
    }
  }
  return 2 * crossings;
}

namespace {

/// Edges of a cell, from corner to corner; a corner is bits x, y, z. Four along each axis.
constexpr int kEdges[12][2] = {{0, 1}, {2, 3}, {4, 5}, {6, 7}, {0, 2}, {1, 3},
                               {4, 6}, {5, 7}, {0, 4}, {1, 5}, {2, 6}, {3, 7}};

/// Which sheet of the surface an edge of a cell lies on, by which of its corners are outside. Where
/// a side of the cell has two of them, and not side by side, what is inside hangs together there:
/// both cells at that side see it so, and the surface has no holes and no edge of four triangles.
struct Sheets {
  std::array<std::array<std::int8_t, 12>, 256> of{};  ///< -1: the surface does not cross the edge
  std::array<std::int8_t, 256> count{};

  Sheets() {
    for (unsigned mask = 0; mask < 256; ++mask) {
      std::array<int, 12> root{};
      std::iota(root.begin(), root.end(), 0);
      const auto find = [&](int e) {
        while (root[static_cast<std::size_t>(e)] != e) e = root[static_cast<std::size_t>(e)];
        return e;
      };
      for (int axis = 0; axis < 3; ++axis) {
        for (int side = 0; side < 2; ++side) join_at(mask, axis, side, find, root);
      }
      std::array<std::int8_t, 12> number{};
      number.fill(-1);
      for (int e = 0; e < 12; ++e) {
        const auto at = static_cast<std::size_t>(e);
        of[mask][at] = -1;
        if ((mask >> kEdges[e][0] & 1) == (mask >> kEdges[e][1] & 1)) continue;
        std::int8_t& own = number[static_cast<std::size_t>(find(e))];
        if (own < 0) own = count[mask]++;
        of[mask][at] = own;
      }
    }
  }

 private:
  static int edge_between(int a, int b) {
    for (int e = 0; e < 12; ++e) {
      if ((kEdges[e][0] == a && kEdges[e][1] == b) || (kEdges[e][0] == b && kEdges[e][1] == a))
        return e;
    }
    return -1;
  }
  template <class Find>
  static void join_at(unsigned mask, int axis, int side, const Find& find,
                      std::array<int, 12>& root) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3, low = side << axis;
    const std::array<int, 4> corners{low, low | 1 << u, low | 1 << u | 1 << v, low | 1 << v};
    std::array<int, 4> crossed{};
    int crossings = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const int a = corners[k], b = corners[(k + 1) % 4];
      crossed[k] = (mask >> a & 1) != (mask >> b & 1) ? edge_between(a, b) : -1;
      crossings += crossed[k] >= 0 ? 1 : 0;
    }
    const auto join = [&](int a, int b) { root[static_cast<std::size_t>(find(a))] = find(b); };
    for (std::size_t k = 0; k < 4; ++k) {
      // Around a corner that is outside alone; or from the one crossing to the other.
      if (crossings == 4 && (mask >> corners[k] & 1) != 0) join(crossed[(k + 3) % 4], crossed[k]);
      for (std::size_t other = k + 1; crossings == 2 && other < 4; ++other) {
        if (crossed[k] >= 0 && crossed[other] >= 0) join(crossed[k], crossed[other]);
      }
    }
  }
};

const Sheets& sheets() {
  static const Sheets table;
  return table;
}

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

/// A cell that the surface passes: its vertices follow each other, one for each sheet.
struct Cell {
  std::uint32_t first = kNone;
  std::uint8_t mask = 0;  ///< of its corners, those that are outside

  std::uint32_t at(std::size_t edge) const {
    return first == kNone ? kNone : first + static_cast<std::uint32_t>(sheets().of[mask][edge]);
  }
};

}  // namespace

Surface Field::surface() const {
  Surface out;
  const std::uint32_t nx = lattice_.corners[0], ny = lattice_.corners[1], nz = lattice_.corners[2];
  // Two layers of cells: the one that is gone through, and the one before.
  const std::size_t layer = std::size_t{nx} * ny;
  std::vector<Cell> before(layer), own(layer);
  const auto cell_at = [&](std::uint32_t x, std::uint32_t y, std::uint32_t z) -> Cell {
    std::uint64_t corners[8];
    unsigned mask = 0;
    for (unsigned c = 0; c < 8; ++c) {
      corners[c] = lattice_.index(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2));
      if (seen_[corners[c]] == 0) return {};
      if (is_outside(corners[c])) mask |= 1U << c;
    }
    if (mask == 0 || mask == 255) return {};
    std::array<Vec3f, 4> sums{};
    std::array<int, 4> counts{};
    for (std::size_t e = 0; e < 12; ++e) {
      const std::int8_t sheet = sheets().of[mask][e];
      if (sheet < 0) continue;
      const int a = kEdges[e][0], b = kEdges[e][1];
      const float va = value(corners[a]), vb = value(corners[b]), t = va / (va - vb);
      const auto at = [&](int axis) {
        return static_cast<float>(a >> axis & 1) * (1 - t) + static_cast<float>(b >> axis & 1) * t;
      };
      Vec3f& sum = sums[static_cast<std::size_t>(sheet)];
      sum = sum + Vec3f{at(0), at(1), at(2)};
      ++counts[static_cast<std::size_t>(sheet)];
    }
    const auto first = static_cast<std::uint32_t>(out.positions.size());
    for (std::size_t k = 0; k < static_cast<std::size_t>(sheets().count[mask]); ++k) {
      out.positions.push_back(lattice_.place(x, y, z) +
                              sums[k] * (lattice_.cell / static_cast<float>(counts[k])));
    }
    return {first, static_cast<std::uint8_t>(mask)};
  };
  // Around an edge that leads from outside to inside lie four cells.
  const auto quad = [&](std::array<std::uint32_t, 4> v, bool is_turned) {
    if (std::find(v.begin(), v.end(), kNone) != v.end()) return;
    if (is_turned) std::swap(v[1], v[3]);
    out.triangles.push_back({v[0], v[1], v[2]});
    out.triangles.push_back({v[0], v[2], v[3]});
  };
  for (std::uint32_t z = 0; z + 1 < nz; ++z) {
    before.swap(own);
    for (std::uint32_t y = 0; y + 1 < ny; ++y) {
      for (std::uint32_t x = 0; x + 1 < nx; ++x) own[std::size_t{y} * nx + x] = cell_at(x, y, z);
    }
    const auto of = [&](const std::vector<Cell>& cells, std::uint32_t x, std::uint32_t y,
                        std::size_t edge) { return cells[std::size_t{y} * nx + x].at(edge); };
    // The edges of each axis in the order of kEdges: which of the four it is for a cell depends on
    // where the cell lies.
    for (std::uint32_t y = 0; y + 1 < ny; ++y) {
      for (std::uint32_t x = 0; x + 1 < nx; ++x) {
        const std::uint64_t at = lattice_.index(x, y, z);
        const bool here = is_outside(at);
        if (y > 0 && z > 0 && here != is_outside(lattice_.index(x + 1, y, z)))
          quad({of(before, x, y - 1, 3), of(before, x, y, 2), of(own, x, y, 0),
                of(own, x, y - 1, 1)},
               here);
        if (x > 0 && z > 0 && here != is_outside(lattice_.index(x, y + 1, z)))
          quad({of(before, x - 1, y, 7), of(own, x - 1, y, 5), of(own, x, y, 4),
                of(before, x, y, 6)},
               here);
        if (x > 0 && y > 0 && here != is_outside(lattice_.index(x, y, z + 1)))
          quad({of(own, x - 1, y - 1, 11), of(own, x, y - 1, 10), of(own, x, y, 8),
                of(own, x - 1, y, 9)},
               here);
      }
    }
  }
  return out;
}

}  // namespace pounce::meshing
