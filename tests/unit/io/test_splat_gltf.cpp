// SPDX-License-Identifier: Apache-2.0
//
// KHR_gaussian_splatting: every type of accessor, nodes, several primitives, SPZ within, and what
// is refused by name.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>

#include "io/read_mesh.h"
#include "io/splats/scene.h"
#include "splat_reading.h"
#include "support/splat_encodings.h"

namespace pounce::io {
namespace {

using store::Splat;
using test::GltfScene;
using Json = nlohmann::json;

const std::string kPrefix = "KHR_gaussian_splatting:";

std::string problem_of(const GltfScene& scene) {
  const test::TempFolder folder;
  return splat_problem(write_bytes(folder, "s.glb", scene.bytes()));
}

ReadScene read(const GltfScene& scene, std::uint32_t lobes = 3) {
  const test::TempFolder folder;
  return read_scene(write_bytes(folder, "s.glb", scene.bytes()), lobes);
}

bool has(const std::string& text, const std::string& part) {
  INFO(text);
  const bool found = text.find(part) != std::string::npos;
  CHECK(found);
  return found;
}

TEST_CASE("quantised accessors of splats are read as glTF means them", "[io]") {
  GltfScene scene = test::gltf_scene(test::random_scene(2, 1));
  const auto bytes = [](std::initializer_list<int> values) {
    std::string out;
    for (const int v : values) out += static_cast<char>(v);
    return out;
  };
  SECTION("bytes") {
    scene.add_accessor(kPrefix + "ROTATION", "VEC4", 5120, true, 2,
                       bytes({0, 0, 0, 127, 127, 0, 0, 0}));
    scene.add_accessor(kPrefix + "SCALE", "VEC3", 5121, true, 2, bytes({51, 102, 255, 1, 2, 3}));
    scene.add_accessor(kPrefix + "OPACITY", "SCALAR", 5121, true, 2, bytes({51, 255}));
    const ReadScene found = read(scene);
    REQUIRE(found.rows.splats.size() == 2);
    const Splat &a = found.rows.splats[0], &b = found.rows.splats[1];
    CHECK(a.rotation == std::array<float, 4>{1, 0, 0, 0});
    CHECK(b.rotation == std::array<float, 4>{0, 1, 0, 0});
    CHECK(a.sigma == Vec3f{0.2F, 0.4F, 1});
    CHECK(a.alpha == 0.2F);
    CHECK(b.alpha == 1);
  }
  SECTION("whole numbers of 16 bits, not normalised") {
    scene.add_accessor("POSITION", "VEC3", 5122, false, 2,
                       bytes({1, 0, 254, 255, 0, 1, 0, 0, 0, 0, 0, 0}));
    scene.add_accessor(kPrefix + "SCALE", "VEC3", 5123, false, 2,
                       bytes({3, 0, 0, 1, 1, 0, 1, 0, 1, 0, 1, 0}));
    const ReadScene found = read(scene);
    CHECK(found.rows.splats[0].mean == Vec3f{1, -2, 256});
    CHECK(found.rows.splats[0].sigma == Vec3f{3, 256, 1});
  }
  SECTION("opacity in whole numbers must be normalised") {
    scene.add_accessor(kPrefix + "OPACITY", "SCALAR", 5121, false, 2, bytes({51, 255}));
    has(problem_of(scene), "not normalized");
  }
}

TEST_CASE("nodes place Gaussians, and several primitives are one scene", "[io]") {
  GltfScene scene = test::gltf_scene(test::random_scene(300, 1));
  const ReadScene plain = read(scene);
  scene.document["nodes"] = Json::array(
      {{{"children", {1, 2}}, {"translation", {10, 0, 0}}},
       {{"mesh", 0}},
       {{"mesh", 1}, {"rotation", {0, 0, std::sqrt(0.5), std::sqrt(0.5)}}, {"scale", {2, 2, 2}}},
       {{"mesh", 0}}});  // of no scene
  scene.document["meshes"].push_back(scene.document["meshes"][0]);
  // The second has no harmonics.
  auto& attributes = scene.document["meshes"][1]["primitives"][0]["attributes"];
  for (int n = 0; n < 3; ++n) attributes.erase(kPrefix + "SH_DEGREE_1_COEF_" + std::to_string(n));
  const ReadScene found = read(scene);
  REQUIRE(found.info.splats == 600);
  CHECK(found.info.sh_degree == 1);
  for (const std::size_t i : {0U, 255U, 299U}) {
    const Splat &from = plain.rows.splats[i], &first = found.rows.splats[i],
                &second = found.rows.splats[300 + i];
    CHECK(first.mean.x == Approx(from.mean.x + 10).epsilon(1e-6));
    CHECK(first.rotation[2] == Approx(from.rotation[2]).margin(1e-6));
    CHECK(found.sh(i, 5) == plain.sh(i, 5));
    CHECK(second.mean.x == Approx(-2 * from.mean.y + 10).epsilon(1e-5));  // z by 90 degrees
    CHECK(second.mean.y == Approx(2 * from.mean.x).epsilon(1e-5));
    CHECK(second.sigma.z == Approx(2 * from.sigma.z).epsilon(1e-5));
    CHECK(found.sh(300 + i, 5) == 0);
  }
}

TEST_CASE("a turned node turns harmonics", "[io]") {
  GltfScene scene = test::gltf_scene(test::random_scene(3, 1));
  const ReadScene plain = read(scene);
  scene.document["nodes"][0]["rotation"] = {1, 0, 0, 0};  // x by 180 degrees
  const ReadScene turned = read(scene);
  for (std::size_t c = 0; c < 3; ++c) {
    CHECK(turned.sh(1, c) == -plain.sh(1, c));          // with y
    CHECK(turned.sh(1, 3 + c) == -plain.sh(1, 3 + c));  // with z
    CHECK(turned.sh(1, 6 + c) == plain.sh(1, 6 + c));   // with x
  }
}

TEST_CASE("SPZ in a buffer view is decoded", "[io]") {
  const test::Scene splats = test::random_scene(30, 1);
  GltfScene scene = test::gltf_scene(splats);
  const std::string spz = test::gzipped(test::spz_bytes(splats, 2));
  scene.add_accessor("COLOR_0", "SCALAR", 5121, false, spz.size(), spz);
  const std::size_t view = scene.document["bufferViews"].size() - 1;
  scene.primitive()["attributes"] = {{"POSITION", 0}};
  for (auto& accessor : scene.document["accessors"]) accessor.erase("bufferView");
  scene.document["extensionsRequired"] = {"KHR_gaussian_splatting"};
  auto& extension = scene.primitive()["extensions"]["KHR_gaussian_splatting"];
  extension["extensions"]["KHR_gaussian_splatting_compression_spz_2"]["bufferView"] = view;
  scene.document["nodes"][0]["scale"] = {1, -1, 1};
  const ReadScene found = read(scene);
  REQUIRE(found.rows.splats.size() == 30);
  CHECK(found.info.sh_degree == 1);
  CHECK(found.rows.splats[7].mean.y == Approx(-splats[7].mean[1]).margin(2e-4));
  CHECK(found.sh(7, 0) == Approx(-splats[7].rest[0]).margin(5e-3));
  CHECK(found.sh(7, 6) == Approx(splats[7].rest[6]).margin(5e-3));
  REQUIRE(found.info.assumptions.size() == 1);
  has(found.info.assumptions[0], "its axes are assumed to be glTF's (left, up, forward)");
  extension["extensions"]["KHR_gaussian_splatting_compression_spz_2"]["bufferView"] = 99;
  has(problem_of(scene), "bufferView");
  extension["extensions"] = {{"KHR_gaussian_splatting_compression_egsc", {{"bufferView", view}}}};
  has(problem_of(scene), "KHR_gaussian_splatting_compression_egsc, which is not supported");
}

TEST_CASE("what an SPZ within a glTF says of its axes is not followed, and told", "[io]") {
  const test::Scene splats = test::random_scene(3, 1);
  std::string record;
  test::put(record, std::uint32_t{0xADBE0003});
  test::put(record, std::uint32_t{4});
  test::put(record, std::uint32_t{4});
  const ReadScene found =
      read(test::spz_in_gltf(splats, test::gzipped(test::spz_bytes(splats, 2, record))));
  CHECK(found.rows.splats[1].mean.y == Approx(splats[1].mean[1]).margin(2e-4));
  REQUIRE(found.info.assumptions.size() == 2);
  has(found.info.assumptions[0], "states the axes RUB; ignored");
}

TEST_CASE("colour spaces are told, what is unknown is refused by name", "[io]") {
  GltfScene scene = test::gltf_scene(test::random_scene(3, 1));
  auto& extension = scene.primitive()["extensions"]["KHR_gaussian_splatting"];
  CHECK_FALSE(read(scene).info.is_linear);
  extension["colorSpace"] = "lin_rec709_display";
  CHECK(read(scene).info.is_linear);
  extension["colorSpace"] = "lin_p3";
  has(problem_of(scene), "colour space \"lin_p3\"");
  extension["colorSpace"] = "lin_rec709_display";
  extension["kernel"] = "cube";
  has(problem_of(scene), "kernel \"cube\"");
  extension["kernel"] = "ellipse";
  const auto told = [&](const ReadScene& read_scene) {
    return std::any_of(read_scene.info.assumptions.begin(), read_scene.info.assumptions.end(),
                       [](const std::string& one) {
                         return one.find("its kernel is missing") != std::string::npos;
                       });
  };
  CHECK_FALSE(told(read(scene)));
  extension.erase("kernel");  // as files of public readers' tests: there is but one
  CHECK(told(read(scene)));
  CHECK(read(scene).rows.splats.size() == 3);
  extension["kernel"] = 1;
  has(problem_of(scene), "kernel");
  extension["kernel"] = "ellipse";
  scene.document["meshes"].push_back(scene.document["meshes"][0]);
  scene.document["meshes"][1]["primitives"][0]["extensions"]["KHR_gaussian_splatting"]
                ["colorSpace"] = "srgb_rec709_display";
  scene.document["nodes"].push_back({{"mesh", 1}});
  scene.document["scenes"][0]["nodes"] = {0, 1};
  has(problem_of(scene), "mesh 1 primitive 0 is in srgb_rec709_display");
}

TEST_CASE("splat primitives that lack something are refused", "[io]") {
  const GltfScene whole = test::gltf_scene(test::random_scene(3, 1));
  const auto without = [&](const std::string& name) {
    GltfScene scene = whole;
    scene.primitive()["attributes"].erase(name);
    return problem_of(scene);
  };
  has(without("POSITION"), "no POSITION");
  has(without(kPrefix + "ROTATION"), "has no KHR_gaussian_splatting:ROTATION");
  has(without(kPrefix + "SH_DEGREE_0_COEF_0"), "an incomplete set of spherical harmonics");
  for (int n = 0; n < 3; ++n)
    has(without(kPrefix + "SH_DEGREE_1_COEF_" + std::to_string(n)),
        "an incomplete set of spherical harmonics");
  GltfScene scene = whole;
  scene.document["accessors"][0].erase("bufferView");
  has(problem_of(scene), "has no buffer view or is sparse");
  scene = whole;
  scene.document["accessors"][3]["count"] = 2;
  has(problem_of(scene), "has 2 elements for 3 Gaussians");
  scene = whole;
  scene.document["accessors"][2]["type"] = "VEC2";
  has(problem_of(scene), "wrong type");
  scene = whole;
  scene.document["accessors"][0]["count"] = 4294967296;
  CHECK_FALSE(problem_of(scene).empty());
  scene = whole;
  scene.document["scenes"][0]["nodes"] = Json::array();
  has(problem_of(scene), "has no primitive of Gaussians");
}

TEST_CASE("a file of meshes is no scene, a scene is no mesh", "[io]") {
  const test::TempFolder folder;
  GltfScene scene = test::gltf_scene(test::random_scene(3, 1));
  const std::string path = write_bytes(folder, "s.bin", scene.bytes());
  CHECK_FALSE(splat_format(path).has_value());
  REQUIRE(source_splat_format(path).has_value());
  CHECK(source_splat_format(path)->kind == SplatKind::gltf);
  try {
    read_mesh(path);
    FAIL("read as a mesh");
  } catch (const Error& e) {
    has(e.what(), "a Gaussian splat scene in glTF (KHR_gaussian_splatting) without triangles");
  }
  // The word alone makes no scene.
  scene.primitive().erase("extensions");
  CHECK_FALSE(source_splat_format(write_bytes(folder, "s.glb", scene.bytes())).has_value());
  // With meshes beside it, Gaussians are the source, and it is said.
  scene = test::gltf_scene(test::random_scene(3, 1));
  scene.document["meshes"][0]["primitives"].push_back({{"attributes", {{"POSITION", 0}}}});
  const ReadScene both = read(scene);
  CHECK(both.info.splats == 3);
  REQUIRE(both.info.assumptions.size() == 2);
  has(both.info.assumptions[1], "1 primitives without KHR_gaussian_splatting ignored");
}

TEST_CASE("JSON larger than any scene's is not understood", "[io]") {
  GltfScene scene = test::gltf_scene(test::random_scene(3, 1));
  for (int i = 0; i < 17000; ++i) scene.document["nodes"].push_back(Json::object());
  has(problem_of(scene), "more than 16384 nodes");
  scene = test::gltf_scene(test::random_scene(3, 1));
  scene.document["scenes"][0]["nodes"] = Json::array();
  for (int i = 0; i < 5000; ++i) {
    scene.document["nodes"].push_back({{"mesh", 0}});
    scene.document["scenes"][0]["nodes"].push_back(i + 1);
  }
  has(problem_of(scene), "more than 4096 primitives");
}

TEST_CASE("the conformance scenes of KHR_gaussian_splatting are read node by node",
          "[io][data][external]") {
  const auto data = test::test_data();
  if (!data) return;
  Json document;
  std::ifstream(*data / "splats/khr_gaussian_splatting/khr_conformance_matrix.gltf") >> document;
  const test::TempFolder folder;
  int seen = 0;
  for (std::size_t node = 0; node < document["nodes"].size(); ++node) {
    if (!document["nodes"][node].contains("mesh")) continue;
    const std::string name = document["nodes"][node]["name"];
    CAPTURE(name);
    document["scenes"][0]["nodes"] = {node};
    const ReadScene found = read_scene(write_bytes(folder, "s.gltf", document.dump()), 15);
    CHECK(found.info.is_linear == (name != "scale_f32"));
    const auto degree =
        name.starts_with("sh_degree") ? static_cast<unsigned>(name.back() - '0') : 0;
    CHECK(found.info.sh_degree == degree);
    CHECK(found.rows.splats.size() + found.count(store::SplatFilter::transparent) ==
          found.info.splats);
    ++seen;
  }
  CHECK(seen == 15);
}

}  // namespace
}  // namespace pounce::io
