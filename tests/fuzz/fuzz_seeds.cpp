// SPDX-License-Identifier: Apache-2.0
//
// Makes what the fuzz targets start from: fuzz_seeds FOLDER [TEST DATA]. In FOLDER one folder per
// target, and "packs" with the sound packs of two jobs.
#include <OpenImageIO/imageio.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <map>

#include "fuzz/image_seeds.h"
#include "pounce/transfer.h"
#include "support/gltf_builder.h"
#include "support/random_scene.h"
#include "support/splat_encoders.h"
#include "support/splat_ply_builder.h"

namespace pounce {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test::GltfBuilder;

void put(const fs::path& folder, const std::string& name, const std::string& bytes) {
  fs::create_directories(folder);
  test::write_file((folder / name).string(), bytes);
}

std::string bytes_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

// A PNG of one texel.
const std::string kPng(
    "\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\1\0\0\0\1\x08\0\0\0\0:~\x9bU\0\0\0\nIDATx\x01"
    "c`\0\0\0\2\0\1su\x01\x18\0\0\0\0IEND\xae"
    "B`\x82",
    67);

/// As fuzz_gltf takes it: JSON, and behind "%%" the buffer.
void put_gltf(const fs::path& folder, const std::string& name, const GltfBuilder& model) {
  json document = model.doc;
  document["buffers"] = json::array({{{"byteLength", model.buffer.size()}}});
  put(folder, name, document.dump() + "\n%%\n" + model.buffer);
  document["buffers"][0]["uri"] =
      "data:application/octet-stream;base64," + test::base64(model.buffer);
  put(folder, name + "-inline", document.dump());
}

const std::vector<float> kSquare{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
const std::vector<float> kSquareUvs{0, 0, 1, 0, 1, 1, 0, 1};
const std::vector<std::uint16_t> kSquareCorners{0, 1, 2, 0, 2, 3};

void add_textures(GltfBuilder& model) {
  model.push("images", {{"bufferView", model.view(kPng)}, {"mimeType", "image/png"}});
  model.push("images", {{"uri", "data:image/png;base64," + test::base64(kPng)}});
  model.push("images", {{"uri", "skin%20a.png"}});
  model.push("samplers", {{"wrapS", 33071}, {"wrapT", 33648}, {"magFilter", 9728}});
  for (int i = 0; i < 3; ++i) model.push("textures", {{"source", i}, {"sampler", 0}});
  model.push(
      "materials",
      {{"name", "skin"},
       {"doubleSided", true},
       {"alphaMode", "MASK"},
       {"alphaCutoff", 0.4},
       {"pbrMetallicRoughness",
        {{"baseColorFactor", {1, 0.5, 0.2, 1}},
         {"metallicFactor", 0.3},
         {"roughnessFactor", 0.9},
         {"baseColorTexture",
          {{"index", 0},
           {"extensions",
            {{"KHR_texture_transform",
              {{"offset", {0.5, 0.25}}, {"rotation", 0.3}, {"scale", {2, 2}}, {"texCoord", 1}}}}}}},
         {"metallicRoughnessTexture", {{"index", 1}, {"texCoord", 1}}}}},
       {"normalTexture", {{"index", 2}, {"scale", 2}}},
       {"occlusionTexture", {{"index", 1}, {"strength", 0.5}}},
       {"emissiveTexture", {{"index", 0}}},
       {"emissiveFactor", {0.1, 0.2, 0.3}},
       {"extensions",
        {{"KHR_materials_emissive_strength", {{"emissiveStrength", 3}}},
         {"KHR_materials_unlit", json::object()},
         {"KHR_materials_specular", {{"specularTexture", {{"index", 2}}}}}}}});
  model.doc["extensionsUsed"] = {"KHR_texture_transform", "KHR_materials_unlit"};
}

void gltf_seeds(const fs::path& folder) {
  {
    GltfBuilder model;
    model.triangle();
    put_gltf(folder, "triangle", model);
  }
  {
    GltfBuilder model;
    const int p = model.add(kSquare, "VEC3"), uv = model.add(kSquareUvs, "VEC2");
    const int uv1 =
        model.add<std::uint16_t>({0, 0, 65535, 0, 65535, 65535, 0, 65535}, "VEC2", true);
    const int tangents =
        model.add<float>({1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, -1, 1, 0, 0, 1}, "VEC4");
    const int colours = model.add<std::uint8_t>(std::vector<std::uint8_t>(16, 200), "VEC4", true);
    add_textures(model);
    model.primitive({{"POSITION", p},
                     {"TEXCOORD_0", uv},
                     {"TEXCOORD_1", uv1},
                     {"TANGENT", tangents},
                     {"COLOR_0", colours}},
                    model.add(kSquareCorners, "SCALAR"))["material"] = 0;
    model.doc["scene"] = 0;
    model.doc["scenes"] = json::array({{{"nodes", {0}}}});
    put_gltf(folder, "textured", model);
  }
  {
    GltfBuilder model;
    const int p = model.add(kSquare, "VEC3");
    const int joints =
        model.add<std::uint8_t>({0, 1, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0}, "VEC4");
    const int weights =
        model.add<float>({1, 0, 0, 0, .5, .5, 0, 0, 1, 0, 0, 0, .5, .5, 0, 0}, "VEC4");
    model.primitive({{"POSITION", p},
                     {"TEXCOORD_0", model.add(kSquareUvs, "VEC2")},
                     {"JOINTS_0", joints},
                     {"WEIGHTS_0", weights}},
                    model.add(kSquareCorners, "SCALAR"));
    std::vector<float> matrices(32, 0.0F);
    for (std::size_t i = 0; i < 32; i += i % 16 == 15 ? 1 : 5) matrices[i] = 1;
    model.doc["nodes"][0]["skin"] = 0;
    model.push("nodes", {{"name", "hip"}, {"children", {2}}, {"translation", {0, 1, 0}}});
    model.push("nodes", {{"name", "knee"}, {"rotation", {0, 0.6, 0, 0.8}}, {"scale", {1, -1, 1}}});
    model.push("skins", {{"joints", {1, 2}},
                         {"skeleton", 1},
                         {"inverseBindMatrices", model.add(matrices, "MAT4")}});
    model.doc["scenes"] = json::array({{{"nodes", {0, 1}}}, {{"nodes", {1}}}});
    put_gltf(folder, "skin", model);
  }
  {
    GltfBuilder model;
    json& primitive = model.triangle();
    const json targets =
        json::array({{{"POSITION", model.add<float>({0, 0, 1, 0, 0, 2, 0, 0, 0}, "VEC3")}},
                     {{"NORMAL", model.add<float>({1, 0, 0, 0, 0, 0, 0, 0, 0}, "VEC3")}}});
    primitive["targets"] = targets;
    primitive["attributes"]["TEXCOORD_0"] = model.add<float>({0, 0, 1, 0, 0, 1}, "VEC2");
    model.doc["meshes"][0]["weights"] = {0.5, 1};
    model.doc["meshes"][0]["name"] = "face";
    model.doc["nodes"][0]["weights"] = {1, 0.25};
    put_gltf(folder, "morph", model);
  }
  {
    GltfBuilder model;
    model.primitive({{"POSITION", model.add(kSquare, "VEC3")}},
                    model.add<std::uint8_t>({0, 1, 2}, "SCALAR"));
    const int indices = model.view(GltfBuilder::bytes_of<std::uint16_t>({0, 3}));
    const int values = model.view(GltfBuilder::bytes_of<float>({5, 0, 0, 0, 5, 0}));
    model.doc["accessors"][0]["sparse"] = {
        {"count", 2},
        {"indices", {{"bufferView", indices}, {"componentType", 5123}}},
        {"values", {{"bufferView", values}}}};
    put_gltf(folder, "sparse", model);
    model.doc["meshes"][0]["primitives"][0]["indices"] = model.push(
        "accessors",
        {{"componentType", 5125},
         {"count", 6},
         {"type", "SCALAR"},
         {"bufferView", model.view(GltfBuilder::bytes_of<std::uint32_t>({0, 1, 2, 3, 1, 0}))},
         {"sparse", model.doc["accessors"][0]["sparse"]}});
    model.doc["accessors"].back()["sparse"]["values"]["bufferView"] =
        model.view(GltfBuilder::bytes_of<std::uint32_t>({1, 1}));
    put_gltf(folder, "sparse-indices", model);
  }
  {
    GltfBuilder model;
    const int p = model.add<std::int16_t>({0, 0, 0, 0, 300, 0, 0, 0, 0, 300, 0, 0}, "VEC4");
    model.doc["accessors"][0]["type"] = "VEC3";
    model.doc["bufferViews"][0]["byteStride"] = 8;
    const int n = model.add<std::int8_t>({0, 0, 127, 0, 0, 0, 127, 0, 0, 0, 127, 0}, "VEC4", true);
    model.doc["accessors"][1]["type"] = "VEC3";
    model.doc["bufferViews"][1]["byteStride"] = 4;
    const int uv = model.add<std::uint16_t>({0, 0, 65535, 0, 0, 65535}, "VEC2", true);
    model.primitive({{"POSITION", p}, {"NORMAL", n}, {"TEXCOORD_0", uv}});
    model.doc["extensionsUsed"] = model.doc["extensionsRequired"] = {"KHR_mesh_quantization"};
    model.doc["nodes"][0]["matrix"] = {1, 0, 0, 0, 0, 2, 0, 0, 0, 0, -1, 0, 3, 4, 5, 1};
    put_gltf(folder, "quantized", model);
  }
  for (const int mode : {0, 1, 4, 5, 6}) {
    GltfBuilder model;
    model.primitive({{"POSITION", model.add(kSquare, "VEC3")}},
                    model.add<std::uint8_t>({0, 1, 2, 3}, "SCALAR"))["mode"] = mode;
    model.triangle();
    put_gltf(folder, "mode" + std::to_string(mode), model);
  }
  put(folder, "external",
      R"({"asset":{"version":"2.0"},"buffers":[{"byteLength":36,"uri":"m.bin"}],)"
      R"("bufferViews":[{"buffer":0,"byteLength":36}],"accessors":[{"bufferView":0,)"
      R"("componentType":5126,"count":3,"type":"VEC3"}],"nodes":[{"mesh":0}],"scenes":[{"nodes":[0]}],)"
      R"("meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}]})");
}

/// Meshes in PLY and STL, which the target of OBJ reads, too.
void other_mesh_seeds(const fs::path& folder) {
  const std::string xyz = "property float x\nproperty float y\nproperty float z\n";
  const std::string head = "comment TextureFile a.png\nelement vertex 4\n" + xyz;
  const std::string square = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
  put(folder, "ply-text",
      "ply\nformat ascii 1.0\n" + head +
          "element face 2\nproperty list uchar int vertex_indices\nproperty list uchar float "
          "texcoord\nproperty int texnumber\nend_header\n" +
          square + "4 0 1 2 3 8 0 0 1 0 1 1 0 1 0\n3 0 1 2 0 -1\n");
  const std::vector<float> corners{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  put(folder, "ply-binary",
      "ply\nformat binary_little_endian 1.0\n" + head +
          "element face 1\nproperty list uint ushort vertex_index\nend_header\n" +
          GltfBuilder::bytes_of(corners) + std::string("\3\0\0\0\0\0\1\0\2\0", 10));
  put(folder, "stl-text",
      "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1e0 "
      "-0.5\nendloop\nendfacet\nendsolid a\n");
  put(folder, "stl-binary",
      "STL" + std::string(77, ' ') + std::string("\1\0\0\0", 4) + GltfBuilder::bytes_of(corners) +
          std::string(2, '\0'));
}

void obj_seeds(const fs::path& folder) {
  const std::string square =
      "mtllib m.mtl\no cube\ng side left\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\n"
      "vt 1 1\nvt 0 1\nvn 0 0 1\nusemtl skin\ns 1\n";
  const std::string material =
      "newmtl skin\nKd 1 0.5 0.2\nKe 0 0 0.1\nd 0.5\nTr 0.5\nmap_Kd -s 2 2 1 -o 0.5 0 -clamp on "
      "skin.png\nmap_Ke glow.png\nmap_Bump -bm 0.5 bump.png\nnorm n.png\nmap_Pr r.png\nillum 2\n"
      "newmtl hair\nmap_Kd C:\\art\\hair.png\nrefl -type sphere r.png\n";
  put(folder, "square", square + "f 1/1/1 2/2/1 3/3/1 4/4/1\n%%\n" + material);
  put(folder, "triangles",
      square + "f 1 2 3\nusemtl hair\nf -4//-1 -2//-1 -1//-1\nf 1/1 2/2 3/3\n%%\n" + material);
  put(folder, "no-normals", "v 0 0 0\nv 1 0 0 1\nv 0 1 0 1 0.5 0.5 0.5\nf 1 2 3 \\\n 1\n");
  put(folder, "polygon",
      "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\nv 0 2 1\nf 1 2 3 4 5 6\nf 6 5 4 3 2 1\n"
      "l 1 2\np 1\nf 1 2\n");
  put(folder, "odd-numbers",
      "v 1e38 -1e-38 .5\nv +1 -.25 1e0\nv 0 0 0\nv 1e39 0 0\nvt 0.5\nvn 0 0 0\nf 1/1/1 2/1/1 "
      "3/1/1\n");
}

void splat_seeds(const fs::path& folder) {
  const auto scene = [](int rows, int sh, bool normals) {
    test::SplatPlyBuilder ply;
    ply.columns = test::SplatPlyBuilder::usual_columns(sh, normals);
    for (int i = 0; i < rows; ++i) ply.rows.push_back(test::SplatPlyBuilder::usual_row(0.1 * i));
    return ply;
  };
  put(folder, "usual", scene(4, 0, true).bytes());
  put(folder, "harmonics", scene(2, 9, false).bytes());
  auto one = scene(5, 0, false);
  one.comments = "comment SplatRenderMode: mip\nobj_info x\n";
  put(folder, "antialiased", one.bytes());
  one = scene(3, 0, true);
  for (std::string& column : one.columns) column = "ushort" + column.substr(column.find(' '));
  put(folder, "halves", one.bytes());
  one = scene(3, 0, true);
  for (std::string& column : one.columns) column = "double" + column.substr(column.find(' '));
  put(folder, "doubles", one.bytes());
  one = scene(3, 0, false);
  one.line_end = "\r\n";
  one.after = "element extra 2\nproperty uchar a\nproperty list uchar int b\n";
  one.bytes_after = "abcdefgh";
  put(folder, "lists", one.bytes());
  one = scene(300, 0, false);
  put(folder, "many", one.bytes());
  put(folder, "mesh",
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nelement face 1\nproperty list "
      "uchar int vertex_indices\nend_header\n0\n3 0 0 0\n");
  const std::string points =
      "element vertex 20\nproperty float x\nproperty float y\nproperty float z\nproperty uchar "
      "red\nproperty uchar green\nproperty uchar blue\nproperty float nx\nproperty float "
      "ny\nproperty float nz\nproperty float alpha\nend_header\n";
  std::string text, binary;
  for (int i = 0; i < 20; ++i) {
    const float x = 0.1F * static_cast<float>(i), y = x * x;
    text += std::to_string(x) + ' ' + std::to_string(y) + " 2 9 99 255 0 0 1 0.5\n";
    binary += GltfBuilder::bytes_of(std::vector<float>{x, y, 2}) + "abc" +
              GltfBuilder::bytes_of(std::vector<float>{0, 0, 1, 0.5F});
  }
  put(folder, "points-text", "ply\nformat ascii 1.0\n" + points + text);
  put(folder, "points-binary", "ply\nformat binary_little_endian 1.0\n" + points + binary);
  std::string las(227 + 5 * 26, '\1');
  const auto set = [&](std::size_t at, auto value) {
    std::memcpy(las.data() + at, &value, sizeof value);
  };
  set(0, std::array{'L', 'A', 'S', 'F'});
  set(24, std::array<std::uint8_t, 2>{1, 2});
  set(96, std::uint32_t{227});
  set(104, std::uint8_t{2});
  set(105, std::uint16_t{26});
  set(107, std::uint32_t{5});
  for (std::size_t k = 0; k < 3; ++k) {
    set(131 + 8 * k, 0.01);
    set(155 + 8 * k, 1000.0);
  }
  put(folder, "las", las);
  const test::Scene small = test::random_scene(6, 1);
  put(folder, "compressed", test::compressed_ply_bytes(small));
  for (const std::uint32_t version : {1U, 2U, 3U, 4U})
    put(folder, "spz" + std::to_string(version), test::spz_bytes(small, version));
  put(folder, "spz3.gz", test::gzipped(test::spz_bytes(small, 3)));
  put(folder, "splat", "s" + test::dot_splat_bytes(small));
  for (const unsigned level : {0U, 1U, 2U})
    put(folder, "ksplat" + std::to_string(level), "k" + test::ksplat_bytes(small, level));
  put(folder, "glb", test::gltf_scene(small).bytes());
}

/// In formats that are guarded or judged by their bytes, with texts and profiles beside the
/// picture.
void image_seeds(const fs::path& folder) {
  fs::create_directories(folder);
  const auto write = [&](const std::string& name, OIIO::TypeDesc type, int channels, int tile) {
    const std::string path = (folder / name).string();
    auto out = OIIO::ImageOutput::create(path);
    if (!out) return;
    OIIO::ImageSpec spec(9, 7, channels, type);
    if (tile > 0) spec.tile_width = spec.tile_height = tile;
    spec.attribute("ImageDescription", "a picture");
    spec.attribute("Artist", "nobody");
    spec.attribute("Exif:ISOSpeedRatings", 100);
    const std::vector<std::uint8_t> profile(200, 7);
    if (!name.ends_with(".png"))  // which wants a true one
      spec.attribute("ICCProfile", OIIO::TypeDesc(OIIO::TypeDesc::UINT8, 200), profile.data());
    const std::vector<float> texels(9 * 7 * 4, 0.5F);
    if (!out->open(path, spec)) return;
    out->write_image(OIIO::TypeDesc::FLOAT, texels.data());
    out->close();
  };
  using OIIO::TypeDesc;
  for (const char* name : {"a.png", "a.jpg", "a.webp", "a.bmp", "a.tga", "a.hdr", "a.ppm", "a.tif"})
    write(name, TypeDesc::UINT8, 3, 0);
  write("b.png", TypeDesc::UINT16, 4, 0);
  write("b.tif", TypeDesc::UINT16, 4, 16);
  write("c.tif", TypeDesc::FLOAT, 1, 0);
  write("a.exr", TypeDesc::HALF, 4, 0);
  write("b.exr", TypeDesc::FLOAT, 3, 16);
  write("b.webp", TypeDesc::UINT8, 4, 0);
  put(folder, "c.png", kPng);
  put(folder, "big.tif",
      std::string("II+\0\x08\0\0\0\x10\0\0\0\0\0\0\0\2\0\0\0\0\0\0\0"
                  "\0\1\3\0\1\0\0\0\0\0\0\0\4\0\0\0\0\0\0\0"
                  "\1\1\3\0\1\0\0\0\0\0\0\0\4\0\0\0\0\0\0\0"
                  "\0\0\0\0\0\0\0\0",
                  72));
}

/// A sheet of more triangles than a small image has texels: its packs hold records.
std::string dense_sheet(int cells) {
  std::string text;
  const auto part = [&](int i) { return std::to_string(static_cast<double>(i) / cells); };
  for (int y = 0; y <= cells; ++y) {
    for (int x = 0; x <= cells; ++x)
      text += "v " + part(x) + " " + part(y) + " 0\nvt " + part(x) + " " + part(y) + "\n";
  }
  for (int y = 0; y < cells; ++y) {
    for (int x = 0; x < cells; ++x) {
      text += "f";
      for (const int corner : {y * (cells + 1) + x + 1, y * (cells + 1) + x + 2,
                               (y + 1) * (cells + 1) + x + 2, (y + 1) * (cells + 1) + x + 1})
        text += " " + std::to_string(corner) + "/" + std::to_string(corner);
      text += "\n";
    }
  }
  return text;
}

/// Sound packs of every kind that jobs read back, and changes to them.
void pack_seeds(const fs::path& folder) {
  const fs::path work = folder / "work", packs = folder / "packs";
  fs::create_directories(work / "scene");
  fs::create_directories(packs);
  TransferOptions options = test::make_random_scene((work / "scene").string(), 41);
  options.image.size = ImageSize{70, 50};
  options.output = (work / "result.png").string();
  options.resources.threads = 1;
  options.resources.memory_bytes = 256 << 20;
  options.resources.cache_dir = (work / "cache").string();
  transfer(options);
  options.targets = {(work / "dense.obj").string()};
  put(work, "dense.obj", dense_sheet(90));
  transfer(options);
  test::SplatPlyBuilder ply;
  for (int i = 0; i < 300; ++i) {
    ply.rows.push_back(test::SplatPlyBuilder::usual_row(0.01 * i));
    ply.rows.back()["y"] = 0.01 * (i % 17);
    ply.rows.back()["nz"] = i % 2;
  }
  options.source = (work / "scene.ply").string();
  options.channels.transferred = {Channel::base_color};
  ply.write(options.source);
  transfer(options);
  for (const auto& entry : fs::recursive_directory_iterator(work / "cache")) {
    if (entry.path().extension() != ".pack") continue;
    fs::copy_file(entry.path(), packs / entry.path().filename(),
                  fs::copy_options::overwrite_existing);
    if (entry.file_size() < 64 << 10)
      put(folder / "pack", entry.path().filename().string(), bytes_of(entry.path()));
  }
  fs::remove_all(work);
  for (unsigned pack = 0; pack < 8; ++pack) {
    for (unsigned tile = 0; tile < 3; ++tile) {
      for (unsigned part = 0; part < 2; ++part) {
        std::string change(10, '\0');
        change[0] = static_cast<char>(pack);
        change[1] = static_cast<char>(tile);
        change[2] = static_cast<char>(part);
        change[3] = static_cast<char>(part + tile);
        change[6] = '\1';
        put(folder / "pack", "change" + std::to_string(pack * 6 + tile * 2 + part), change);
      }
    }
  }
}

/// A GLB as JSON and its BIN chunk; "" for what is none.
std::string taken_apart(const std::string& glb) {
  const auto u32 = [&](std::size_t at) {
    std::uint32_t value = 0;
    if (at + 4 <= glb.size()) std::memcpy(&value, glb.data() + at, 4);
    return std::size_t{value};
  };
  const std::size_t json_bytes = u32(12), bin_at = 20 + json_bytes;
  if (bin_at + 8 > glb.size() || u32(bin_at) > glb.size() - bin_at - 8) return "";
  return glb.substr(20, json_bytes) + "\n%%\n" + glb.substr(bin_at + 8, u32(bin_at));
}

/// Small files of real data, by their endings.
void data_seeds(const fs::path& folder, const fs::path& data) {
  const std::map<std::string, std::string> targets{
      {".glb", "gltf"},   {".gltf", "gltf"}, {".obj", "obj"},   {".ply", "splats"},
      {".spz", "splats"}, {".png", "image"}, {".jpg", "image"}, {".tif", "image"},
      {".exr", "image"},  {".webp", "image"}};
  constexpr std::uintmax_t kMostBytes = 64 << 10;
  int number = 0;
  for (const auto& entry : fs::recursive_directory_iterator(data)) {
    const auto target = targets.find(entry.path().extension().string());
    if (target == targets.end() || !entry.is_regular_file() || entry.file_size() >= kMostBytes)
      continue;
    const fs::path to = folder / target->second;
    std::string bytes = bytes_of(entry.path());
    const std::string name = "data" + std::to_string(++number);
    if (bytes.starts_with("glTF")) put(to, name + "-parts", taken_apart(bytes));
    if (target->second == "obj") {
      const fs::path material = fs::path(entry.path()).replace_extension(".mtl");
      if (fs::exists(material)) bytes += "\nmtllib m.mtl\n\n%%\n" + bytes_of(material);
    }
    put(to, name, bytes);
  }
}

}  // namespace
}  // namespace pounce

int main(int argc, char** argv) try {
  if (argc < 2) {
    std::cerr << "usage: fuzz_seeds FOLDER [TEST DATA]\n";
    return 2;
  }
  const std::filesystem::path folder(argv[1]);
  pounce::gltf_seeds(folder / "gltf");
  pounce::obj_seeds(folder / "obj");
  pounce::other_mesh_seeds(folder / "obj");
  pounce::splat_seeds(folder / "splats");
  pounce::image_seeds(folder / "image");
  pounce::fuzz::put_images(folder / "decode");
  pounce::pack_seeds(folder);
  pounce::gltf_seeds(folder / "job");
  pounce::obj_seeds(folder / "job");
  pounce::splat_seeds(folder / "job");
  if (argc > 2) pounce::data_seeds(folder, argv[2]);
  return 0;
} catch (const std::exception& e) {
  std::cerr << "fuzz_seeds: " << e.what() << "\n";
  return 1;
}
