// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>
#include <fstream>

#include "io/read_mesh.h"
#include "support/gltf_builder.h"
#include "support/test_data.h"

using namespace pounce;
using nlohmann::json;
using test::GltfBuilder;
using test::TempFolder;

namespace {

const std::string kPngHead = "\x89PNG\r\n\x1a\n and the rest";

mesh::Mesh read(const GltfBuilder& builder) {
  const TempFolder folder;
  return io::read_mesh(builder.write(folder.file("m.gltf")));
}

GltfBuilder textured(const json& texture_info) {
  GltfBuilder b;
  auto& primitive = b.triangle();
  primitive["attributes"]["TEXCOORD_0"] = b.add<float>({0, 0, 1, 0, 0, 1}, "VEC2");
  primitive["attributes"]["TEXCOORD_1"] = b.add<float>({0, 0, 1, 0, 0, 1}, "VEC2");
  primitive["material"] = 0;
  b.doc["images"] = {{{"uri", "data:image/png;base64," + test::base64(kPngHead)}}};
  b.doc["textures"] = {{{"source", 0}}};
  b.doc["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", texture_info}}}}};
  return b;
}

const mesh::TextureBinding& base_color(const mesh::Mesh& m) {
  const auto& binding = m.materials.at(0).textures[static_cast<std::size_t>(Channel::base_color)];
  REQUIRE(binding.has_value());
  return *binding;
}

Vec2d apply(const mesh::UvTransform& t, double u, double v) {
  return {t.a * u + t.b * v + t.c, t.d * u + t.e * v + t.f};
}

std::string bytes_of(const mesh::ImageRef& image) {
  if (image.bytes != nullptr) {
    return {reinterpret_cast<const char*>(image.bytes->data()) + image.offset_bytes,
            image.size_bytes != 0 ? image.size_bytes : image.bytes->size()};
  }
  std::ifstream file(image.path, std::ios::binary);
  file.seekg(static_cast<std::streamoff>(image.offset_bytes));
  std::string out(image.size_bytes, '\0');
  file.read(out.data(), static_cast<std::streamsize>(out.size()));
  return out;
}

}  // namespace

TEST_CASE("every channel is bound with its factor, UV set and image", "[io]") {
  GltfBuilder b = textured({{"index", 0}, {"texCoord", 1}});
  b.doc["images"].push_back({{"uri", "data:image/jpeg;base64,AAAA"}});
  b.doc["textures"].push_back({{"source", 1}});
  auto& material = b.doc["materials"][0];
  material["name"] = "skin";
  material["doubleSided"] = true;
  material["pbrMetallicRoughness"]["baseColorFactor"] = {.5, .25, 1, .75};
  material["pbrMetallicRoughness"]["metallicFactor"] = .125;
  material["pbrMetallicRoughness"]["roughnessFactor"] = .5;
  material["pbrMetallicRoughness"]["metallicRoughnessTexture"] = {{"index", 1}};
  material["occlusionTexture"] = {{"index", 1}, {"texCoord", 1}, {"strength", .25}};
  material["extensions"]["KHR_materials_emissive_strength"] = {{"emissiveStrength", 4}};
  material["emissiveTexture"] = {{"index", 0}};
  material["emissiveFactor"] = {1, .5, 0};
  material["normalTexture"] = {{"index", 1}, {"texCoord", 1}, {"scale", .75}};
  const mesh::Mesh m = read(b);
  REQUIRE(m.materials.size() == 1);
  const mesh::Material& out = m.materials[0];
  CHECK(out.name == "skin");
  CHECK(out.double_sided);
  const std::array<std::uint32_t, 5> images{0, 1, 1, 0, 1}, sets{1, 0, 1, 0, 1};
  for (std::size_t c = 0; c < images.size(); ++c) {
    REQUIRE(out.textures[c].has_value());
    CHECK(out.textures[c]->image == images[c]);
    CHECK(out.textures[c]->uv_set == sets[c]);
    CHECK(out.textures[c]->transform == mesh::UvTransform{});
  }
  CHECK(out.factors[0] == std::array<float, 4>{.5F, .25F, 1, .75F});
  CHECK(out.factors[1] == std::array<float, 4>{0, .5F, .125F, 1});
  CHECK(out.factors[2] == std::array<float, 4>{1, 1, 1, 1});
  CHECK(out.factors[3] == std::array<float, 4>{1, .5F, 0, 1});
  CHECK(out.factors[4] == std::array<float, 4>{.75F, .75F, 1, 1});
  CHECK(out.occlusion_strength == .25F);
  CHECK(out.emissive_strength == 4);
  CHECK(m.images.at(0).mime_type == "image/png");
  CHECK(bytes_of(m.images.at(0)) == kPngHead);
}

TEST_CASE("KHR_texture_transform scales, turns and moves, in this order", "[io]") {
  const double quarter = 1.5707963267948966;
  SECTION("90 degrees with offset (0, 1) and scale 0.5 shows the lower left quarter") {
    const mesh::Mesh m =
        read(textured({{"index", 0},
                       {"extensions",
                        {{"KHR_texture_transform",
                          {{"offset", {0, 1}}, {"rotation", quarter}, {"scale", {.5, .5}}}}}}}));
    const mesh::UvTransform t = base_color(m).transform;
    CHECK(t == mesh::UvTransform{0, .5, 0, -.5, 0, 1});
    CHECK(apply(t, 0, 0) == Vec2d{0, 1});   // lower left corner of the image (v down)
    CHECK(apply(t, 1, 0) == Vec2d{0, .5});  // counter-clockwise: u points up the image
    CHECK(apply(t, 0, 1) == Vec2d{.5, 1});
  }
  SECTION("unequal scales apply before the turn") {
    const mesh::Mesh m = read(textured(
        {{"index", 0},
         {"extensions", {{"KHR_texture_transform", {{"rotation", quarter}, {"scale", {2, 3}}}}}}}));
    const mesh::UvTransform t = base_color(m).transform;
    CHECK(apply(t, 1, 0) == Vec2d{0, -2});
    CHECK(apply(t, 0, 1) == Vec2d{3, 0});
  }
  SECTION("its texCoord wins") {
    const mesh::Mesh m = read(textured(
        {{"index", 0},
         {"texCoord", 0},
         {"extensions", {{"KHR_texture_transform", {{"offset", {.25, 0}}, {"texCoord", 1}}}}}}));
    CHECK(base_color(m).uv_set == 1);
    CHECK(apply(base_color(m).transform, 0, 0) == Vec2d{.25, 0});
  }
}

TEST_CASE("samplers give the wrap modes; without one textures repeat", "[io]") {
  GltfBuilder b = textured({{"index", 0}});
  CHECK(base_color(read(b)).wrap_u == mesh::Wrap::repeat);
  b.doc["samplers"] = {{{"wrapS", 33071}, {"wrapT", 33648}}};
  b.doc["textures"][0]["sampler"] = 0;
  const mesh::Mesh m = read(b);
  CHECK(base_color(m).wrap_u == mesh::Wrap::clamp);
  CHECK(base_color(m).wrap_v == mesh::Wrap::mirror);
}

TEST_CASE("an image inside a GLB is a range of the file", "[io]") {
  const TempFolder folder;
  GltfBuilder b = textured({{"index", 0}});
  const int view = b.view(kPngHead);
  b.doc["images"][0] = {{"bufferView", view}, {"mimeType", "image/png"}, {"name", "skin"}};
  const mesh::Mesh m = io::read_mesh(b.write_glb(folder.file("head.glb")));
  const mesh::ImageRef& image = m.images.at(0);
  CHECK(image.path == folder.file("head.glb"));
  CHECK(image.size_bytes == kPngHead.size());
  CHECK(image.label == "head.glb image 0 \"skin\"");
  CHECK(bytes_of(image) == kPngHead);
  // The same in a .gltf with a data URI: in memory.
  const mesh::Mesh inlined = io::read_mesh(b.write(folder.file("head.gltf")));
  CHECK(bytes_of(inlined.images.at(0)) == kPngHead);
}

TEST_CASE("a missing image file is told, not thrown", "[io]") {
  const TempFolder folder;
  GltfBuilder b = textured({{"index", 0}});
  b.doc["images"][0] = {{"uri", "no%20such.png"}};
  const std::string path = b.write(folder.file("m.gltf"));
  CHECK_THAT(io::read_mesh(path).images.at(0).problem, Catch::Contains("missing"));
  test::write_file(folder.file("no such.png"), kPngHead);
  const mesh::Mesh m = io::read_mesh(path);
  CHECK(m.images.at(0).problem.empty());
  CHECK_FALSE(m.images.at(0).missing);
  CHECK(m.images.at(0).path == folder.file("no such.png"));
  CHECK(m.images.at(0).size_bytes == 0);
}

TEST_CASE("a texture of an unsupported format falls back to its plain image", "[io]") {
  const std::string name = GENERATE("KHR_texture_basisu", "EXT_texture_webp");
  GltfBuilder b = textured({{"index", 0}});
  b.doc["images"].push_back({{"uri", "data:image/x;base64,AAAA"}});
  b.doc["textures"][0]["extensions"] = {{name, {{"source", 1}}}};
  CHECK(base_color(read(b)).image == 0);
  b.doc["textures"][0].erase("source");
  const mesh::Mesh m = read(b);
  CHECK(base_color(m).image == 1);
  if (name == "EXT_texture_webp") {
    CHECK(m.images[1].problem.empty());  // read as any WebP is
  } else {
    CHECK_THAT(m.images[1].problem, Catch::Contains(name) && Catch::Contains("KTX2 textures"));
  }
}

TEST_CASE("colour kept in specular-glossiness is absent, with a warning", "[io]") {
  GltfBuilder b = textured({{"index", 0}});
  b.doc["extensionsRequired"] = {"KHR_materials_pbrSpecularGlossiness"};
  b.doc["materials"][0] = {
      {"extensions",
       {{"KHR_materials_pbrSpecularGlossiness", {{"diffuseTexture", {{"index", 0}}}}}}}};
  const mesh::Mesh m = read(b);
  CHECK_FALSE(m.materials[0].textures[0].has_value());
  REQUIRE(m.warnings.size() == 1);
  CHECK_THAT(m.warnings[0], Catch::Contains("KHR_materials_pbrSpecularGlossiness"));
}

TEST_CASE("primitives keep their own materials, whose names are unique and never empty", "[io]") {
  GltfBuilder b;
  b.triangle()["material"] = 2;
  b.triangle()["material"] = 1;
  b.triangle();
  b.doc["materials"] = {{{"name", "default"}}, json::object(), {{"name", "default"}}};
  const mesh::Mesh m = read(b);
  CHECK(m.triangle_material == std::vector<std::uint32_t>{2, 1, 3});
  std::vector<std::string> names;
  for (const auto& material : m.materials) names.push_back(material.name);
  CHECK(names == std::vector<std::string>{"default", "material_1", "default_2", "default_3"});
}

TEST_CASE("a texture on a UV set that no primitive has is left out with a warning", "[io]") {
  const mesh::Mesh m = read(textured({{"index", 0}, {"texCoord", 5}}));
  CHECK_FALSE(m.materials[0].textures[0].has_value());
  REQUIRE(m.warnings.size() == 1);
  CHECK_THAT(m.warnings[0], Catch::Contains("TEXCOORD_5"));
}
