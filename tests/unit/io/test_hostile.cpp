// SPDX-License-Identifier: Apache-2.0
//
// Files made to cost far more than their size. Each is read in a process of its own, whose memory
// and time are looked at from outside.
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "io/read_mesh.h"
#include "pounce/error.h"
#include "support/gltf_builder.h"
#include "support/taken.h"
#include "support/test_data.h"

namespace pounce {
namespace {

using test::Taken;
using test::taken_by;
using test::write_file;

constexpr std::uint64_t kMiB = 1 << 20;

std::string repeated(const std::string& unit, std::size_t count) {
  std::string out;
  out.reserve((unit.size() + 1) * count);
  for (std::size_t i = 0; i < count; ++i) out += (i == 0 ? "" : ",") + unit;
  return out;
}

const char* const kSquare =
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n";
const char* const kFace = "f 1/1/1 2/2/1 3/3/1 4/4/1\n";

/// A triangle as .gltf, with more members before its scene, and more nodes, materials and such.
std::string triangle(const std::string& members, const std::string& primitive_members = "",
                     const std::string& mesh_members = "") {
  const std::vector<float> corners{0, 0, 0, 1, 0, 0, 0, 1, 0};
  return R"({"asset":{"version":"2.0"},"buffers":[{"byteLength":36,"uri":"data:a/b;base64,)" +
         test::base64(test::GltfBuilder::bytes_of(corners)) +
         R"("}],"bufferViews":[{"buffer":0,"byteLength":36}],)" + members + R"("meshes":[{)" +
         mesh_members + R"("primitives":[{)" + primitive_members +
         R"("attributes":{"POSITION":0}}]}]})";
}
const std::string kAccessors =
    R"("accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}],)";

/// A circle of corners, as v and vt lines.
std::string circle(int corners, double inner) {
  std::string out;
  char line[128];
  for (int i = 0; i < corners; ++i) {
    const double angle = 6.283185307179586 * i / corners, r = i % 2 == 0 ? 1 : inner;
    const double x = r * std::cos(angle), y = r * std::sin(angle);
    std::snprintf(line, sizeof line, "v %.9f %.9f 0\nvt %.9f %.9f\n", x, y, x, y);
    out += line;
  }
  return out;
}

TEST_CASE("reading takes no more memory than its cost says", "[io]") {
  const test::TempFolder folder;
  const std::string path = folder.file("m.gltf"), obj = folder.file("m.obj");
  const auto check = [&](const std::string& name, const std::string& file, double least_share) {
    INFO(name);
    const io::MeshCost cost = io::mesh_cost(file);
    const Taken read = taken_by([&] { io::read_mesh(file); });
    CHECK(read.status == 0);
    CHECK(read.grown_bytes <= cost.peak_bytes + 8 * kMiB);
    // And the bound says something.
    CHECK(static_cast<double>(read.grown_bytes) >= least_share * double(cost.peak_bytes));
    const Taken counted = taken_by([&] { io::mesh_cost(file, {}, 16 * kMiB); });
    CHECK(counted.status == 0);
    CHECK(counted.grown_bytes <= 72 * kMiB);
  };
  const auto check_json = [&](const char* name, const std::string& text) {
    write_file(path, text);
    check(name, path, 0.05);
  };
  check_json("nodes", triangle(kAccessors + R"("nodes":[{"mesh":0},)" +
                               repeated(R"({"name":"a node of the scene"})", 100'000) + "],"));
  check_json("empty objects",
             triangle(kAccessors + R"("extras":[)" + repeated("{}", 1'000'000) + "],"));
  check_json("numbers",
             triangle(kAccessors, "", R"("weights":[)" + repeated("0", 1'500'000) + "],"));
  check_json(
      "accessors",
      triangle(R"("accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},)" +
               repeated(R"({"componentType":5126,"count":3,"type":"VEC3"})", 60'000) + "],"));
  check_json("extensions of a node",
             triangle(kAccessors + R"("nodes":[{"mesh":0,"extensions":{"X":[)" +
                      repeated("0", 400'000) + "]}}],"));
  check_json("extensions, spelled otherwise",
             triangle(kAccessors + R"("nodes":[{"mesh":0,"\u0065xtensions":{"X":[)" +
                      repeated(R"({"":{}})", 200'000) + "]}}],"));
  check_json("materials",
             triangle(kAccessors + R"("materials":[)" + repeated("{}", 30'000) + "],"));
  check_json("one long string",
             triangle(kAccessors + R"("extras":")" + std::string(8'000'000, 'x') + R"(",)"));
  const auto check_long = [&](const char* name, const std::string& text) {
    write_file(path, text);
    check(name, path, 0.4);
    CHECK(io::mesh_cost(path).peak_bytes <
          12 * std::uint64_t{text.size()});  // 44 if it were values
  };
  const std::string huge(30'000'000, 'x');
  check_long("an extra of 30 MB", triangle(kAccessors + R"("extras":{"a":")" + huge + R"("},)"));
  check_long("a key of 30 MB", triangle(kAccessors + R"("extras":{")" + huge + R"(":0},)"));
  check_long(
      "an extension of 30 MB",
      triangle(kAccessors + R"("nodes":[{"mesh":0,"extensions":{"X":")" + huge + R"("}}],)"));
  std::string generator = triangle(kAccessors);
  generator.replace(generator.find("2.0\""), 4, R"(2.0","generator":")" + huge + '"');
  check_long("a generator of 30 MB", generator);
  // What its escape makes a data URI is not counted as a long string: the rest of the text would
  // seem smaller by as much.
  check_json("a data URI, spelled otherwise",
             triangle(kAccessors + R"("images":[{"uri":"\u0064ata:image/png;base64,)" +
                      std::string(8'000'000, 'A') + R"("}],"extras":[)" +
                      repeated("{}", 1'000'000) + "],"));

  std::string mtl, uses;
  for (int i = 0; i < 150'000; ++i) {
    mtl += "newmtl m" + std::to_string(i) + "\nKd 1 1 1\nmap_Kd skin.png\n";
  }
  write_file(folder.file("m.mtl"), mtl);
  write_file(obj, std::string("mtllib m.mtl\nusemtl m7\n") + kSquare + kFace);
  check("material file", obj, 0.3);
  CHECK(io::mesh_cost(obj).peak_bytes < 200 * kMiB);
  // The same file by another name, named in ways that only the reader's eyes could follow.
  write_file(folder.file("my big.mtl"), mtl);
  for (const char* said : {"mtllib my big.mtl \r\n", "\xEF\xBB\xBFmtllib my big.mtl\n",
                           "mtllib \\\n my big.mtl\n", "mtllib \\ \n\tmy big.mtl\n"}) {
    write_file(obj, said + ("usemtl m7\n" + std::string(kSquare)) + kFace);
    check(said, obj, 0.3);
    CHECK(io::read_mesh(obj).materials.at(0).name == "m7");
  }
  for (int i = 0; i < 30'000; ++i) uses += "usemtl u" + std::to_string(i) + "\n" + kFace;
  write_file(obj, kSquare + uses);
  check("unknown materials", obj, 0.1);
  const std::string name(3900, 'n');
  uses.clear();
  for (int i = 0; i < 10'000; ++i) uses += "usemtl " + name + std::to_string(i) + "\n" + kFace;
  write_file(obj, kSquare + uses);
  check("long names of unknown materials", obj, 0.3);
  std::string face = "f";
  for (int i = 0; i < 1'500'000; ++i) face += " 1/1/1";
  write_file(obj, kSquare + face + "\n");
  check("one face", obj, 0.3);
  // Images in a deep folder, each with every texture that a material may name.
  std::string deep = folder.file("deep");
  for (int i = 0; i < 10; ++i) {
    std::filesystem::create_directory(deep);
    deep += "/" + std::string(70, 'd');
  }
  std::filesystem::create_directory(deep);
  std::string textured;
  uses.clear();
  for (int i = 0; i < 3'000; ++i) {
    const std::string n = std::to_string(i);
    textured += "newmtl m" + n + "\n";
    for (const char* slot : {"map_Kd", "map_Ke", "map_Ka", "map_Ks", "map_Ns", "map_Bump", "disp",
                             "map_d", "refl", "map_Pr", "map_Pm", "map_Ps", "norm"}) {
      textured += std::string(slot) + " " + n + slot + "\n";
    }
    uses += "usemtl m" + n + "\n" + kFace;
  }
  write_file(deep + "/m.mtl", textured);
  write_file(deep + "/m.obj", "mtllib m.mtl\n" + (kSquare + uses));
  check("images of an OBJ in a deep folder", deep + "/m.obj", 0.3);
  write_file(deep + "/m.gltf",
             triangle(kAccessors + R"("images":[)" + repeated(R"({"uri":"a"})", 40'000) + "],"));
  check("images of a glTF in a deep folder", deep + "/m.gltf", 0.3);
  // Blanks behind the backslash: the statement goes on all the same.
  std::string faces = kSquare;
  for (int i = 0; i < 1'000'000; ++i) faces += "f 1/1/1 \\ \n2/2/1 \\\t\n3/3/1\n";
  write_file(obj, faces);
  check("continued faces", obj, 0.3);
}

TEST_CASE("what a file repeats is refused, counted or read once", "[io]") {
  const test::TempFolder folder;
  const std::string path = folder.file("m.gltf"), obj = folder.file("m.obj");
  const auto read = [&](const char* name, const std::string& file, const std::string& text) {
    INFO(name);
    write_file(file, text);
    const Taken taken = taken_by([&] { io::read_mesh(file); });
    CHECK(taken.cpu_s < 20);  // all took minutes, or never ended
    return taken.status;
  };
  // A fan and one face of many corners: every triangle meets at one corner.
  std::string fan = circle(150'000, 1);
  for (int i = 2; i < 150'000; ++i) {
    fan += "f 1/1 " + std::to_string(i) + "/1 " + std::to_string(i + 1) + "/1\n";
  }
  CHECK(read("fan", obj, fan) == 0);
  std::string face = "f";
  for (int i = 1; i <= 150'000; ++i) face += " " + std::to_string(i) + "/" + std::to_string(i);
  CHECK(read("one face", obj, circle(150'000, 1) + face + "\n") == 0);
  std::string stars = circle(1000, 0.5), star = "f";
  for (int i = 1; i <= 1000; ++i) star += " " + std::to_string(i) + "/" + std::to_string(i);
  for (int i = 0; i < 300; ++i) stars += star + "\n";
  CHECK(read("stars", obj, stars) == 0);
  std::string groups = "g";
  for (int i = 0; i < 1000; ++i) groups += " " + std::to_string(i);
  std::string objects = kSquare + groups + "\n";
  for (int i = 0; i < 100'000; ++i) objects += "o " + std::to_string(i) + "\nf 1 2 3\n";
  CHECK(read("objects of many groups", obj, objects) == 0);
  std::string uses = kSquare;
  for (int i = 0; i < 200'000; ++i) uses += "usemtl " + std::to_string(i) + "\nf 1 2 3\n";
  CHECK(read("materials", obj, uses) == 3);
  CHECK(read("a long name", obj, kSquare + ("o " + std::string(5000, 'n')) + "\n" + kFace) == 3);

  const std::string nodes = R"("nodes":[)" + repeated(R"({"mesh":0})", 150'000) + "],";
  std::string points =
      triangle(kAccessors + nodes, R"("mode":0,"attributes":{"POSITION":0}},)" +
                                       repeated(R"({"mode":0,"attributes":{}})", 150'000) + ",{");
  CHECK(read("nodes x primitives", path, points) == 0);
  CHECK(read("nodes x joints", path,
             triangle(kAccessors + R"("skins":[{"joints":[)" + repeated("0", 1'000'000) + "]}]," +
                      R"("nodes":[)" + repeated(R"({"mesh":0,"skin":0})", 100'000) + "],")) == 0);
  CHECK(read("nodes x morph targets", path,
             triangle(kAccessors + nodes,
                      R"("targets":[)" + repeated(R"({"POSITION":0})", 50'000) + "],",
                      R"("weights":[)" + repeated("1", 50'000) + "],")) == 3);

  CHECK(read("a long name of many nodes", path,
             triangle(kAccessors + nodes, "",
                      R"("name":")" + std::string(100'000, 'n') + R"(",)")) == 3);

  // A GLB of empty chunks.
  std::string text = triangle(kAccessors), glb = "glTF";
  while (text.size() % 4 != 0) text += ' ';
  const auto word = [&](std::uint32_t value) {
    glb.append(reinterpret_cast<const char*>(&value), 4);
  };
  constexpr std::uint32_t kChunks = 2'000'000;
  word(2), word(static_cast<std::uint32_t>(20 + text.size() + 8 * kChunks));
  word(static_cast<std::uint32_t>(text.size())), word(0x4E4F534A);
  glb += text;
  for (std::uint32_t i = 0; i < kChunks; ++i) word(0), word(0x21212121);
  CHECK(read("chunks", folder.file("m.glb"), glb) == 3);
}

TEST_CASE("images in one embedded buffer share it", "[io]") {
  const test::TempFolder folder;
  test::GltfBuilder b;
  const int positions = b.add(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3");
  b.primitive({{"POSITION", positions}});
  const int picture = b.view(std::string(4'000'000, 'p'));
  for (int i = 0; i < 200; ++i)
    b.push("images", {{"bufferView", picture}, {"mimeType", "image/png"}});
  const std::string path = b.write(folder.file("m.gltf"));
  const Taken taken = taken_by([&] { io::read_mesh(path); });
  CHECK(taken.status == 0);
  CHECK(taken.grown_bytes < 64 * kMiB);
  const mesh::Mesh mesh = io::read_mesh(path);
  CHECK(mesh.images[199].size_bytes == 4'000'000);
  CHECK(mesh.size_bytes() < 8 * kMiB);
}

TEST_CASE("a warning for every instance costs nothing", "[io]") {
  const test::TempFolder folder;
  const std::string path = folder.file("m.gltf");
  // Four loose vertices are a triangle and an incomplete one; the name is as long as one may be.
  const std::vector<float> corners{0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0};
  write_file(path, R"({"asset":{"version":"2.0"},"buffers":[{"byteLength":48,)"
                   R"("uri":"data:a/b;base64,)" +
                       test::base64(test::GltfBuilder::bytes_of(corners)) +
                       R"("}],"bufferViews":[{"buffer":0,"byteLength":48}],)" +
                       R"("accessors":[{"bufferView":0,"componentType":5126,"count":4,)" +
                       R"("type":"VEC3"}],"meshes":[{"name":")" + std::string(4096, 'n') +
                       R"(","primitives":[{"attributes":{"POSITION":0}}]}],"nodes":[)" +
                       repeated(R"({"mesh":0})", 50'000) + "]}");
  const Taken taken = taken_by([&] { io::read_mesh(path); });
  CHECK(taken.status == 0);
  CHECK(taken.grown_bytes <= 200 * kMiB);
  const mesh::Mesh mesh = io::read_mesh(path);
  REQUIRE(mesh.warnings.size() == 101);
  CHECK(mesh.warnings[0] == path + ": mesh 0 \"" + std::string(100, 'n') +
                                "...\" primitive 0 ends with an incomplete triangle; ignored");
  CHECK(mesh.warnings.back() == path + ": 49900 more warnings, not shown");
}

TEST_CASE("warnings are not more than somebody reads", "[io]") {
  const test::TempFolder folder;
  const std::string obj = folder.file("m.obj");
  std::string text = kSquare;
  for (int i = 0; i < 1000; ++i) text += "mtllib gone" + std::to_string(i) + ".mtl\n";
  for (int i = 0; i < 1000; ++i) text += "usemtl u" + std::to_string(i) + "\n" + kFace;
  write_file(obj, text);
  const mesh::Mesh mesh = io::read_mesh(obj);
  REQUIRE(mesh.warnings.size() == 101);
  CHECK(mesh.warnings.back() == obj + ": 906 more warnings, not shown");
  CHECK(mesh.materials.size() == 1000);
}

}  // namespace
}  // namespace pounce
