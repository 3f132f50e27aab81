// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <functional>
#include <limits>

#include "read_error.h"
#include "support/gltf_builder.h"
#include "support/test_data.h"

using namespace pounce;
using nlohmann::json;
using test::GltfBuilder;
using test::refusal;
using test::TempFolder;

namespace {

struct BadCase {
  std::string message;  ///< part of what must be said
  std::function<void(GltfBuilder&)> spoil;
};

/// A valid model with one of everything, to be spoiled. Accessors: 0 positions, 1 normals, 2 UVs, 3
/// indices, 4 joints, 5 weights, 6 inverse bind matrices.
GltfBuilder good_model() {
  GltfBuilder b;
  auto& primitive = b.triangle();
  primitive["attributes"]["TEXCOORD_0"] = b.add<float>({0, 0, 1, 0, 0, 1}, "VEC2");
  primitive["indices"] = b.add<std::uint8_t>({0, 1, 2}, "SCALAR");
  primitive["attributes"]["JOINTS_0"] =
      b.add<std::uint8_t>(std::vector<std::uint8_t>(12, 0), "VEC4");
  primitive["attributes"]["WEIGHTS_0"] = b.add<float>({1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, "VEC4");
  primitive["material"] = 0;
  b.doc["meshes"][0]["name"] = "Head";
  const int bind = b.add<float>({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, "MAT4");
  b.doc["skins"] = json::array({{{"joints", json::array({1})}, {"inverseBindMatrices", bind}}});
  b.doc["nodes"][0]["skin"] = 0;
  b.doc["nodes"].push_back(json::object());
  b.doc["scenes"] = json::array({{{"nodes", json::array({0, 1})}}});
  b.doc["scene"] = 0;
  b.doc["images"] = json::array({{{"uri", "data:image/png;base64,AAAA"}}});
  b.doc["samplers"] = json::array({json::object()});
  b.doc["textures"] = json::array({{{"source", 0}, {"sampler", 0}}});
  b.doc["materials"] =
      json::array({{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}});
  return b;
}

void put_floats(GltfBuilder& b, int accessor, std::size_t element, std::vector<float> values) {
  const auto view =
      b.doc["accessors"][static_cast<std::size_t>(accessor)]["bufferView"].get<std::size_t>();
  const auto offset = b.doc["bufferViews"][view]["byteOffset"].get<std::size_t>();
  b.buffer.replace(offset + element * 4, values.size() * 4, GltfBuilder::bytes_of(values));
}

json& primitive_of(GltfBuilder& b) { return b.doc["meshes"][0]["primitives"][0]; }

const float kNan = std::numeric_limits<float>::quiet_NaN();
const float kInf = std::numeric_limits<float>::infinity();

const std::vector<BadCase>& structure_cases() {
  static const std::vector<BadCase> cases = {
      {"asset is missing", [](auto& b) { b.doc.erase("asset"); }},
      {"asset.version is missing", [](auto& b) { b.doc["asset"] = json::object(); }},
      {"\"1.0\"", [](auto& b) { b.doc["asset"]["version"] = "1.0"; }},
      {"\"2.1\"", [](auto& b) { b.doc["asset"]["minVersion"] = "2.1"; }},
      {"meshes is not an array", [](auto& b) { b.doc["meshes"] = json::object(); }},
      {"nodes[0] is not a JSON object", [](auto& b) { b.doc["nodes"][0] = 3; }},
      {"KHR_meshopt_compression",
       [](auto& b) { b.doc["extensionsRequired"] = json::array({"KHR_meshopt_compression"}); }},
      {"ACME_shape_shifter",
       [](auto& b) { b.doc["extensionsRequired"] = json::array({"ACME_shape_shifter"}); }},
      {"scene is 4", [](auto& b) { b.doc["scene"] = 4; }},
      {"scenes[0].nodes is 9", [](auto& b) { b.doc["scenes"][0]["nodes"].push_back(9); }},
      {"lists nodes[0] twice", [](auto& b) { b.doc["scenes"][0]["nodes"].push_back(0); }},
      {"which is not a root node",
       [](auto& b) { b.doc["nodes"][0]["children"] = json::array({1}); }},
      {"two parents",
       [](auto& b) {
         b.doc["nodes"].push_back({{"children", json::array({0})}});
         b.doc["nodes"].push_back({{"children", json::array({0})}});
       }},
      {"loop of nodes",
       [](auto& b) {
         b.doc["nodes"].push_back({{"children", json::array({3})}});
         b.doc["nodes"].push_back({{"children", json::array({2})}});
       }},
      {"loop of nodes",
       [](auto& b) {
         b.doc["nodes"].push_back({{"children", json::array({2})}});
       }},
      {"nodes[0].mesh is 1", [](auto& b) { b.doc["nodes"][0]["mesh"] = 1; }},
      {"nodes[0].mesh is not an index", [](auto& b) { b.doc["nodes"][0]["mesh"] = -1; }},
      {"nodes[0].skin is 7", [](auto& b) { b.doc["nodes"][0]["skin"] = 7; }},
      {"nodes[0].matrix has 3 numbers",
       [](auto& b) {
         b.doc["nodes"][0]["matrix"] = json::array({1, 2, 3});
       }},
      {"nodes[0].translation contains something that is not a finite number",
       [](auto& b) {
         b.doc["nodes"][0]["translation"] = json::array({1e200, 0, 0});
       }},
      {"nodes[0].rotation is zero",
       [](auto& b) {
         b.doc["nodes"][0]["rotation"] = json::array({0, 0, 0, 0});
       }},
      {"both a matrix and",
       [](auto& b) {
         b.doc["nodes"][1]["matrix"] =
             json::array({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1});
         b.doc["nodes"][1]["scale"] = json::array({1, 1, 1});
       }},
      {"skins[0].joints is 5", [](auto& b) { b.doc["skins"][0]["joints"].push_back(5); }},
      {"fewer matrices", [](auto& b) { b.doc["skins"][0]["joints"].push_back(0); }},
      {"float MAT4", [](auto& b) { b.doc["skins"][0]["inverseBindMatrices"] = 0; }},
      {"primitives[0].material is 1", [](auto& b) { primitive_of(b)["material"] = 1; }},
      {"primitives[0].mode is 7", [](auto& b) { primitive_of(b)["mode"] = 7; }},
      {"attributes.POSITION is 99",
       [](auto& b) { primitive_of(b)["attributes"]["POSITION"] = 99; }},
      {"attributes is missing", [](auto& b) { primitive_of(b).erase("attributes"); }},
      {"index is 3", [](auto& b) { b.doc["materials"][0]["occlusionTexture"]["index"] = 3; }},
      {"textures[0].source is 2", [](auto& b) { b.doc["textures"][0]["source"] = 2; }},
      {"textures[0].sampler is 2", [](auto& b) { b.doc["textures"][0]["sampler"] = 2; }},
      {"not a wrap mode", [](auto& b) { b.doc["samplers"][0]["wrapS"] = 1; }},
      {"images[0].bufferView is 50",
       [](auto& b) {
         b.doc["images"][0] = {{"bufferView", 50}};
       }},
      {"no triangles", [](auto& b) { primitive_of(b)["mode"] = 0; }},
      {"no triangles", [](auto& b) { b.doc["scenes"][0]["nodes"] = json::array({1}); }},
  };
  return cases;
}

const std::vector<BadCase>& accessor_cases() {
  static const std::vector<BadCase> cases = {
      {"bufferViews[0].buffer is 1", [](auto& b) { b.doc["bufferViews"][0]["buffer"] = 1; }},
      {"bufferViews[0] reaches beyond",
       [](auto& b) { b.doc["bufferViews"][0]["byteLength"] = 99999; }},
      {"bufferViews[0] reaches beyond",
       [](auto& b) { b.doc["bufferViews"][0]["byteOffset"] = 9007199254740992; }},
      {"must be 0 to",
       [](auto& b) { b.doc["bufferViews"][0]["byteOffset"] = 18446744073709551615U; }},
      {"byteStride", [](auto& b) { b.doc["bufferViews"][0]["byteStride"] = 3; }},
      {"byteStride is not a multiple", [](auto& b) { b.doc["bufferViews"][0]["byteStride"] = 13; }},
      {"more than the byteStride", [](auto& b) { b.doc["bufferViews"][0]["byteStride"] = 8; }},
      {"accessors[0] reads beyond", [](auto& b) { b.doc["accessors"][0]["count"] = 4; }},
      {"accessors[0] reads beyond",
       [](auto& b) { b.doc["accessors"][0]["count"] = 9007199254740992; }},
      {"accessors[0] reads beyond", [](auto& b) { b.doc["accessors"][0]["byteOffset"] = 4; }},
      {"accessors[0] reads beyond", [](auto& b) { b.doc["bufferViews"][0]["byteStride"] = 252; }},
      {"accessors[0].count", [](auto& b) { b.doc["accessors"][0]["count"] = 0; }},
      {"accessors[0].count is not a whole number",
       [](auto& b) { b.doc["accessors"][0]["count"] = -3; }},
      {"accessors[0].type is \"VEC9\"", [](auto& b) { b.doc["accessors"][0]["type"] = "VEC9"; }},
      {"5124", [](auto& b) { b.doc["accessors"][3]["componentType"] = 5124; }},
      {"accessors[0].componentType",
       [](auto& b) { b.doc["accessors"][0]["componentType"] = 5130; }},
      {"has 9007199254740992 vertices",
       [](auto& b) {
         for (const int i : {0, 1, 2, 4, 5}) {
           b.doc["accessors"][static_cast<std::size_t>(i)]["count"] = 9007199254740992;
           b.doc["accessors"][static_cast<std::size_t>(i)].erase("bufferView");
         }
       }},
      {"sparse.count is 4",
       [](auto& b) {
         b.doc["accessors"][0]["sparse"] = {
             {"count", 4},
             {"indices", {{"bufferView", 3}, {"componentType", 5121}}},
             {"values", {{"bufferView", 0}}}};
       }},
      {"sparse.indices.bufferView is 77",
       [](auto& b) {
         b.doc["accessors"][0]["sparse"] = {
             {"count", 1},
             {"indices", {{"bufferView", 77}, {"componentType", 5121}}},
             {"values", {{"bufferView", 0}}}};
       }},
      {"sparse.values reads beyond",
       [](auto& b) {
         b.doc["accessors"][0]["sparse"] = {
             {"count", 3},
             {"indices", {{"bufferView", 3}, {"componentType", 5121}}},
             {"values", {{"bufferView", 0}, {"byteOffset", 12}}}};
       }},
      {"sparse index 5",
       [](auto& b) {
         const int view = b.view(std::string("\x05", 1));
         b.doc["accessors"][0]["sparse"] = {
             {"count", 1},
             {"indices", {{"bufferView", view}, {"componentType", 5121}}},
             {"values", {{"bufferView", 0}}}};
       }},
      {"\"Head\" primitive 0 NORMAL (accessor 1) has 2 elements, but POSITION has 3",
       [](auto& b) { b.doc["accessors"][1]["count"] = 2; }},
      {"POSITION (accessor 2) has type VEC2",
       [](auto& b) { primitive_of(b)["attributes"]["POSITION"] = 2; }},
      {"NORMAL (accessor 1)", [](auto& b) { b.doc["accessors"][1]["componentType"] = 5121; }},
      {"indices (accessor 0) is not", [](auto& b) { primitive_of(b)["indices"] = 0; }},
      {"JOINTS_0", [](auto& b) { primitive_of(b)["attributes"]["JOINTS_0"] = 5; }},
      {"no matching joints", [](auto& b) { primitive_of(b)["attributes"].erase("JOINTS_0"); }},
      {"element 1 is 3, but only 3 vertices exist",
       [](auto& b) {
         primitive_of(b)["indices"] = b.template add<std::uint16_t>({0, 3, 2}, "SCALAR");
       }},
      {"primitive restart value 255",
       [](auto& b) {
         primitive_of(b)["indices"] = b.template add<std::uint8_t>({0, 255, 2}, "SCALAR");
       }},
      {"primitive restart value 4294967295",
       [](auto& b) {
         primitive_of(b)["indices"] = b.template add<std::uint32_t>({0, 1, 0xFFFFFFFF}, "SCALAR");
       }},
      {"mesh 0 \"Head\" primitive 0 POSITION (accessor 0) element 1 is not a finite number",
       [](auto& b) { put_floats(b, 0, 4, {kNan}); }},
      {"POSITION (accessor 0) element 2", [](auto& b) { put_floats(b, 0, 6, {-kInf}); }},
      {"TEXCOORD_0 (accessor 2) element 0", [](auto& b) { put_floats(b, 2, 0, {kInf}); }},
      {"WEIGHTS_0 (accessor 5) element 0 is not", [](auto& b) { put_floats(b, 5, 0, {kNan}); }},
      {"WEIGHTS_0 (accessor 5) element 1 is negative", [](auto& b) { put_floats(b, 5, 5, {-1}); }},
      {"refers to joint 1, but the skin has only 1",
       [](auto& b) {
         primitive_of(b)["attributes"]["JOINTS_0"] =
             b.template add<std::uint8_t>({0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0}, "VEC4");
       }},
      {"inverseBindMatrices", [](auto& b) { put_floats(b, 6, 12, {kNan}); }},
      {"moved to infinity",
       [](auto& b) {
         put_floats(b, 0, 3, {3e38F});
         put_floats(b, 6, 0, {3e38F});
       }},
      {"target 0 POSITION",
       [](auto& b) {
         primitive_of(b)["targets"] = json::array({{{"POSITION", 3}}});
       }},
  };
  return cases;
}

void check_cases(const std::vector<BadCase>& cases) {
  const TempFolder folder;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    GltfBuilder b = good_model();
    cases[i].spoil(b);
    const std::string path = b.write(folder.file("spoiled" + std::to_string(i) + ".gltf"));
    const std::string message = refusal(path);
    INFO("case " << i);
    CHECK_THAT(message, Catch::Contains(cases[i].message));
    CHECK_THAT(message, Catch::StartsWith(path + ": "));
  }
}

}  // namespace

TEST_CASE("the model that the bad cases spoil is good", "[io]") {
  const TempFolder folder;
  const mesh::Mesh m = io::read_mesh(good_model().write(folder.file("good.gltf")));
  CHECK(m.triangles.size() == 1);
  CHECK(m.warnings.empty());
}

TEST_CASE("a broken document is refused, naming the place", "[io]") {
  check_cases(structure_cases());
}

TEST_CASE("broken accessors and their data are refused, naming the place", "[io]") {
  check_cases(accessor_cases());
}

TEST_CASE("accessors without bytes cannot make a small file huge", "[io]") {
  const TempFolder folder;
  GltfBuilder b;
  b.triangle()["indices"] =
      b.push("accessors",
             {{"componentType", 5125}, {"count", std::uint64_t{1} << 31}, {"type", "SCALAR"}});
  CHECK_THAT(refusal(b.write(folder.file("m.gltf"))),
             Catch::Contains("too many for a file of this size"));
  b = good_model();
  b.doc["accessors"][b.doc["skins"][0]["inverseBindMatrices"].get<std::size_t>()] = {
      {"componentType", 5126}, {"count", std::uint64_t{1} << 31}, {"type", "MAT4"}};
  CHECK_THAT(refusal(b.write(folder.file("m.gltf"))),
             Catch::Contains("claims 2147483648 elements but has no bytes"));
}

TEST_CASE("a repeated scene cannot make a small file huge", "[io]") {
  const TempFolder folder;
  GltfBuilder b;
  std::vector<std::uint32_t> zeros(30000, 0);
  b.triangle()["indices"] = b.add<std::uint32_t>(zeros, "SCALAR");
  json nodes = json::array();
  for (int i = 0; i < 100000; ++i) nodes.push_back({{"mesh", 0}});
  b.doc["nodes"] = nodes;
  CHECK_THAT(refusal(b.write(folder.file("m.gltf"))),
             Catch::Contains("too many for a file of this size"));
}

TEST_CASE("truncated and garbled GLB and JSON are refused at every length", "[io]") {
  const TempFolder folder;
  const std::string path = good_model().write_glb(folder.file("good.glb"));
  std::ifstream file(path, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  const std::string cut = folder.file("cut.glb");
  for (std::size_t size = 0; size < bytes.size(); size += 7) {
    test::write_file(cut, bytes.substr(0, size));
    INFO("cut at " << size);
    CHECK(refusal(cut) != "");
  }
}

TEST_CASE("no flipped byte of a GLB makes the reader do anything but read or refuse", "[io]") {
  const TempFolder folder;
  const std::string path = good_model().write_glb(folder.file("good.glb"));
  std::ifstream file(path, std::ios::binary);
  std::string bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  const std::string spoiled = folder.file("spoiled.glb");
  std::size_t refused = 0, read = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    for (const char flip : {'\x01', '\x20', '\x80'}) {
      std::string copy = bytes;
      copy[i] = static_cast<char>(copy[i] ^ flip);
      test::write_file(spoiled, copy);
      try {
        const mesh::Mesh m = io::read_mesh(spoiled);
        for (const auto& t : m.triangles) {
          for (const std::uint32_t corner : t) REQUIRE(corner < m.positions.size());
        }
        for (const Vec3f p : m.positions) REQUIRE(std::isfinite(p.x + p.y + p.z));
        ++read;
      } catch (const Error&) {
        ++refused;
      }
    }
  }
  std::printf("FIGURE flipped bytes of a GLB of %zu: %zu read, %zu refused\n", bytes.size(), read,
              refused);
  CHECK(refused > bytes.size());
  CHECK(read > bytes.size() / 2);  // what is hit in names and coordinates is only another value
}

TEST_CASE("JSON that nests too deep is refused, not recursed into", "[io]") {
  const TempFolder folder;
  const std::string path = folder.file("deep.gltf");
  test::write_file(path, "{\"asset\":{\"version\":\"2.0\",\"extras\":" + std::string(100000, '[') +
                             std::string(100000, ']') + "}}");
  CHECK_THAT(refusal(path), Catch::Contains("nested deeper"));
}

TEST_CASE("buffers that are missing or too short are told", "[io]") {
  const TempFolder folder;
  GltfBuilder b;
  b.triangle();
  const auto with_uri = [&](const std::string& uri) {
    b.doc["buffers"] = json::array({{{"uri", uri}, {"byteLength", b.buffer.size()}}});
    test::write_file(folder.file("m.gltf"), b.doc.dump());
    return refusal(folder.file("m.gltf"));
  };
  CHECK_THAT(with_uri("gone.bin"), Catch::Contains("\"gone.bin\", which is missing"));
  CHECK_THAT(with_uri("http://example.com/a.bin"), Catch::Contains("missing"));
  CHECK_THAT(with_uri("data:application/octet-stream;base64,AAAA"),
             Catch::Contains("should have 72 bytes, but has 3"));
  CHECK_THAT(with_uri("data:application/octet-stream;base64,!!!!"),
             Catch::Contains("not valid in base64"));
  CHECK_THAT(with_uri("data:text/plain,hello"), Catch::Contains("not base64"));
  b.doc["buffers"] = json::array({{{"byteLength", b.buffer.size()}}});
  test::write_file(folder.file("m.gltf"), b.doc.dump());
  CHECK_THAT(refusal(folder.file("m.gltf")), Catch::Contains("neither a uri nor a BIN chunk"));
}

TEST_CASE("files of other kinds are refused by what is read, missing ones by the system", "[io]") {
  const TempFolder folder;
  for (const char* name : {"a.fbx", "a"}) {
    test::write_file(folder.file(name), "no mesh at all\n");
    CHECK_THAT(refusal(folder.file(name)), Catch::Contains(".glb, .gltf, .obj"));
  }
  test::write_file(folder.file("a.fbx"), "ply\nformat ascii 1.0\n");
  CHECK_THAT(refusal(folder.file("a.fbx")), Catch::Contains("has no \"end_header\" line"));
  for (const char* name : {"gone.glb", "gone.gltf", "gone.obj"}) {
    try {
      io::read_mesh(folder.file(name));
      FAIL("read a file that is not there");
    } catch (const Error& e) {
      CHECK(e.kind() == ErrorKind::storage);
      CHECK_THAT(e.what(), Catch::Contains(folder.file(name)));
    }
  }
}

TEST_CASE("hundreds of thousands of entries are read or refused in a moment", "[io]") {
  const TempFolder folder;
  GltfBuilder b;
  b.triangle();
  SECTION("nodes: read") {
    for (int i = 0; i < 200000; ++i) b.doc["nodes"].push_back(json::object());
    CHECK(refusal(b.write(folder.file("m.gltf"))) == "");
  }
  SECTION("materials: refused") {
    b.doc["materials"] = json::array();
    for (int i = 0; i < 200000; ++i) b.doc["materials"].push_back(json::object());
    CHECK_THAT(refusal(b.write(folder.file("m.gltf"))), Catch::Contains("32768 materials"));
  }
}
