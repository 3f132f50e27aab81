// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>
#include <limits>

#include "io/read_mesh.h"
#include "support/gltf_builder.h"
#include "support/test_data.h"
#include "unit/io/read_error.h"

using namespace pounce;
using test::GltfBuilder;
using test::TempFolder;
using Triangle = std::array<std::uint32_t, 3>;

namespace {

mesh::Mesh read(const GltfBuilder& builder) {
  const TempFolder folder;
  return io::read_mesh(builder.write(folder.file("m.gltf")));
}

template <class T>
GltfBuilder quantised_triangle(const std::vector<T>& positions, const std::vector<T>& uvs,
                               bool normalized) {
  GltfBuilder b;
  b.doc["extensionsRequired"] = {"KHR_mesh_quantization"};
  const int p = b.add<T>(positions, "VEC3", normalized);
  const int t = b.add<T>(uvs, "VEC2", normalized);
  b.primitive({{"POSITION", p}, {"TEXCOORD_0", t}});
  return b;
}

}  // namespace

TEST_CASE("a glTF triangle is read as it is, with an index list or without", "[io]") {
  GltfBuilder b;
  const int positions = b.add<float>({0, 0, 0, 1, 0, 0, 0, 2, 0}, "VEC3");
  const int normals = b.add<float>({0, 0, 3, 0, 0, 1, 0, 0, 1}, "VEC3");
  const int uvs = b.add<float>({0, 1, 1, 1, 0, 0}, "VEC2");
  const nlohmann::json attributes = {
      {"POSITION", positions}, {"NORMAL", normals}, {"TEXCOORD_0", uvs}};
  SECTION("without") { b.primitive(attributes); }
  SECTION("8 bit") { b.primitive(attributes, b.add<std::uint8_t>({0, 1, 2}, "SCALAR")); }
  SECTION("16 bit") { b.primitive(attributes, b.add<std::uint16_t>({0, 1, 2}, "SCALAR")); }
  SECTION("32 bit") { b.primitive(attributes, b.add<std::uint32_t>({0, 1, 2}, "SCALAR")); }
  const mesh::Mesh m = read(b);
  CHECK(m.positions == std::vector<Vec3f>{{0, 0, 0}, {1, 0, 0}, {0, 2, 0}});
  CHECK(m.normals == std::vector<Vec3f>{{0, 0, 1}, {0, 0, 1}, {0, 0, 1}});
  CHECK(m.triangles == std::vector<Triangle>{{0, 1, 2}});
  REQUIRE(m.uv_sets.size() == 1);
  CHECK(m.uv_sets[0] == std::vector<Vec2f>{{0, 1}, {1, 1}, {0, 0}});
  CHECK(m.uv_present[0].empty());
  // u grows along x; v (down) falls along y, so the image is upright and the sign is +1.
  CHECK(m.tangents == std::vector<Vec4f>(3, {1, 0, 0, 1}));
  REQUIRE(m.materials.size() == 1);
  CHECK(m.materials[0].name == "default");
  CHECK(m.triangle_material == std::vector<std::uint32_t>{0});
  CHECK(m.warnings.empty());
}

TEST_CASE("colours of vertices are read where they are asked for", "[io]") {
  GltfBuilder b;
  const nlohmann::json attributes = {
      {"POSITION", b.add<float>({0, 0, 0, 1, 0, 0, 0, 2, 0}, "VEC3")}};
  const auto with = [&](int colours) {
    nlohmann::json all = attributes;
    all["COLOR_0"] = colours;
    b.primitive(all);
  };
  using Colours = std::vector<Vec4f>;
  const Colours wanted{{1, 0, .2F, 1}, {0, 1, 1, 1}, {0, 0, 0, 1}};
  SECTION("float") { with(b.add<float>({1, 0, .2F, 0, 1, 1, 0, 0, 0}, "VEC3")); }
  SECTION("8 bit") {
    with(b.add<std::uint8_t>({255, 0, 51, 255, 0, 255, 255, 255, 0, 0, 0, 255}, "VEC4", true));
  }
  SECTION("16 bit") {
    with(b.add<std::uint16_t>({65535, 0, 13107, 65535, 0, 65535, 65535, 65535, 0, 0, 0, 65535},
                              "VEC4", true));
  }
  SECTION("not finite") {
    const float inf = std::numeric_limits<float>::infinity();
    with(b.add<float>({1, 0, .2F, 0, 1, 1, 0, inf, 0}, "VEC3"));
    const TempFolder folder;
    const mesh::Mesh m = io::read_mesh(b.write_glb(folder.file("m.glb")), {false, {}, true});
    CHECK(m.colours == Colours{wanted[0], wanted[1], {1, 1, 1, 1}});
    REQUIRE(m.warnings.size() == 1);
    CHECK_THAT(m.warnings[0], Catch::Matchers::Contains("COLOR_0 has 1 non-finite"));
    return;
  }
  const TempFolder folder;
  const std::string path = b.write_glb(folder.file("m.glb"));
  const mesh::Mesh m = io::read_mesh(path, {false, {}, true});
  CHECK(m.has_vertex_colours);
  CHECK(io::read_mesh(path).colours.empty());
  CHECK(m.colours == wanted);
}

TEST_CASE("what is called COLOR_0 and is no colour is told of and left out", "[io]") {
  GltfBuilder b;
  const int positions = b.add<float>({0, 0, 0, 1, 0, 0, 0, 2, 0}, "VEC3");
  int colours = -1;
  SECTION("8 bit") { colours = b.add<std::uint8_t>({1, 0, 1, 1, 0, 1, 1, 1, 0, 0, 0, 1}, "VEC4"); }
  SECTION("16 bit") {
    colours = b.add<std::uint16_t>({1, 0, 1, 1, 0, 1, 1, 1, 0, 0, 0, 1}, "VEC4");
  }
  SECTION("8 bit with a sign") {
    colours = b.add<std::int8_t>({1, 0, 1, 1, 0, 1, 1, 1, 0, 0, 0, 1}, "VEC4", true);
  }
  SECTION("two numbers") { colours = b.add<float>({1, 0, 1, 0, 1, 0}, "VEC2"); }
  b.primitive({{"POSITION", positions}, {"COLOR_0", colours}});
  const TempFolder folder;
  const std::string path = b.write_glb(folder.file("m.glb"));
  for (const bool asked_for : {true, false}) {
    const mesh::Mesh m = io::read_mesh(path, {false, {}, asked_for});
    CHECK_FALSE(m.has_vertex_colours);
    CHECK(m.colours.empty());
    REQUIRE(m.warnings.size() == 1);
    CHECK_THAT(m.warnings[0],
               Catch::Matchers::Contains("COLOR_0 has a type that is not valid for colours"));
  }
}

TEST_CASE("interleaved attributes are read by their stride and offset", "[io]") {
  GltfBuilder b;
  // 24 bytes per vertex: position, uv, 4 bytes of something else.
  const int view = b.view(GltfBuilder::bytes_of<float>({1, 2, 3, .25F, .5F, 9,    //
                                                        4, 5, 6, .75F, .125F, 9,  //
                                                        7, 8, 0, 1, 0, 9}),
                          24);
  const nlohmann::json common = {{"bufferView", view}, {"componentType", 5126}, {"count", 3}};
  nlohmann::json positions = common, uvs = common;
  positions["type"] = "VEC3";
  uvs["type"] = "VEC2";
  uvs["byteOffset"] = 12;
  const int p = b.push("accessors", positions);
  const int t = b.push("accessors", uvs);
  b.primitive({{"POSITION", p}, {"TEXCOORD_0", t}});
  const mesh::Mesh m = read(b);
  CHECK(m.positions == std::vector<Vec3f>{{1, 2, 3}, {4, 5, 6}, {7, 8, 0}});
  CHECK(m.uv_sets.at(0) == std::vector<Vec2f>{{.25F, .5F}, {.75F, .125F}, {1, 0}});
}

TEST_CASE("sparse accessors replace single elements, of zeros where there is no base", "[io]") {
  GltfBuilder b;
  const bool with_base = GENERATE(true, false);
  nlohmann::json positions = {{"componentType", 5126}, {"count", 4}, {"type", "VEC3"}};
  if (with_base) {
    positions["bufferView"] =
        b.view(GltfBuilder::bytes_of<float>({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}));
  }
  const int indices = b.view(GltfBuilder::bytes_of<std::uint16_t>({1, 3}));
  const int values = b.view(GltfBuilder::bytes_of<float>({5, 6, 7, 8, 9, 10}));
  positions["sparse"] = {{"count", 2},
                         {"indices", {{"bufferView", indices}, {"componentType", 5123}}},
                         {"values", {{"bufferView", values}}}};
  const int p = b.push("accessors", positions);
  const int n = b.add<float>({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
  b.primitive({{"POSITION", p}, {"NORMAL", n}}, b.add<std::uint8_t>({0, 1, 2}, "SCALAR"));
  const mesh::Mesh m = read(b);
  const Vec3f third = with_base ? Vec3f{1, 1, 0} : Vec3f{};
  CHECK(m.positions == std::vector<Vec3f>{{0, 0, 0}, {5, 6, 7}, third, {8, 9, 10}});
}

TEST_CASE("accessors without bytes are zeros, indices too", "[io]") {
  GltfBuilder b;
  const int positions = b.add<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3");
  const auto zeros = [&](const char* type, int component, std::uint64_t count) {
    return b.push("accessors", {{"componentType", component}, {"count", count}, {"type", type}});
  };
  b.primitive({{"POSITION", positions}, {"TEXCOORD_0", zeros("VEC2", 5126, 3)}},
              zeros("SCALAR", 5123, 6));
  b.primitive({{"POSITION", zeros("VEC3", 5126, 1500000)}});  // more than the file has bytes
  const mesh::Mesh m = read(b);
  CHECK(m.triangles.size() == 2 + 500000);
  for (const Vec3f& position : m.positions) REQUIRE(position == Vec3f{});
  for (std::uint32_t k = 0; k < 6; ++k) CHECK(m.uv_sets.at(0).at(k) == Vec2f{});
}

TEST_CASE("primitives of Gaussian splats are left out of a mesh, and refused alone", "[io]") {
  GltfBuilder b;
  b.triangle();
  auto& points = b.triangle();
  points["mode"] = 0;
  points["extensions"]["KHR_gaussian_splatting"] = {
      {"kernel", "ellipse"},
      {"extensions", {{"KHR_gaussian_splatting_compression_spz_2", {{"bufferView", 0}}}}}};
  b.doc["extensionsRequired"] = {"KHR_gaussian_splatting",
                                 "KHR_gaussian_splatting_compression_spz_2"};
  const std::string name = "KHR_gaussian_splatting with KHR_gaussian_splatting_compression_spz_2";
  const mesh::Mesh m = read(b);
  CHECK(m.triangles.size() == 1);
  REQUIRE(m.warnings.size() == 1);
  CHECK_THAT(m.warnings[0], Catch::Contains("1 primitives of Gaussian splats (" + name));
  b.doc["nodes"].erase(0);
  b.doc["nodes"][0]["mesh"] = 1;
  const test::TempFolder folder;
  CHECK_THAT(test::refusal(b.write(folder.file("m.gltf"))),
             Catch::Contains("a Gaussian splat scene in glTF (" + name));
}

TEST_CASE("quantised attributes keep their integers, normalised ones become 0..1 or -1..1",
          "[io]") {
  SECTION("u16, not normalised") {
    const mesh::Mesh m = read(quantised_triangle<std::uint16_t>({0, 0, 0, 65535, 0, 0, 0, 7, 0},
                                                                {0, 4095, 1, 2, 3, 4}, false));
    CHECK(m.positions[1] == Vec3f{65535, 0, 0});
    CHECK(m.uv_sets[0] == std::vector<Vec2f>{{0, 4095}, {1, 2}, {3, 4}});
  }
  SECTION("u16, normalised") {
    const mesh::Mesh m = read(quantised_triangle<std::uint16_t>(
        {0, 0, 0, 65535, 0, 0, 0, 13107, 0}, {0, 65535, 13107, 0, 26214, 0}, true));
    CHECK(m.positions[1] == Vec3f{1, 0, 0});
    CHECK(m.positions[2] == Vec3f{0, .2F, 0});
    CHECK(m.uv_sets[0] == std::vector<Vec2f>{{0, 1}, {.2F, 0}, {.4F, 0}});
  }
  SECTION("u8, normalised") {
    const mesh::Mesh m = read(quantised_triangle<std::uint8_t>({0, 0, 0, 255, 0, 0, 0, 51, 0},
                                                               {0, 255, 51, 0, 0, 0}, true));
    CHECK(m.positions[2] == Vec3f{0, .2F, 0});
    CHECK(m.uv_sets[0][1] == Vec2f{.2F, 0});
  }
  SECTION("i8 and i16, normalised, do not fall below -1") {
    const mesh::Mesh m = read(quantised_triangle<std::int8_t>({-128, 0, 0, 127, 0, 0, 0, -127, 0},
                                                              {-128, 127, 0, 0, 0, 0}, true));
    CHECK(m.positions[0] == Vec3f{-1, 0, 0});
    CHECK(m.positions[2] == Vec3f{0, -1, 0});
    CHECK(m.uv_sets[0][0] == Vec2f{-1, 1});
    const mesh::Mesh n = read(quantised_triangle<std::int16_t>(
        {-32768, 0, 0, 32767, 0, 0, 0, -3, 0}, {0, 0, 0, 0, 0, 0}, false));
    CHECK(n.positions[0] == Vec3f{-32768, 0, 0});
  }
}

TEST_CASE("strips and fans become triangles that all face the same way", "[io]") {
  GltfBuilder b;
  const int p = b.add<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 2, 0}, "VEC3");
  const int n = b.add<float>({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
  auto& primitive = b.primitive({{"POSITION", p}, {"NORMAL", n}});
  SECTION("strip") {
    primitive["mode"] = 5;
    CHECK(read(b).triangles == std::vector<Triangle>{{0, 1, 2}, {1, 3, 2}, {2, 3, 4}});
  }
  SECTION("fan") {
    primitive["mode"] = 6;
    CHECK(read(b).triangles == std::vector<Triangle>{{1, 2, 0}, {2, 3, 0}, {3, 4, 0}});
  }
}

TEST_CASE("points and lines are left out with a warning", "[io]") {
  GltfBuilder b;
  b.triangle();
  b.doc["meshes"][0]["primitives"].push_back(
      {{"attributes", {{"POSITION", 0}}}, {"mode", GENERATE(0, 1, 2, 3)}});
  const mesh::Mesh m = read(b);
  CHECK(m.triangles.size() == 1);
  REQUIRE(m.warnings.size() == 1);
  CHECK_THAT(m.warnings[0], Catch::Contains("points or lines"));
}

TEST_CASE("without normals every glTF triangle is flat", "[io]") {
  GltfBuilder b;
  // Two triangles that share an edge and stand at a right angle.
  const int p = b.add<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1}, "VEC3");
  b.primitive({{"POSITION", p}}, b.add<std::uint8_t>({0, 1, 2, 0, 3, 1}, "SCALAR"));
  const mesh::Mesh m = read(b);
  CHECK(m.triangles == std::vector<Triangle>{{0, 1, 2}, {3, 4, 5}});
  CHECK(m.positions[3] == m.positions[0]);
  for (std::size_t i = 0; i < 3; ++i) CHECK(m.normals[i] == Vec3f{0, 0, 1});
  for (std::size_t i = 3; i < 6; ++i) CHECK(m.normals[i] == Vec3f{0, 1, 0});
  CHECK(m.warnings.empty());
}

TEST_CASE("normals that are zero or NaN become those of the triangles", "[io]") {
  GltfBuilder b;
  const int p = b.add<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3");
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const int n = b.add<float>({0, 0, 0, nan, 0, 1, 1, 0, 0}, "VEC3");
  b.primitive({{"POSITION", p}, {"NORMAL", n}});
  const mesh::Mesh m = read(b);
  CHECK(m.normals == std::vector<Vec3f>{{0, 0, 1}, {0, 0, 1}, {1, 0, 0}});
  REQUIRE(m.warnings.size() == 1);
  CHECK_THAT(m.warnings[0], Catch::Contains("2 zero or non-finite"));
}

TEST_CASE("tangents come from the file, else from uv set 0, else from nowhere", "[io]") {
  GltfBuilder b;
  auto& primitive = b.triangle();
  SECTION("from the file, made orthogonal and of unit length") {
    primitive["attributes"]["TANGENT"] =
        b.add<float>({0, 2, 0, -1, 0, 1, 1, 1, 0, 0, 0, 1}, "VEC4");
    const mesh::Mesh m = read(b);
    CHECK(m.tangents[0] == Vec4f{0, 1, 0, -1});
    CHECK(m.tangents[1] == Vec4f{0, 1, 0, 1});
    // The third is zero: any direction in the surface.
    CHECK(m.tangents[2].z == 0);
    CHECK(std::abs(m.tangents[2].x * m.tangents[2].x + m.tangents[2].y * m.tangents[2].y - 1) <
          1e-6);
  }
  SECTION("from UVs: u grows along y, v along x") {
    primitive["attributes"]["TEXCOORD_0"] = b.add<float>({0, 0, 0, 1, 1, 0}, "VEC2");
    // Normal z, tangent y, so cross = -x; v (down) falls along -x: sign +1.
    CHECK(read(b).tangents == std::vector<Vec4f>(3, {0, 1, 0, 1}));
  }
  SECTION("from mirrored UVs") {
    primitive["attributes"]["TEXCOORD_0"] = b.add<float>({0, 0, 1, 0, 0, 1}, "VEC2");
    CHECK(read(b).tangents == std::vector<Vec4f>(3, {1, 0, 0, -1}));
  }
  SECTION("without UVs") { CHECK(read(b).tangents == std::vector<Vec4f>(3, {1, 0, 0, 1})); }
}

TEST_CASE("a primitive without a UV set says so, vertex by vertex", "[io]") {
  GltfBuilder b;
  auto& first = b.triangle();
  first["attributes"]["TEXCOORD_1"] = b.add<float>({0, 0, 1, 0, 0, 1}, "VEC2");
  auto& second = b.triangle();
  second["attributes"]["TEXCOORD_0"] = b.add<float>({.5F, 0, 1, 0, 0, 1}, "VEC2");
  const mesh::Mesh m = read(b);
  REQUIRE(m.uv_sets.size() == 2);
  CHECK(m.uv_present[0] == std::vector<bool>{false, false, false, true, true, true});
  CHECK(m.uv_present[1] == std::vector<bool>{true, true, true, false, false, false});
  CHECK(m.uv_sets[0][3] == Vec2f{.5F, 0});
  CHECK(m.uv_sets[1].size() == 6);
  CHECK(m.has_uv(1, 0));
  CHECK_FALSE(m.has_uv(0, 0));
  CHECK_FALSE(m.has_uv(7, 0));
}

TEST_CASE("GLB and external buffers give the same mesh as a data URI", "[io]") {
  const TempFolder folder;
  GltfBuilder b;
  b.triangle();
  const mesh::Mesh inline_mesh = io::read_mesh(b.write(folder.file("a.gltf")));
  const mesh::Mesh glb = io::read_mesh(b.write_glb(folder.file("a.glb")));
  const mesh::Mesh misnamed = io::read_mesh(b.write_glb(folder.file("a.model")));
  test::write_file(folder.file("my data.bin"), b.buffer);
  b.doc["buffers"] =
      nlohmann::json::array({{{"uri", "my%20data.bin"}, {"byteLength", b.buffer.size()}}});
  test::write_file(folder.file("b.gltf"), b.doc.dump());
  const mesh::Mesh external = io::read_mesh(folder.file("b.gltf"));
  for (const mesh::Mesh* m : {&glb, &misnamed, &external}) {
    CHECK(m->positions == inline_mesh.positions);
    CHECK(m->normals == inline_mesh.normals);
    CHECK(m->triangles == inline_mesh.triangles);
  }
}

TEST_CASE("mesh_cost bounds what the mesh holds, without reading it", "[io]") {
  const TempFolder folder;
  GltfBuilder b;
  std::vector<float> positions;
  for (int i = 0; i < 30000; ++i) positions.push_back(static_cast<float>(i % 7));
  const int p = b.add<float>(positions, "VEC3");
  b.primitive({{"POSITION", p},
               {"NORMAL", p},
               {"TEXCOORD_0", b.add<float>(std::vector<float>(20000, 0), "VEC2")}});
  const std::string path = b.write_glb(folder.file("a.glb"));
  const io::MeshCost cost = io::mesh_cost(path);
  const std::uint64_t size = io::read_mesh(path).size_bytes();
  CHECK(size >= 10000 * (12 + 12 + 16 + 8) + 3333 * 16);
  CHECK(cost.kept_bytes >= size);
  CHECK(cost.peak_bytes >= cost.kept_bytes);
  CHECK(cost.peak_bytes < 10 * size + (8 << 20));
}
