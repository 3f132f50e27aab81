// SPDX-License-Identifier: Apache-2.0
#include <sys/resource.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <filesystem>

#include "io/read_mesh.h"
#include "io/write_model.h"
#include "pounce/error.h"
#include "support/gltf_builder.h"
#include "support/model_files.h"
#include "support/test_data.h"

using namespace pounce;
using Catch::Matchers::Contains;
using nlohmann::json;
using test::FakeImages;
using test::Glb;
using test::GltfBuilder;
using test::TempFolder;

namespace {

const std::string kOldImage = "\x89PNG\r\n\x1a\n" + std::string(93, 'o');
const std::string kNewImage = "\x89PNG\r\n\x1a\n" + std::string(50, 'n');
const std::string kOther = "\x89PNG\r\n\x1a\n" + std::string(33, 'x');

/// A triangle with UVs, one material and its baseColor image in the buffer, in front of the UVs.
GltfBuilder textured() {
  GltfBuilder b;
  auto& primitive = b.triangle();
  const int image = b.view(kOldImage);
  primitive["attributes"]["TEXCOORD_0"] = b.add<float>({0, 0, 1, 0, 0, 1}, "VEC2");
  primitive["material"] = 0;
  b.doc["images"] = {{{"bufferView", image}, {"mimeType", "image/png"}}};
  b.doc["textures"] = {{{"source", 0}, {"sampler", 0}}};
  b.doc["samplers"] = {{{"wrapS", 33071}}};
  b.doc["materials"] = {{{"name", "skin"},
                         {"alphaMode", "BLEND"},
                         {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
  return b;
}

io::ModelTexture base_color(std::uint32_t material) {
  return {material, Channel::base_color, {1, 1, 1, 1}, ""};
}

/// Writes `builder` with these textures (their images: kNewImage and numbers) as a .glb.
Glb written(const TempFolder& folder, const GltfBuilder& builder,
            std::vector<io::ModelTexture> textures, std::uint32_t uv_set = 0) {
  const io::ModelRequest request{builder.write_glb(folder.file("target.glb")),
                                 folder.file("out.glb"), uv_set, textures};
  std::vector<std::string> images;
  for (std::size_t k = 0; k < textures.size(); ++k) images.push_back(kNewImage + std::to_string(k));
  FakeImages(images).write(request);
  io::read_mesh(request.output);  // is valid
  return Glb(request.output);
}

std::string geometry(const mesh::Mesh& m) {
  std::string all;
  const auto add = [&](const auto& values) {
    all.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(values[0]));
  };
  add(m.positions), add(m.normals), add(m.tangents), add(m.triangles), add(m.triangle_material);
  for (const auto& set : m.uv_sets) add(set);
  return all;
}

}  // namespace

TEST_CASE("a new texture takes the place of the one it replaces", "[model]") {
  const TempFolder folder;
  const GltfBuilder target = textured();
  const Glb out = written(folder, target, {base_color(0)});
  CHECK(out.doc["textures"].size() == 1);
  CHECK(out.doc["images"].size() == 1);
  CHECK(out.doc["bufferViews"].size() == target.doc["bufferViews"].size());
  const auto& material = out.doc["materials"][0];
  CHECK(out.shown(material["pbrMetallicRoughness"]["baseColorTexture"]) == kNewImage + "0");
  CHECK(out.doc["images"][0]["mimeType"] == "image/png");
  CHECK_FALSE(out.doc["textures"][0].contains("sampler"));  // UVs repeat
  CHECK(material["alphaMode"] == "BLEND");
  CHECK(out.text.find("oooo") == std::string::npos);
  CHECK(out.bin.find("oooooooooooooooo") == std::string::npos);  // at most 15 bytes of it stay
  CHECK(geometry(io::read_mesh(folder.file("out.glb"))) ==
        geometry(io::read_mesh(folder.file("target.glb"))));
}

TEST_CASE("what somebody else uses stays", "[model]") {
  const TempFolder folder;
  GltfBuilder target = textured();
  SECTION("another channel uses the texture") {
    target.doc["materials"][0]["emissiveTexture"] = {{"index", 0}};
    const Glb out = written(folder, target, {base_color(0)});
    CHECK(out.shown(out.doc["materials"][0]["emissiveTexture"]) == kOldImage);
    CHECK(out.shown(out.doc["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]) ==
          kNewImage + "0");
    CHECK(out.doc["textures"].size() == 2);
  }
  SECTION("another texture uses the image") {
    target.doc["textures"].push_back({{"source", 0}});
    target.doc["materials"][0]["normalTexture"] = {{"index", 1}, {"scale", 0.5}};
    const Glb out = written(folder, target, {base_color(0)});
    CHECK(out.shown(out.doc["materials"][0]["normalTexture"]) == kOldImage);
    CHECK(out.doc["textures"].size() == 2);
    CHECK(out.doc["images"].size() == 2);
  }
  SECTION("an accessor uses the buffer view") {
    target.doc["accessors"].push_back({{"bufferView", target.doc["images"][0]["bufferView"]},
                                       {"componentType", 5121},
                                       {"count", 3},
                                       {"type", "SCALAR"}});
    const Glb out = written(folder, target, {base_color(0)});
    CHECK(out.view(out.doc["accessors"].back()["bufferView"]) == kOldImage);
  }
  SECTION("a view of other bytes of the image") {
    target.doc["bufferViews"].push_back(
        {{"buffer", 0},
         {"byteOffset", target.doc["bufferViews"][2]["byteOffset"].get<int>() + 40},
         {"byteLength", 8}});
    const Glb out = written(folder, target, {base_color(0)});
    CHECK(out.view(out.doc["bufferViews"].size() - 1) == kOldImage.substr(40, 8));
  }
  SECTION("an extension of which nothing is known holds its number") {
    target.doc["extensions"] = {{"VRM", {{"meta", {{"picture", 0}}}}}};
    target.doc["extensionsUsed"] = {"VRM"};
    const Glb out = written(folder, target, {base_color(0)});
    CHECK(out.image(0) == kOldImage);
    CHECK(out.doc["textures"][0] == json{{"source", 0}, {"sampler", 0}});
    CHECK(out.doc["extensions"]["VRM"]["meta"]["picture"] == 0);
  }
  SECTION("an extension of Khronos holds a number that is no reference") {
    target.doc["materials"][0]["extensions"] = {
        {"KHR_materials_clearcoat", {{"clearcoatFactor", 0}}}};
    target.doc["extensionsUsed"] = {"KHR_materials_clearcoat"};
    const Glb out = written(folder, target, {base_color(0)});
    CHECK(out.doc["images"].size() == 1);
    CHECK(out.doc["materials"][0]["extensions"]["KHR_materials_clearcoat"]["clearcoatFactor"] == 0);
  }
  SECTION("an extension of Khronos shows the texture") {
    target.doc["materials"][0]["extensions"] = {
        {"KHR_materials_clearcoat", {{"clearcoatTexture", {{"index", 0}}}}}};
    target.doc["extensionsUsed"] = {"KHR_materials_clearcoat"};
    const Glb out = written(folder, target, {base_color(0)});
    CHECK(
        out.shown(
            out.doc["materials"][0]["extensions"]["KHR_materials_clearcoat"]["clearcoatTexture"]) ==
        kOldImage);
  }
}

TEST_CASE("one image per material and channel", "[model]") {
  const TempFolder folder;
  GltfBuilder target = textured();
  // Two materials, one texture for both and for two channels.
  target.doc["materials"][0]["occlusionTexture"] = {{"index", 0}, {"strength", 0.5}};
  target.doc["materials"][0]["pbrMetallicRoughness"]["metallicRoughnessTexture"] = {{"index", 0}};
  target.doc["materials"].push_back(target.doc["materials"][0]);
  const auto primitive = target.doc["meshes"][0]["primitives"][0];
  target.doc["meshes"][0]["primitives"].push_back(primitive);
  target.doc["meshes"][0]["primitives"][1]["material"] = 1;
  std::vector<io::ModelTexture> textures;
  for (const std::uint32_t material : {0U, 1U}) {
    textures.push_back({material, Channel::base_color, {0.5F, 1, 1, 1}, ""});
    textures.push_back({material, Channel::metallic_roughness, {0, 0.25F, 0.75F, 1}, ""});
    textures.push_back({material, Channel::occlusion, {0.125F, 1, 1, 1}, ""});
    textures.push_back({material, Channel::emissive, {1, 0.5F, 0.1F, 3}, ""});
  }
  const Glb out = written(folder, target, textures);
  CHECK(out.doc["images"].size() == 8);
  CHECK(out.bin.find(std::string(16, 'o')) == std::string::npos);
  for (std::size_t m = 0; m < 2; ++m) {
    const auto& material = out.doc["materials"][m];
    const auto& pbr = material["pbrMetallicRoughness"];
    const auto name = [&](int k) {
      return kNewImage + std::to_string(4 * m + static_cast<std::size_t>(k));
    };
    CHECK(out.shown(pbr["baseColorTexture"]) == name(0));
    CHECK(pbr["baseColorFactor"] == json({0.5, 1, 1, 1}));
    CHECK(out.shown(pbr["metallicRoughnessTexture"]) == name(1));
    CHECK(pbr["roughnessFactor"] == 0.25);
    CHECK(pbr["metallicFactor"] == 0.75);
    CHECK(out.shown(material["occlusionTexture"]) == name(2));
    CHECK(material["occlusionTexture"]["strength"] == 0.125);
    CHECK(out.shown(material["emissiveTexture"]) == name(3));
    CHECK(material["emissiveFactor"] == json({1, 0.5, 0.1}));
    CHECK(material["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"] == 3);
  }
  CHECK(out.doc["extensionsUsed"] == json({"KHR_materials_emissive_strength"}));
}

TEST_CASE("factors of 1 leave nothing of the target's", "[model]") {
  const TempFolder folder;
  GltfBuilder target = textured();
  auto& material = target.doc["materials"][0];
  material["pbrMetallicRoughness"].update(
      {{"baseColorFactor", {0.5, 0.5, 0.5, 1}}, {"metallicFactor", 0}, {"roughnessFactor", 0.5}});
  material["extensions"]["KHR_materials_emissive_strength"] = {{"emissiveStrength", 9}};
  target.doc["extensionsUsed"] = {"KHR_materials_emissive_strength"};
  const Glb out = written(folder, target,
                          {base_color(0),
                           {0, Channel::metallic_roughness, {1, 1, 1, 1}, ""},
                           {0, Channel::emissive, {1, 1, 1, 1}, ""}});
  const auto& after = out.doc["materials"][0];
  CHECK(after["pbrMetallicRoughness"].size() == 2);
  CHECK(after["emissiveFactor"] == json({1, 1, 1}));
  CHECK_FALSE(after.contains("extensions"));
  CHECK_FALSE(out.doc.contains("extensionsUsed"));
}

TEST_CASE("the new texture shows on the chosen UV set, without a transform", "[model]") {
  const TempFolder folder;
  GltfBuilder target = textured();
  auto& primitive = target.doc["meshes"][0]["primitives"][0];
  primitive["attributes"]["TEXCOORD_1"] = primitive["attributes"]["TEXCOORD_0"];
  auto& info = target.doc["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"];
  info["texCoord"] = 3;
  info["extras"] = {{"note", 1.50}};
  info["extensions"] = {{"KHR_texture_transform", {{"scale", {2, 2}}, {"texCoord", 1}}}};
  SECTION("the first") {
    const Glb out = written(folder, target, {base_color(0)}, 0);
    CHECK(out.doc["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] ==
          json{{"index", 0}, {"extras", {{"note", 1.5}}}});
  }
  SECTION("another") {
    const Glb out = written(folder, target, {base_color(0)}, 1);
    CHECK(out.doc["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] ==
          json{{"index", 0}, {"texCoord", 1}, {"extras", {{"note", 1.5}}}});
  }
}

TEST_CASE("primitives without a material get one", "[model]") {
  const TempFolder folder;
  GltfBuilder target = textured();
  target.doc["meshes"][0]["primitives"][0].erase("material");
  target.doc["meshes"][0]["primitives"][0]["mode"] = 4;
  auto points = target.doc["meshes"][0]["primitives"][0];
  points["mode"] = 0;
  target.doc["meshes"][0]["primitives"].push_back(points);
  auto bare = target.doc["meshes"][0]["primitives"][0];
  bare["attributes"].erase("TEXCOORD_0");
  target.doc["meshes"][0]["primitives"].push_back(bare);
  const Glb out = written(folder, target, {base_color(1)});
  REQUIRE(out.doc["materials"].size() == 2);
  CHECK(out.doc["materials"][1]["name"] == "default");
  CHECK(out.doc["materials"][1]["pbrMetallicRoughness"]["metallicFactor"] == 0);
  CHECK(out.shown(out.doc["materials"][1]["pbrMetallicRoughness"]["baseColorTexture"]) ==
        kNewImage + "0");
  const auto& primitives = out.doc["meshes"][0]["primitives"];
  CHECK(primitives[0]["material"] == 1);
  CHECK_FALSE(primitives[1].contains("material"));
  CHECK_FALSE(primitives[2].contains("material"));
  CHECK(out.image(0) == kOldImage);  // of a material that nothing shows
}

TEST_CASE("primitives that lack the UVs keep the material as it was", "[model]") {
  const TempFolder folder;
  GltfBuilder target = textured();
  auto bare = target.doc["meshes"][0]["primitives"][0];
  bare["attributes"].erase("TEXCOORD_0");
  target.doc["meshes"][0]["primitives"].push_back(bare);
  target.doc["materials"].push_back({{"name", "last"}});
  const Glb out = written(folder, target, {base_color(0)});
  REQUIRE(out.doc["materials"].size() == 3);
  CHECK(out.doc["meshes"][0]["primitives"][0]["material"] == 0);
  CHECK(out.doc["meshes"][0]["primitives"][1]["material"] == 2);
  CHECK(out.doc["materials"][2] == json(target.doc["materials"][0]));
  CHECK(out.shown(out.doc["materials"][2]["pbrMetallicRoughness"]["baseColorTexture"]) ==
        kOldImage);
  CHECK(out.shown(out.doc["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]) ==
        kNewImage + "0");
}

TEST_CASE("specular-glossiness materials show the new texture everywhere", "[model]") {
  const TempFolder folder;
  const char* const kGlossy = "KHR_materials_pbrSpecularGlossiness";
  GltfBuilder target = textured();
  const int shine = target.view(kOther);
  target.doc["images"].push_back({{"bufferView", shine}, {"mimeType", "image/png"}});
  target.doc["textures"].push_back({{"source", 1}});
  target.doc["materials"][0].erase("pbrMetallicRoughness");
  target.doc["materials"][0]["extensions"] = {{kGlossy,
                                               {{"diffuseTexture", {{"index", 0}}},
                                                {"diffuseFactor", {0.5, 0.5, 0.5, 1}},
                                                {"specularGlossinessTexture", {{"index", 1}}}}}};
  target.doc["extensionsUsed"] = {kGlossy, "KHR_lights_punctual"};
  target.doc["extensionsRequired"] = {kGlossy};
  const io::ModelTexture metal{0, Channel::metallic_roughness, {1, 1, 1, 1}, ""};
  SECTION("a new baseColor is the diffuse texture, too") {
    const Glb out = written(folder, target, {base_color(0)});
    const auto& material = out.doc["materials"][0];
    CHECK(out.shown(material["pbrMetallicRoughness"]["baseColorTexture"]) == kNewImage + "0");
    CHECK(out.shown(material["extensions"][kGlossy]["diffuseTexture"]) == kNewImage + "0");
    CHECK_FALSE(material["extensions"][kGlossy].contains("diffuseFactor"));
    CHECK(out.shown(material["extensions"][kGlossy]["specularGlossinessTexture"]) == kOther);
    CHECK(out.doc["extensionsRequired"] == json({kGlossy}));
    CHECK(out.doc["images"].size() == 2);
  }
  SECTION("with a new metallicRoughness it is an ordinary material") {
    const Glb out = written(folder, target, {base_color(0), metal});
    const auto& material = out.doc["materials"][0];
    CHECK(out.shown(material["pbrMetallicRoughness"]["baseColorTexture"]) == kNewImage + "0");
    CHECK(out.shown(material["pbrMetallicRoughness"]["metallicRoughnessTexture"]) ==
          kNewImage + "1");
    CHECK_FALSE(material.contains("extensions"));
    CHECK(out.doc["extensionsUsed"] == json({"KHR_lights_punctual"}));
    CHECK_FALSE(out.doc.contains("extensionsRequired"));
    CHECK(out.doc["images"].size() == 2);
  }
  SECTION("a new metallicRoughness alone keeps the diffuse texture as baseColor") {
    const Glb out = written(folder, target, {metal});
    const auto& pbr = out.doc["materials"][0]["pbrMetallicRoughness"];
    CHECK(out.shown(pbr["baseColorTexture"]) == kOldImage);
    CHECK(pbr["baseColorFactor"] == json({0.5, 0.5, 0.5, 1}));
    CHECK(out.shown(pbr["metallicRoughnessTexture"]) == kNewImage + "0");
  }
}

TEST_CASE("what is not edited keeps every byte of its JSON", "[model]") {
  const TempFolder folder;
  GltfBuilder target = textured();
  target.write_glb(folder.file("plain.glb"));
  std::string text = Glb(folder.file("plain.glb")).text;
  while (text.back() == ' ') text.pop_back();
  const std::string odd =
      "\"extras\" : { \"big\": 18446744073709551617, \"f\":0.10, \"e\":1E+2, \"n\": -0,\n "
      "\"u\":\"\\u00e9\"}";
  const std::string camera =
      "\"cameras\":[ {\"type\":\"perspective\",\"perspective\":{\"yfov\":0.50,\"znear\":1e-2}} ]";
  text.insert(1, odd + "," + camera + ",");
  test::write_file(folder.file("target.gltf"), text);
  json document = json::parse(text);
  test::write_file(folder.file("data.bin"), target.buffer);
  text.replace(text.find("\"byteLength\":" + std::to_string(target.buffer.size()) + "}]"), 0,
               "\"uri\":\"data.bin\",");
  test::write_file(folder.file("target.gltf"), text);
  for (const char* name : {"out.glb", "out.gltf"}) {
    const io::ModelRequest request{
        folder.file("target.gltf"),
        folder.file(name),
        0,
        {{0, Channel::base_color, {1, 1, 1, 1}, folder.file("out.skin.png")}}};
    FakeImages({kNewImage}).write(request);
    const std::string out = test::file_bytes(folder.file(name));
    CHECK_THAT(out, Contains(odd));
    CHECK_THAT(out, Contains(camera));
    CHECK(geometry(io::read_mesh(folder.file(name))) ==
          geometry(io::read_mesh(folder.file("target.gltf"))));
  }
  CHECK(test::file_bytes(folder.file("out.skin.png")) == kNewImage);
  const json out = json::parse(test::file_bytes(folder.file("out.gltf")));
  CHECK(out["images"][0]["uri"] == "out.skin.png");
  CHECK(out["buffers"][0]["uri"] == "out.bin");
  CHECK(out["buffers"][0]["byteLength"] == std::filesystem::file_size(folder.file("out.bin")));
  CHECK(test::file_bytes(folder.file("out.bin")).find(std::string(16, 'o')) == std::string::npos);
}

TEST_CASE("a .glb takes in buffers and images that are files", "[model]") {
  const TempFolder folder;
  GltfBuilder target = textured();
  // Buffer 0 a file of 37 bytes, buffer 1 the builder's own as a data URI.
  json document = target.doc;
  document["buffers"] = {
      {{"byteLength", 37}, {"uri", "some%20file.bin"}, {"name", "first"}},
      {{"byteLength", target.buffer.size()},
       {"uri", "data:application/octet-stream;base64," + test::base64(target.buffer)}}};
  for (auto& view : document["bufferViews"]) view["buffer"] = 1;
  document["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", 4}, {"byteLength", 20}});
  document["images"].push_back({{"uri", "old.png"}, {"name", "kept"}});
  document["textures"].push_back({{"source", 1}});
  document["materials"][0]["normalTexture"] = {{"index", 1}};
  const std::string first = "0123456789abcdefghijklmnopqrstuvwxyz!";
  test::write_file(folder.file("some file.bin"), first);
  test::write_file(folder.file("old.png"), kOther);
  test::write_file(folder.file("target.gltf"), document.dump());
  io::ModelRequest request{folder.file("target.gltf"), folder.file("out.glb"), 0, {base_color(0)}};
  SECTION("into a .glb") {
    const io::ModelPlan plan = io::plan_model(request);
    CHECK(plan.outputs == std::vector<std::string>{request.output});
    CHECK(plan.inputs == std::vector<std::string>{folder.file("some file.bin"), request.target,
                                                  folder.file("old.png")});
    FakeImages({kNewImage}).write(request);
    const Glb out(request.output);
    REQUIRE(out.doc["buffers"].size() == 1);
    CHECK(out.doc["buffers"][0]["name"] == "first");
    CHECK_FALSE(out.doc["buffers"][0].contains("uri"));
    CHECK(out.view(document["bufferViews"].size() - 1) == first.substr(4, 20));
    CHECK(out.shown(out.doc["materials"][0]["normalTexture"]) == kOther);
    CHECK(out.doc["images"][1]["name"] == "kept");
    CHECK(out.doc["images"][1]["mimeType"] == "image/png");
    for (const auto& view : out.doc["bufferViews"]) CHECK(view.value("byteOffset", 0) % 4 == 0);
  }
  SECTION("as files beside a .gltf") {
    request.output = folder.file("an out.gltf");
    request.textures[0].path = folder.file("an out.skin.baseColor.png");
    const io::ModelPlan plan = io::plan_model(request);
    CHECK(plan.outputs ==
          std::vector<std::string>{request.textures[0].path, folder.file("an out.bin"),
                                   folder.file("an out.image1.png"), request.output});
    FakeImages({kNewImage}).write(request);
    for (const std::string& path : plan.outputs) CHECK(std::filesystem::exists(path));
    const json out = json::parse(test::file_bytes(request.output));
    CHECK(out["buffers"][0]["uri"] == "an%20out.bin");
    CHECK(out["buffers"][1] == document["buffers"][1]);
    CHECK(out["images"][0]["uri"] == "an%20out.skin.baseColor.png");
    CHECK(out["images"][1]["uri"] == "an%20out.image1.png");
    CHECK(test::file_bytes(folder.file("an out.bin")) == first);
    CHECK(test::file_bytes(folder.file("an out.image1.png")) == kOther);
  }
  CHECK(geometry(io::read_mesh(request.output)) == geometry(io::read_mesh(request.target)));
}

TEST_CASE("a missing image is named as before, a missing buffer ends it", "[model]") {
  const TempFolder folder;
  GltfBuilder target = textured();
  target.doc["images"].push_back({{"uri", "gone.png"}});
  target.write(folder.file("target.gltf"));
  io::ModelRequest request{folder.file("target.gltf"), folder.file("out.glb"), 0, {base_color(0)}};
  const io::ModelPlan plan = io::plan_model(request);
  REQUIRE(plan.warnings.size() == 1);
  CHECK_THAT(plan.warnings[0], Contains("gone.png is not there"));
  FakeImages({kNewImage}).write(request);
  CHECK(Glb(request.output).doc["images"][1]["uri"] == "gone.png");

  json document = json::parse(test::file_bytes(request.target));
  document["buffers"].push_back({{"byteLength", 4}, {"uri", "gone.bin"}});
  test::write_file(request.target, document.dump());
  CHECK_THROWS_WITH(io::plan_model(request), Contains("buffer 1 is the file \"gone.bin\""));
}

TEST_CASE("unknown chunks of a GLB stay in a .glb", "[model]") {
  const TempFolder folder;
  const GltfBuilder target = textured();
  std::string bytes = test::file_bytes(target.write_glb(folder.file("target.glb")));
  const std::string chunk("\5\0\0\0XTRAhello", 13);
  bytes += chunk;
  const auto length = static_cast<std::uint32_t>(bytes.size());
  std::memcpy(bytes.data() + 8, &length, 4);
  test::write_file(folder.file("target.glb"), bytes);
  io::ModelRequest request{folder.file("target.glb"), folder.file("out.glb"), 0, {base_color(0)}};
  FakeImages({kNewImage}).write(request);
  const Glb out(request.output);
  REQUIRE(out.others.size() == 1);
  CHECK(out.others[0].second == std::string("hello\0\0\0", 8));
  request.output = folder.file("out.gltf");
  request.textures[0].path = folder.file("out.png");
  const io::ModelPlan plan = io::plan_model(request);
  REQUIRE(plan.warnings.size() == 1);
  CHECK_THAT(plan.warnings[0], Contains("left out of a .gltf"));
}

TEST_CASE("compressed copies of geometry move with their buffers", "[model]") {
  const TempFolder folder;
  GltfBuilder target = textured();
  json document = target.doc;
  document["buffers"] = {{{"byteLength", 40}, {"uri", "packed.bin"}},
                         {{"byteLength", target.buffer.size()}, {"uri", "plain.bin"}}};
  for (auto& view : document["bufferViews"]) view["buffer"] = 1;
  document["bufferViews"][0]["extensions"] = {
      {"EXT_meshopt_compression",
       {{"buffer", 1}, {"byteOffset", 8}, {"byteLength", 8}, {"count", 1}}}};
  document["extensionsUsed"] = {"EXT_meshopt_compression"};
  test::write_file(folder.file("packed.bin"), std::string(40, 'p'));
  test::write_file(folder.file("plain.bin"), target.buffer);
  test::write_file(folder.file("target.gltf"), document.dump());
  const io::ModelRequest request{
      folder.file("target.gltf"), folder.file("out.glb"), 0, {base_color(0)}};
  FakeImages({kNewImage}).write(request);
  const Glb out(request.output);
  const auto& packed = out.doc["bufferViews"][0]["extensions"]["EXT_meshopt_compression"];
  CHECK(packed["buffer"] == 0);
  CHECK(packed["byteOffset"] == 48 + 8);  // 40 rounded up to 16
  CHECK(packed["count"] == 1);
  CHECK_THAT(out.bin, Contains("oooooooooooooooo"));  // nothing is left out here
}

TEST_CASE("an OBJ is no target for a model", "[model]") {
  const TempFolder folder;
  test::write_file(folder.file("t.obj"), "v 0 0 0\n");
  CHECK_THROWS_WITH(
      io::plan_model({folder.file("t.obj"), folder.file("o.glb"), 0, {base_color(0)}}),
      Contains("t.obj is neither") && Contains("convert the target"));
  CHECK(io::is_model_path("a.GLB"));
  CHECK(io::is_model_path("a.gltf"));
  CHECK_FALSE(io::is_model_path("a.glb.png"));
  CHECK_FALSE(io::is_model_path(".glb"));
}

TEST_CASE("a model that cannot be written leaves nothing", "[model]") {
  const TempFolder folder;
  GltfBuilder target = textured();
  target.view(std::string(1 << 20, 'b'));
  target.write_glb(folder.file("target.glb"));
  const auto count = [&] {
    return std::distance(std::filesystem::directory_iterator(folder.path()), {});
  };
  struct rlimit before {};
  getrlimit(RLIMIT_FSIZE, &before);
  struct rlimit small = before;
  small.rlim_cur = 1 << 19;
  std::signal(SIGXFSZ, SIG_IGN);
  setrlimit(RLIMIT_FSIZE, &small);
  for (const char* name : {"out.glb", "out.gltf"}) {
    const io::ModelRequest request{
        folder.file("target.glb"),
        folder.file(name),
        0,
        {{0, Channel::base_color, {1, 1, 1, 1}, folder.file("out.png")}}};
    CHECK_THROWS_WITH(FakeImages({kNewImage}).write(request), Contains("File too large"));
  }
  setrlimit(RLIMIT_FSIZE, &before);
  CHECK(count() == 1);
  // A folder stands where the model should be: the images that already have their names go again.
  std::filesystem::create_directory(folder.path() / "out.gltf");
  CHECK_THROWS(FakeImages({kNewImage})
                   .write({folder.file("target.glb"),
                           folder.file("out.gltf"),
                           0,
                           {{0, Channel::base_color, {1, 1, 1, 1}, folder.file("out.png")}}}));
  CHECK(count() == 2);
}
