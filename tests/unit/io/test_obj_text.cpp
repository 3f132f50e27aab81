// SPDX-License-Identifier: Apache-2.0
//
// What the statements of an OBJ mean: which vertices and triangles they make, in which order, and
// which material files and materials they name.
#include <catch2/catch.hpp>

#include "read_error.h"
#include "support/gltf_builder.h"
#include "support/test_data.h"

using namespace pounce;
using test::TempFolder;
using test::write_file;
using Triangle = std::array<std::uint32_t, 3>;
using Strings = std::vector<std::string>;

namespace {

const std::string kSquare =
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\nvn 0 1 0\n";

mesh::Mesh read(const std::string& text) {
  const TempFolder folder;
  write_file(folder.file("m.obj"), text);
  return io::read_mesh(folder.file("m.obj"));
}

std::string refused(const std::string& text) {
  const TempFolder folder;
  write_file(folder.file("m.obj"), text);
  return test::refusal(folder.file("m.obj"));
}

/// The names of the materials, in the order of the mesh.
Strings materials(const mesh::Mesh& m) {
  Strings names;
  for (const auto& material : m.materials) names.push_back(material.name);
  return names;
}

/// The same of an OBJ beside files a.mtl and "b c.mtl", which both have a material "both".
mesh::Mesh read_beside(const std::string& statements) {
  const TempFolder folder;
  write_file(folder.file("a.mtl"), "newmtl both\nKd 1 0 0\nnewmtl a\n");
  write_file(folder.file("b c.mtl"), "newmtl both\nKd 0 1 0\nnewmtl b\n");
  write_file(folder.file("c.mtl"), "newmtl c\n");
  write_file(folder.file("m.obj"), kSquare + statements);
  return io::read_mesh(folder.file("m.obj"));
}

float red(const mesh::Material& material) { return material.factors[0][0]; }

}  // namespace

TEST_CASE("OBJ vertices are numbered as faces first name them", "[io]") {
  const mesh::Mesh m = read(kSquare + "f 3/3/1 2/2/1 1/1/1\nf 1/1/2 2/2/1 3/3\nf 3/3/1 1/1/1 4/1/1\n");
  CHECK(m.triangles == std::vector<Triangle>{{0, 1, 2}, {3, 1, 4}, {0, 2, 5}});
  CHECK(m.positions ==
        std::vector<Vec3f>{{1, 1, 0}, {1, 0, 0}, {0, 0, 0}, {0, 0, 0}, {1, 1, 0}, {0, 1, 0}});
  CHECK(m.uv_sets.at(0)[5] == Vec2f{0, 1});
  CHECK(m.normals[3] == Vec3f{0, 1, 0});
  // Only what faces name is a vertex, and faces of two corners name nothing.
  CHECK(read(kSquare + "f 4 4\nf 9 99\nf 2 3 4\n").positions[0] == Vec3f{1, 0, 0});
}

TEST_CASE("corners of a face may have different parts", "[io]") {
  const mesh::Mesh m = read(kSquare + "f 1 2/2 3//1 4/4/1\nf 1// 2/2/ 3//1\nf 1/ 2/2 4/4/1\n");
  CHECK(m.triangles == std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}, {0, 1, 2}, {0, 1, 3}});
  CHECK(m.positions.size() == 4);
  CHECK(m.uv_present.at(0) == std::vector<bool>{false, true, false, true});
}

TEST_CASE("relative indices of an OBJ are those of the lines before", "[io]") {
  const mesh::Mesh m = read(kSquare + "f -4/-4/-2 -3/-3/-2 -2/-2/-2\nv 5 5 5\nvt 5 5\nvn 1 0 0\n"
                                      "f -5/-5/-3 -4/-4/-3 -1/-1/-1\n");
  CHECK(m.triangles == std::vector<Triangle>{{0, 1, 2}, {0, 1, 3}});
  CHECK(m.positions[3] == Vec3f{5, 5, 5});
  CHECK(m.normals[3] == Vec3f{1, 0, 0});
  CHECK_THAT(refused("v 0 0 0\nv 1 0 0\nf 1 2 3\nv 0 1 0\n"),
             Catch::Contains("line 3: a face names vertex 3, but 2"));
  CHECK_THAT(refused(kSquare + "f 1/-5 2 3\n"), Catch::Contains("texture coordinate -5, but 4"));
  CHECK_THAT(refused(kSquare + "f 1//-3 2 3\n"), Catch::Contains("normal -3, but 2"));
}

TEST_CASE("what is no corner is refused before what is out of range", "[io]") {
  const Strings corners = {"+1",     "1/+1",       "1.5", "/1", "1/x", "1//0", "1/0", "#",
                           "1/1/1/", "2147483648", "1,2", "-",  "1/2-3"};
  for (const std::string& corner : corners) {
    INFO(corner);
    CHECK_THAT(refused(kSquare + "f 99 2 3 " + corner + "\n"),
               Catch::Contains("line 11: ") && Catch::Contains("\"" + corner + "\""));
  }
}

TEST_CASE("statements are whole words", "[io]") {
  const mesh::Mesh m = read(kSquare +
                            "fo 1 2 x\nF 1 2 3\nvx 1\nvp nan\nv\\\n 7 7 7\nusemtlx a\ns 1\ns off\n"
                            "f\nf \\\n\n\tf\t1 2\t3\n#f 1 2 4\n  # f 1 2 4\nl 1 99\np 99\n");
  CHECK(m.triangles.size() == 1);
  CHECK(materials(m) == Strings{"default"});
  CHECK(m.warnings.empty());
}

TEST_CASE("only the numbers that count are looked at", "[io]") {
  const mesh::Mesh m = read(
      "v 1 2 3 0.5 0.5 0.5 # red\nv 1 0 0 nan\nv 0 1 0 x\nvt 0.25\nvt\t0.5  0.75 nan\nvt 1 1\n"
      "vn 0 0 1 x\nf 1/2/1 2/3/1 3/3/1\n");
  CHECK(m.positions[0] == Vec3f{1, 2, 3});
  CHECK(m.uv_sets.at(0)[0] == Vec2f{.5F, .25F});
  CHECK_FALSE(m.has_vertex_colours);
}

TEST_CASE("a normal too large for a float is replaced", "[io]") {
  const mesh::Mesh m =
      read("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 1e300 0\nvn 0 0 0\nf 1//1 2//2 3//1\n");
  CHECK(m.normals == std::vector<Vec3f>(3, {0, 0, 1}));
  REQUIRE(m.warnings.size() == 1);
  CHECK_THAT(m.warnings[0], Catch::Contains("3 normals were zero or not finite"));
}

TEST_CASE("an OBJ's lines have an end", "[io]") {
  CHECK_THAT(refused(kSquare + "# " + std::string(16 << 20, 'x') + "\n"),
             Catch::Contains("line 11: longer than 16 MiB"));
  CHECK_THAT(refused(kSquare + "g " + std::string(4096, 'x') + "\n"),
             Catch::Contains("line 11: names of more than 4096 bytes"));
  CHECK(read(kSquare + "usemtl " + std::string(4095, 'x') + "\nf 1 2 3\n").materials[0].name.size() ==
        4095);
}

TEST_CASE("faces have the material that was named last", "[io]") {
  const mesh::Mesh m = read_beside(
      "f 1 2 3\nusemtl a\nmtllib a.mtl\nf 1 2 3\nusemtl a\nusemtl\nf 1 2 3 4\nusemtl b\nf 1 2\n"
      "usemtl  a\nf 1 2 3\nusemtl b\t \nusemtl a\nf 1 2 3\nusemtl gone\nf 1 2 3\n");
  // Before its file was named, "a" was unknown; a second blank is part of a name.
  CHECK(materials(m) == Strings{"default", "a", "a_2", " a", "gone"});
  CHECK(m.triangle_material == std::vector<std::uint32_t>{0, 1, 2, 2, 3, 2, 4});
  REQUIRE(m.warnings.size() == 4);
  CHECK_THAT(m.warnings[2], Catch::Contains("has the material \" a\""));
}

TEST_CASE("of several material files the first that can be read is", "[io]") {
  const auto files = [](const std::string& statements) {
    Strings names;
    const mesh::Mesh m = read_beside(statements + "usemtl both\nf 1 2 3\n");
    for (const std::string& file : m.files) {
      if (!file.ends_with("m.obj")) names.push_back(file.substr(file.rfind('/') + 1));
    }
    names.push_back(std::to_string(m.unread_files.size()));
    return names;
  };
  CHECK(files("mtllib a.mtl c.mtl\n") == Strings{"a.mtl", "0"});
  CHECK(files("mtllib gone.mtl  a.mtl\n") == Strings{"a.mtl", "1"});
  CHECK(files("mtllib a.mtl c.mtl\nmtllib a.mtl c.mtl\n") == Strings{"a.mtl", "c.mtl", "0"});
  CHECK(files("mtllib   b c.mtl\nmtllib b c.mtl\n") == Strings{"b c.mtl", "0"});
  CHECK(files("mtllib a.mtl b c.mtl\n") == Strings{"a.mtl", "0"});
  CHECK(files("mtllib .\\a.mtl\nmtllib ./a.mtl\n") == Strings{"a.mtl", "0"});
  CHECK(files("mtllib gone.mtl\nmtllib gone.mtl\n") == Strings{"1"});
  CHECK(files("mtllib\n") == Strings{"1"});
  CHECK(red(read_beside("mtllib a.mtl\nmtllib b c.mtl\nusemtl both\nf 1 2 3\n").materials[0]) == 1);
  CHECK(red(read_beside("mtllib b c.mtl\nmtllib a.mtl\nusemtl both\nf 1 2 3\n").materials[0]) == 0);
}

TEST_CASE("a face is in 64 groups at most", "[io]") {
  std::string groups = "g";
  for (int i = 0; i < 65; ++i) groups += " g" + std::to_string(i);
  const mesh::Mesh m = read(kSquare + groups + "\nf 1 2 3\n");
  CHECK(m.parts.names.size() == 64);
  REQUIRE(m.warnings.size() == 1);
  CHECK_THAT(m.warnings[0], Catch::Contains("only the first 64"));
}
