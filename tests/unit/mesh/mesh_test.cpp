// SPDX-License-Identifier: Apache-2.0
#include "mesh/mesh.h"

#include <catch2/catch.hpp>

#include "mesh/vertex_frames.h"

using namespace pounce;

namespace {

/// A strip of `count` triangles, none on another.
mesh::Mesh strip(std::uint32_t count) {
  mesh::Mesh m;
  m.materials.resize(2);
  m.uv_sets.resize(1);
  for (std::uint32_t i = 0; i < count + 2; ++i) {
    const auto x = static_cast<float>(i);
    m.positions.push_back({x, i % 2 == 0 ? 0.0F : 1.0F, 0});
    m.uv_sets[0].push_back({x, 0.5F});
  }
  for (std::uint32_t i = 0; i < count; ++i) {
    m.triangles.push_back({i, i + 1, i + 2});
    m.triangle_material.push_back(0);
  }
  return m;
}

/// Another triangle on the i-th: its corners from `first` on, the same way around or the other, its
/// UVs moved by `shift`.
void add_copy(mesh::Mesh& m, std::uint32_t i, std::uint32_t first, bool turned, float shift,
              std::uint32_t material = 0) {
  const auto at = static_cast<std::uint32_t>(m.positions.size());
  for (std::uint32_t k = 0; k < 3; ++k) {
    const std::uint32_t from = m.triangles[i][(first + (turned ? 3 - k : k)) % 3];
    m.positions.push_back(m.positions[from]);
    m.uv_sets[0].push_back({m.uv_sets[0][from].x + shift, m.uv_sets[0][from].y});
  }
  m.triangles.push_back({at, at + 1, at + 2});
  m.triangle_material.push_back(material);
}

}  // namespace

TEST_CASE("triangles that lie on others are counted where they look other") {
  const std::uint32_t count = GENERATE(10U, 40000U);
  mesh::Mesh m = strip(count);
  CHECK(mesh::count_coincident(m) == 0);
  add_copy(m, 3, 0, false, 0);  // a copy shows the same
  add_copy(m, 3, 1, false, 0);
  CHECK(mesh::count_coincident(m) == 0);
  add_copy(m, 4, 0, true, 0.25F);  // the other side
  CHECK(mesh::count_coincident(m) == 0);
  for (std::uint32_t first = 0; first < 3; ++first) add_copy(m, first, first, false, 0.25F);
  CHECK(mesh::count_coincident(m) == 3);
  add_copy(m, 7, 2, false, 0, 1);  // another material
  CHECK(mesh::count_coincident(m) == 4);
  add_copy(m, 0, 2, false, 0.5F);  // a third in one place
  CHECK(mesh::count_coincident(m) == 5);
  for (Vec3f& p : m.positions) {
    if (p.y == 0) p.y = -0.0F;
  }
  m.positions[0].y = 0;
  CHECK(mesh::count_coincident(m) == 5);
  m.positions.back().z = 1e-6F;  // not exactly
  CHECK(mesh::count_coincident(m) == 4);
}

TEST_CASE("a mesh may lie on itself as a whole") {
  constexpr std::uint32_t kCount = 40000;  // so many are sorted in parts
  mesh::Mesh m = strip(kCount);
  for (std::uint32_t i = 0; i < kCount; ++i) add_copy(m, i, i % 3, false, 0.25F);
  CHECK(mesh::count_coincident(m) == kCount);
  for (std::uint32_t i = 0; i < kCount; ++i) add_copy(m, i, 0, true, 0.5F);
  CHECK(mesh::count_coincident(m) == kCount);
}

TEST_CASE("triangles without an area lie on none") {
  mesh::Mesh m = strip(2);
  for (int i = 0; i < 2; ++i) {
    m.triangles.push_back({0, 0, static_cast<std::uint32_t>(i)});
    m.triangle_material.push_back(static_cast<std::uint32_t>(i));
  }
  CHECK(mesh::count_coincident(m) == 0);
}

TEST_CASE("copies of vertices have what the mesh has", "[mesh]") {
  mesh::Mesh m = strip(1);
  m.tangents.assign(3, Vec4f{0, 1, 0, 1});
  m.tangents[2] = {1, 0, 0, -1};
  m.append_copies({2, 0});
  CHECK(m.positions.size() == 5);
  CHECK(m.positions[3] == m.positions[2]);
  CHECK(m.uv_sets[0][4] == m.uv_sets[0][0]);
  CHECK(m.tangents[3] == Vec4f{1, 0, 0, -1});
  // Normals, colours, and which tangents are its own: it has none, and gets none.
  CHECK(m.normals.empty());
  CHECK(m.colours.empty());
  CHECK(m.own_tangents.empty());
  CHECK(m.uv_present.empty());
}

TEST_CASE("normals are smoothed before there are tangents", "[mesh]") {
  mesh::Mesh m;  // two triangles at a right angle along an edge
  m.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  m.triangles = {{0, 1, 2}, {1, 0, 3}};
  m.normals.assign(4, {});
  mesh::smooth_normals(m, {0, 1, 2, 3}, 4, std::vector<bool>(4, true), 60);
  CHECK(m.positions.size() == 6);
  CHECK(m.tangents.empty());
  CHECK(m.normals[m.triangles[0][0]] == Vec3f{0, 0, 1});
  CHECK(m.normals[m.triangles[1][0]] == Vec3f{0, 1, 0});
}
