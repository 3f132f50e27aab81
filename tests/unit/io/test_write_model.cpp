// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>

#include "unit/io/model_target.h"

using namespace pounce;
using namespace pounce::test;
using nlohmann::json;

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
