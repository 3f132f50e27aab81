// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <random>

#include "mesh/mesh.h"
#include "support/whole_image.h"

namespace pounce::test {

/// A wavy sheet of `cells` squares each way over the unit square, whose UVs run over `tiles` UDIM
/// tiles to the right.
inline mesh::Mesh wavy_sheet(int cells, int tiles) {
  mesh::Mesh mesh;
  mesh.uv_sets.emplace_back();
  mesh.uv_present.emplace_back();
  for (int j = 0; j <= cells; ++j) {
    for (int i = 0; i <= cells; ++i) {
      const double u = 1.0 * i / cells, v = 1.0 * j / cells;
      mesh.positions.push_back({static_cast<float>(u), static_cast<float>(v),
                                static_cast<float>(0.02 * std::sin(5 * u) * std::cos(4 * v))});
      mesh.normals.push_back({0, 0, 1});
      mesh.uv_sets[0].push_back({static_cast<float>(u * tiles), static_cast<float>(1 - v)});
    }
  }
  const auto at = [&](int i, int j) { return static_cast<std::uint32_t>(j * (cells + 1) + i); };
  for (int j = 0; j < cells; ++j) {
    for (int i = 0; i < cells; ++i) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  return mesh;
}

inline WholeImage noise(ImageSize size, std::uint32_t seed) {
  std::mt19937 random(seed);
  WholeImage image{size.width, size.height, 3, false, {}};
  for (std::size_t i = 0; i < std::size_t{size.width} * size.height * 3; ++i)
    image.samples.push_back(static_cast<double>(random() % 256) / 255);
  return image;
}

}  // namespace pounce::test
