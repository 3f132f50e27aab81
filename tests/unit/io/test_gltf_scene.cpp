// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>
#include <cmath>

#include "io/read_mesh.h"
#include "support/gltf_builder.h"
#include "support/test_data.h"

using namespace pounce;
using nlohmann::json;
using test::GltfBuilder;
using test::TempFolder;
using Triangle = std::array<std::uint32_t, 3>;

namespace {

const double kHalf = std::sqrt(0.5);

mesh::Mesh read(const GltfBuilder& builder) {
  const TempFolder folder;
  return io::read_mesh(builder.write(folder.file("m.gltf")));
}

void check_close(Vec3f found, Vec3f expected) {
  CAPTURE(found.x, found.y, found.z, expected.x, expected.y, expected.z);
  CHECK(length(found - expected) < 1e-6F);
}

}  // namespace

TEST_CASE("nested translation, rotation and scale act from the inside out", "[io]") {
  GltfBuilder b;
  b.triangle();
  // Child: scale by (2, 1, 1), turn 90 degrees about z (x to y, y to -x), move by (1, 0, 0).
  b.doc["nodes"] = {{{"children", {1}}, {"translation", {0, 0, 5}}, {"scale", {1, 3, 1}}},
                    {{"mesh", 0},
                     {"translation", {1, 0, 0}},
                     {"rotation", {0, 0, kHalf, kHalf}},
                     {"scale", {2, 1, 1}}}};
  const mesh::Mesh m = read(b);
  check_close(m.positions[0], {1, 0, 5});
  check_close(m.positions[1], {1, 6, 5});  // (1,0,0) -> (2,0,0) -> (0,2,0) -> (1,2,0) -> (1,6,5)
  check_close(m.positions[2], {0, 0, 5});  // (0,1,0) -> (-1,0,0) -> (0,0,0) -> (0,0,5)
  check_close(m.normals[0], {0, 0, 1});
  CHECK(m.triangles == std::vector<Triangle>{{0, 1, 2}});
}

TEST_CASE("a matrix is read column after column", "[io]") {
  GltfBuilder b;
  b.triangle();
  b.doc["nodes"][0]["matrix"] = {0, 1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 0, 10, 20, 30, 1};
  const mesh::Mesh m = read(b);
  check_close(m.positions[0], {10, 20, 30});
  check_close(m.positions[1], {10, 21, 30});
  check_close(m.positions[2], {10, 20, 31});
  check_close(m.normals[0], {1, 0, 0});
}

TEST_CASE("normals follow the inverse transpose, not the matrix", "[io]") {
  GltfBuilder b;
  const int p = b.add<float>({0, 0, 0, 1, -1, 0, 0, 0, 1}, "VEC3");
  const int n = b.add<float>({1, 1, 0, 1, 1, 0, 1, 1, 0}, "VEC3");
  b.primitive({{"POSITION", p}, {"NORMAL", n}});
  b.doc["nodes"][0]["scale"] = {2, 1, 1};
  // The surface x + y = 0 becomes x / 2 + y = 0.
  check_close(read(b).normals[0],
              {static_cast<float>(1 / std::sqrt(5)), static_cast<float>(2 / std::sqrt(5)), 0});
}

TEST_CASE("a mirroring node keeps the outside outside", "[io]") {
  GltfBuilder b;
  auto& primitive = b.triangle();
  primitive["attributes"]["TANGENT"] = b.add<float>({1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1}, "VEC4");
  b.doc["nodes"][0]["scale"] = {-1, 1, 1};
  const mesh::Mesh m = read(b);
  check_close(m.positions[1], {-1, 0, 0});
  check_close(m.normals[0], {0, 0, 1});
  CHECK(m.triangles == std::vector<Triangle>{{0, 2, 1}});
  const auto& t = m.triangles[0];
  check_close(cross(m.positions[t[1]] - m.positions[t[0]], m.positions[t[2]] - m.positions[t[0]]),
              {0, 0, 1});
  CHECK(m.tangents[0] == Vec4f{-1, 0, 0, -1});
}

TEST_CASE("a mesh that two nodes show appears twice", "[io]") {
  GltfBuilder b;
  b.triangle();
  b.push("nodes", {{"mesh", 0}, {"translation", {0, 0, 4}}});
  const mesh::Mesh m = read(b);
  CHECK(m.triangles == std::vector<Triangle>{{0, 1, 2}, {3, 4, 5}});
  CHECK(m.positions[4] == Vec3f{1, 0, 4});
  CHECK(m.materials.size() == 1);
}

TEST_CASE("only the scene asked for is read", "[io]") {
  GltfBuilder b;
  b.triangle();
  b.triangle();
  b.doc["nodes"][0]["translation"] = {7, 0, 0};
  b.doc["scenes"] = {{{"nodes", {1}}}, {{"nodes", {0}}}};
  SECTION("the default one") {
    b.doc["scene"] = 1;
    CHECK(read(b).positions[0].x == 7);
  }
  SECTION("else the first") { CHECK(read(b).positions[0].x == 0); }
  SECTION("else every root node") {
    b.doc.erase("scenes");
    CHECK(read(b).triangles.size() == 2);
  }
}

TEST_CASE("a skinned mesh stands in the rest pose of its joints", "[io]") {
  GltfBuilder b;
  auto& primitive = b.triangle();
  // Vertex 0 hangs on joint 0, vertex 1 on joint 1, vertex 2 half on each; its weights sum to 1/2.
  primitive["attributes"]["JOINTS_0"] =
      b.add<std::uint8_t>({0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0}, "VEC4");
  primitive["attributes"]["WEIGHTS_0"] =
      b.add<float>({1, 0, 0, 0, 1, 0, 0, 0, .25F, .25F, 0, 0}, "VEC4");
  // Inverse bind: joint 0 identity; joint 1 stood at (1, 0, 0).
  const int matrices = b.add<float>({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0,  0, 0, 1,
                                     1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -1, 0, 0, 1},
                                    "MAT4");
  b.doc["skins"] = {{{"joints", {1, 2}}, {"inverseBindMatrices", matrices}}};
  b.doc["nodes"] = {{{"mesh", 0}, {"skin", 0}, {"translation", {100, 0, 0}}},  // ignored
                    {{"translation", {0, 0, 1}}, {"children", {2}}},
                    {{"translation", {3, 0, 0}}, {"scale", {1, 2, 1}}}};
  const mesh::Mesh m = read(b);
  check_close(m.positions[0], {0, 0, 1});
  // (1,0,0) is the origin of joint 1, which stands at (3,0,1).
  check_close(m.positions[1], {3, 0, 1});
  // (0,1,0): joint 0 takes it to (0,1,1), joint 1 to (3-1, 2, 1); the mean of both.
  check_close(m.positions[2], {1, 1.5F, 1});
  check_close(m.normals[2], {0, 0, 1});
}

TEST_CASE("morph targets act at their default weights, the node's before the mesh's", "[io]") {
  GltfBuilder b;
  auto& primitive = b.triangle();
  const int up = b.add<float>({0, 0, 2, 0, 0, 0, 0, 0, 0}, "VEC3");
  const int right = b.add<float>({0, 0, 0, 4, 0, 0, 0, 0, 0}, "VEC3");
  primitive["targets"] = {{{"POSITION", up}}, {{"POSITION", right}}};
  b.doc["meshes"][0]["weights"] = {0.5, 0.25};
  SECTION("mesh") {
    const mesh::Mesh m = read(b);
    CHECK(m.positions == std::vector<Vec3f>{{0, 0, 1}, {2, 0, 0}, {0, 1, 0}});
  }
  SECTION("node") {
    b.doc["nodes"][0]["weights"] = {1, 0};
    const mesh::Mesh m = read(b);
    CHECK(m.positions == std::vector<Vec3f>{{0, 0, 2}, {1, 0, 0}, {0, 1, 0}});
  }
}

TEST_CASE("nodes may nest a hundred thousand deep", "[io]") {
  GltfBuilder b;
  b.triangle();
  json nodes = json::array();
  for (int i = 1; i <= 100000; ++i)
    nodes.push_back({{"children", {i}}, {"translation", {0, 0, 1}}});
  nodes.push_back({{"mesh", 0}});
  b.doc["nodes"] = nodes;
  CHECK(read(b).positions[0] == Vec3f{0, 0, 100000});
}
