// SPDX-License-Identifier: Apache-2.0
#include "meshing/field.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

namespace pounce::meshing {
namespace {

/// What each view of a grid sees of a sphere around the middle of its region.
std::vector<std::uint16_t> depths_of_sphere(const views::Grid& grid, std::uint32_t view,
                                            double radius) {
  const std::uint32_t edge = grid.edge();
  std::vector<std::uint16_t> depths(std::size_t{edge} * edge, views::kNoDepth);
  const views::Seen middle = grid.see(view, grid.middle());
  const double pixels = radius / static_cast<double>(grid.pixel());
  for (std::uint32_t y = 0; y < edge; ++y) {
    for (std::uint32_t x = 0; x < edge; ++x) {
      const double dx = x - static_cast<double>(middle.x), dy = y - static_cast<double>(middle.y);
      const double left = pixels * pixels - dx * dx - dy * dy;
      if (left < 0) continue;
      const double nearer = std::sqrt(left) * static_cast<double>(grid.pixel());
      depths[std::size_t{y} * edge + x] = static_cast<std::uint16_t>(std::lround(
          static_cast<double>(middle.depth) - nearer / static_cast<double>(grid.depth_step())));
    }
  }
  return depths;
}

struct Sphere {
  Box3f box{{-1.2F, -1.2F, -1.2F}, {1.2F, 1.2F, 1.2F}};
  views::Grid grid{box, 0.01F, 24};
  Lattice lattice{box, 48};
  Field field{lattice};

  explicit Sphere(bool backwards = false) {
    for (std::uint32_t k = 0; k < grid.views(); ++k) {
      const std::uint32_t view = backwards ? grid.views() - 1 - k : k;
      const auto depths = depths_of_sphere(grid, view, 1);
      // In layers, as threads add them.
      for (std::uint32_t z = 0; z < lattice.corners[2]; ++z)
        field.add(grid, {view, depths}, z, z + 1);
    }
  }
};

TEST_CASE("a lattice holds its box, in equal cubes about its middle") {
  const Lattice lattice({{0, 0, 0}, {3, 1.1F, 2}}, 30);
  CHECK(lattice.cell == Approx(0.1));
  CHECK(lattice.corners == std::array<std::uint32_t, 3>{31, 12, 21});
  const Vec3f high = lattice.place(30, 11, 20);
  CHECK(high.x == Approx(3));
  CHECK(lattice.low.y + high.y == Approx(1.1));
}

TEST_CASE(
    "views of a sphere make a sphere: closed, turned outwards, within a cell of where it is") {
  const Sphere sphere;
  const Surface surface = sphere.field.surface();
  CHECK(surface.triangles.size() > 5000);
  CHECK(surface.triangles.size() <= sphere.field.most_triangles());
  const Vec3f middle = sphere.grid.middle();
  for (const Vec3f p : surface.positions)
    CHECK(std::abs(length(p - middle) - 1) < sphere.lattice.cell / 2);
  // Each edge once each way.
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  double volume = 0;
  for (const Triangle& t : surface.triangles) {
    for (std::size_t k = 0; k < 3; ++k) ++edges[{t[k], t[(k + 1) % 3]}];
    const Vec3d a(surface.positions[t[0]]), b(surface.positions[t[1]]), c(surface.positions[t[2]]);
    volume += dot(a, cross(b, c)) / 6;
  }
  for (const auto& [edge, count] : edges) {
    CHECK(count == 1);
    CHECK(edges.count({edge.second, edge.first}) == 1);
  }
  CHECK(volume == Approx(4.18879).epsilon(0.02));  // positive: outwards
}

TEST_CASE("where sheets come close they do not share vertices") {
  // Depths that are off by some cells anywhere: thin sheets, cells that the surface passes twice.
  Sphere sphere;
  std::uint32_t state = 7;
  for (std::uint32_t k = 0; k < sphere.grid.views(); ++k) {
    auto depths = depths_of_sphere(sphere.grid, k, 1);
    for (std::uint16_t& depth : depths) {
      state = state * 1664525U + 1013904223U;
      if (depth != views::kNoDepth)
        depth = static_cast<std::uint16_t>(depth + (state >> 16) % 3000);
    }
    for (int times = 0; times < 3; ++times)
      sphere.field.add(sphere.grid, {k, depths}, 0, sphere.lattice.corners[2]);
  }
  const Surface surface = sphere.field.surface();
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const Triangle& t : surface.triangles) {
    for (std::size_t k = 0; k < 3; ++k) ++edges[std::minmax(t[k], t[(k + 1) % 3])];
  }
  const auto shared =
      std::count_if(edges.begin(), edges.end(), [](const auto& edge) { return edge.second > 2; });
  const auto open =
      std::count_if(edges.begin(), edges.end(), [](const auto& edge) { return edge.second == 1; });
  CAPTURE(edges.size(), shared, open);
  CHECK(edges.size() > 20000);
  // With one vertex per cell one edge in 700 has four triangles here. What may be left are two
  // cells that pass a side between them in one sheet each (Wenger, "Isosurfaces", 2013).
  CHECK(shared * 5000 < static_cast<std::ptrdiff_t>(edges.size()));
  CHECK(open == 0);
}

TEST_CASE("what no view sees is open, and closed where it is asked for") {
  const Box3f box{{-1.2F, -1.2F, -1.2F}, {1.2F, 1.2F, 1.2F}};
  const views::Grid grid(box, 0.01F, 24);
  const auto open_edges = [&](bool close) {
    Field field{Lattice(box, 40)};
    // A third of the views: what lies on the far side of all of them nobody sees.
    for (std::uint32_t view = 0; view < grid.views() / 3; ++view) {
      const auto depths = depths_of_sphere(grid, view, 1);
      field.add(grid, {view, depths}, 0, field.lattice().corners[2]);
    }
    if (close) field.close();
    const Surface surface = field.surface();
    CHECK(surface.triangles.size() <= field.most_triangles());
    std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
    for (const Triangle& t : surface.triangles) {
      for (std::size_t k = 0; k < 3; ++k) ++edges[std::minmax(t[k], t[(k + 1) % 3])];
    }
    // Where the cubes end every surface does.
    const Vec3f low = field.lattice().low, high = field.lattice().place(40, 40, 40);
    const float near = 1.01F * field.lattice().cell;
    const auto is_inside = [&](std::uint32_t v) {
      const Vec3f a = surface.positions[v] - low, b = high - surface.positions[v];
      return std::min({a.x, a.y, a.z, b.x, b.y, b.z}) > near;
    };
    return std::count_if(edges.begin(), edges.end(), [&](const auto& edge) {
      return edge.second == 1 && is_inside(edge.first.first) && is_inside(edge.first.second);
    });
  };
  CHECK(open_edges(false) > 50);
  CHECK(open_edges(true) == 0);
}

TEST_CASE("views may come in any order") {
  const Surface one = Sphere().field.surface(), other = Sphere(true).field.surface();
  CHECK(one.positions == other.positions);
  CHECK(one.triangles == other.triangles);
}

TEST_CASE("where nothing is seen there is no surface") {
  const Box3f box{{0, 0, 0}, {1, 1, 1}};
  const views::Grid grid(box, 0.02F, 6);
  Field field{Lattice(box, 16)};
  const std::vector<std::uint16_t> nothing(std::size_t{grid.edge()} * grid.edge(), views::kNoDepth);
  for (std::uint32_t view = 0; view < 6; ++view) field.add(grid, {view, nothing}, 0, 17);
  CHECK(field.surface().triangles.empty());
}

}  // namespace
}  // namespace pounce::meshing
