// SPDX-License-Identifier: Apache-2.0
//
// What the statements of an OBJ mean: which vertices and triangles they make, in which order, and
// which material files and materials they name.
#include <bit>
#include <catch2/catch.hpp>
#include <charconv>
#include <cmath>
#include <cstdio>

#include "io/obj/numbers.h"
#include "io/obj/obj_text.h"
#include "read_error.h"
#include "support/gltf_builder.h"
#include "support/random.h"
#include "support/test_data.h"

using namespace pounce;
using Catch::Matchers::Contains;
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
  const mesh::Mesh m =
      read(kSquare + "f 3/3/1 2/2/1 1/1/1\nf 1/1/2 2/2/1 3/3\nf 3/3/1 1/1/1 4/1/1\n");
  CHECK(m.triangles == std::vector<Triangle>{{0, 1, 2}, {3, 1, 4}, {0, 2, 5}});
  CHECK(m.positions ==
        std::vector<Vec3f>{{1, 1, 0}, {1, 0, 0}, {0, 0, 0}, {0, 0, 0}, {1, 1, 0}, {0, 1, 0}});
  CHECK(m.uv_sets.at(0)[5] == Vec2f{0, 1});
  CHECK(m.normals[3] == Vec3f{0, 1, 0});
  // Only what faces name is a vertex, and faces of two corners name nothing.
  CHECK(read(kSquare + "f 4 4\nf 9 99\nf 2 3 4\n").positions[0] == Vec3f{1, 0, 0});
}

TEST_CASE("any number of corners may share a position", "[io]") {
  // A fan whose pole has texture coordinates of its own in every face, and then once more.
  constexpr int kFaces = 3000;
  std::string text = "v 0 0 0\nv 1 0 0\nv 1 1 0\n", faces;
  for (int i = 1; i <= kFaces; ++i) {
    text += "vt " + std::to_string(i) + " 0\n";
    faces += "f 1/" + std::to_string(i) + " 2/1 3/1\n";
  }
  const mesh::Mesh m = read(text + faces + faces);
  CHECK(m.positions.size() == kFaces + 2);
  REQUIRE(m.triangles.size() == 2 * kFaces);
  for (std::uint32_t i = 0; i < kFaces; ++i) {
    const std::uint32_t pole = i == 0 ? 0 : i + 2;
    REQUIRE(m.triangles[i] == Triangle{pole, 1, 2});
    REQUIRE(m.triangles[i + kFaces] == m.triangles[i]);
    REQUIRE(m.uv_sets[0][pole].x == static_cast<float>(i + 1));
  }
}

TEST_CASE("corners of a face may have different parts", "[io]") {
  const mesh::Mesh m = read(kSquare + "f 1 2/2 3//1 4/4/1\nf 1// 2/2/ 3//1\nf 1/ 2/2 4/4/1\n");
  CHECK(m.triangles == std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}, {0, 1, 2}, {0, 1, 3}});
  CHECK(m.positions.size() == 4);
  CHECK(m.uv_present.at(0) == std::vector<bool>{false, true, false, true});
}

TEST_CASE("relative indices of an OBJ are those of the lines before", "[io]") {
  const mesh::Mesh m = read(kSquare +
                            "f -4/-4/-2 -3/-3/-2 -2/-2/-2\nv 5 5 5\nvt 5 5\nvn 1 0 0\n"
                            "f -5/-5/-3 -4/-4/-3 -1/-1/-1\n");
  CHECK(m.triangles == std::vector<Triangle>{{0, 1, 2}, {0, 1, 3}});
  CHECK(m.positions[3] == Vec3f{5, 5, 5});
  CHECK(m.normals[3] == Vec3f{1, 0, 0});
  CHECK_THAT(refused("v 0 0 0\nv 1 0 0\nf 1 2 3\nv 0 1 0\n"),
             Catch::Contains("line 3: a face refers to vertex 3, but only 2"));
  CHECK_THAT(refused(kSquare + "f 1/-5 2 3\n"),
             Catch::Contains("texture coordinate -5, but only 4"));
  CHECK_THAT(refused(kSquare + "f 1//-3 2 3\n"), Catch::Contains("normal -3, but only 2"));
}

TEST_CASE("what is no corner is refused before what is out of range", "[io]") {
  const Strings corners = {"+1", "1/+1",   "1.5",        "/1",  "1/x", "1//0", "1/0",
                           "#",  "1/1/1/", "2147483648", "1,2", "-",   "1/2-3"};
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
  CHECK(m.has_vertex_colours);
  CHECK_FALSE(read("v 1 2 3 1\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").has_vertex_colours);
}

TEST_CASE("colours of vertices become linear light", "[io]") {
  const auto read_coloured = [](const std::string& text) {
    const TempFolder folder;
    const std::string path = folder.file("m.obj");
    write_file(path, text);
    return io::read_mesh(path, {false, {}, true});
  };
  // sRGB: 0.5 is ((0.5 + 0.055) / 1.055)^2.4 = 0.214041 in linear light, 0.04 is 0.04 / 12.92.
  const std::string faces = "f 1 2 3\nf 3 2 1\n";
  const mesh::Mesh m = read_coloured("v 0 0 0 0.5 1 0\nv 1 0 0\nv 0 1 0 0.04 0 1 0.3\n" + faces);
  REQUIRE(m.colours.size() == m.positions.size());
  CHECK(m.colours[0].x == Approx(.214041).epsilon(1e-5));
  CHECK((m.colours[0].y == 1 && m.colours[0].z == 0 && m.colours[0].w == 1));
  CHECK(m.colours[1] == Vec4f{1, 1, 1, 1});  // has none
  CHECK(m.colours[2].x == Approx(.04 / 12.92));
  CHECK(m.colours[2].w == 1);  // a seventh number is nothing
  CHECK(m.warnings.empty());
  // Vertices that smoothing makes of one keep it.
  const mesh::Mesh sharp = read_coloured(
      "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nv 0 0 1 1 1 0\nf 1 3 2\nf 1 2 4\nf 1 4 3\n");
  REQUIRE(sharp.colours.size() == sharp.positions.size());
  CHECK(sharp.colours.size() > 4);
  for (std::size_t v = 0; v < sharp.colours.size(); ++v)
    CHECK((sharp.positions[v] == Vec3f{0, 0, 0}) == (sharp.colours[v] == Vec4f{1, 0, 0, 1}));
  // Some programs count to 255.
  const mesh::Mesh bytes =
      read_coloured("v 0 0 0 255 51 0\nv 1 0 0 0 0 0\nv 0 1 0 0 0 0\n" + faces);
  CHECK(bytes.colours[0].x == 1);
  CHECK(bytes.colours[0].y == Approx(.033105).epsilon(1e-4));  // of 0.2
  REQUIRE(bytes.warnings.size() == 1);
  CHECK_THAT(bytes.warnings[0], Contains("go up to 255; read as 0 to 255"));
  // What is no colour is white, and said: a mesh whose colours nobody wants has to be read.
  const mesh::Mesh bad =
      read_coloured("v 0 0 0 1 nan 0\nv 1 0 0 1 1 1e99\nv 0 1 0 0 0 1\nf 1 2 3\n");
  CHECK(bad.colours == std::vector<Vec4f>{{1, 1, 1, 1}, {1, 1, 1, 1}, {0, 0, 1, 1}});
  REQUIRE(bad.warnings.size() == 1);
  CHECK_THAT(bad.warnings[0], Contains("the colours of 2 vertices are not three finite numbers"));
}

TEST_CASE("a normal too large for a float is replaced", "[io]") {
  const mesh::Mesh m =
      read("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 1e300 0\nvn 0 0 0\nf 1//1 2//2 3//1\n");
  CHECK(m.normals == std::vector<Vec3f>(3, {0, 0, 1}));
  REQUIRE(m.warnings.size() == 1);
  CHECK_THAT(m.warnings[0], Catch::Contains("3 normals are zero or not finite"));
}

TEST_CASE("an OBJ's lines have an end", "[io]") {
  CHECK_THAT(refused(kSquare + "# " + std::string(16 << 20, 'x') + "\n"),
             Catch::Contains("line 11: longer than 16 MiB"));
  CHECK_THAT(refused(kSquare + "g " + std::string(4096, 'x') + "\n"),
             Catch::Contains("line 11: names of more than 4096 bytes"));
  CHECK(
      read(kSquare + "usemtl " + std::string(4095, 'x') + "\nf 1 2 3\n").materials[0].name.size() ==
      4095);
}

TEST_CASE("a comment takes no other line with it", "[io]") {
  const mesh::Mesh with = read("# from C:\\models\\\n \t# and\\\n" + kSquare + "f 1 2 3\n");
  CHECK(with.positions == read(kSquare + "f 1 2 3\n").positions);
  CHECK(read(kSquare + "f 1 2 \\\n3\n").triangles.size() == 1);
}

TEST_CASE("of a long word a message quotes the beginning", "[io]") {
  CHECK(refused(kSquare + "f " + std::string(100000, '0') + "/1 2 3\n").size() < 300);
}

TEST_CASE("faces have the material that was named last", "[io]") {
  const mesh::Mesh m = read_beside(
      "f 1 2 3\nusemtl a\nmtllib a.mtl\nf 1 2 3\nusemtl a\nusemtl\nf 1 2 3 4\nusemtl b\nf 1 2\n"
      "usemtl  a\nf 1 2 3\nusemtl b\t \nusemtl a\nf 1 2 3\nusemtl gone\nf 1 2 3\n");
  // Before its file was named, "a" was unknown; a second blank is part of a name.
  CHECK(materials(m) == Strings{"default", "a", "a_2", " a", "gone"});
  CHECK(m.triangle_material == std::vector<std::uint32_t>{0, 1, 2, 2, 3, 2, 4});
  REQUIRE(m.warnings.size() == 4);
  CHECK_THAT(m.warnings[2], Catch::Contains("defines the material \" a\""));
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

TEST_CASE("the cost of an OBJ knows of what is missing", "[io]") {
  const auto check = [](const std::string& text) {
    const TempFolder folder;
    write_file(folder.file("m.obj"), text);
    const io::MeshCost cost = io::mesh_cost(folder.file("m.obj"));
    const mesh::Mesh m = io::read_mesh(folder.file("m.obj"));
    CHECK(cost.kept_bytes >= m.size_bytes());
    CHECK(cost.kept_bytes < 2 * m.size_bytes() + (2U << 20));
    return cost.peak_bytes;
  };
  std::string faces = kSquare;
  for (int i = 0; i < 200'000; ++i) faces += "f 1//1\nf 1//1 2//1 3//1\n";
  check(faces);
  // Not all corners have normals, and no two faces of this fold share a vertex.
  std::string fold = "vn 0 0 1\nv 0 0 0\nv 0 1 0\n";
  for (int i = 1; i < 50'000; ++i) {
    const std::string x = std::to_string(i), z = std::to_string(i % 2);
    fold += "v " + x + " 0 " + z + "\nv " + x + " 1 " + z + "\nf -4 -2 -1 -3\n";
  }
  check(fold + "f 1//1 2//1 3//1\n");
  // Blanks at the end of a line are read, too.
  CHECK(check(kSquare + "f 1 2 3\n" + std::string(8 << 20, ' ')) > 16U << 20);
}

TEST_CASE("decimal numbers become the floats nearest to them", "[io]") {
  test::Random random(5);
  for (int i = 0; i < 100'000; ++i) {
    const float value = std::bit_cast<float>(static_cast<std::uint32_t>(random.bits()));
    if (!std::isfinite(value)) continue;
    char text[64];
    std::snprintf(text, sizeof text, "%.9g", double{value});
    REQUIRE(std::bit_cast<std::uint32_t>(io::to_float(text).value()) ==
            std::bit_cast<std::uint32_t>(value));
  }
  // Halfway between two floats, and a hair above: as doubles both are the same.
  CHECK(io::to_float("1.000000059604644775390625") == 1.F);
  CHECK(io::to_float("1.0000000596046447753906251") == std::nextafter(1.F, 2.F));
}

TEST_CASE("plain numbers have the bits that the standard library gives them", "[io]") {
  const auto check = [](const std::string& text) {
    const char* const end = text.data() + text.size();
    float value = 0;
    double wide = 0;
    REQUIRE(std::from_chars(text.data(), end, value).ptr == end);
    REQUIRE(std::from_chars(text.data(), end, wide).ptr == end);
    INFO(text);
    const auto read = io::to_float(text);
    const auto read_wide = io::to_double(text);
    REQUIRE((read && read_wide));
    REQUIRE(std::bit_cast<std::uint32_t>(*read) == std::bit_cast<std::uint32_t>(value));
    REQUIRE(std::bit_cast<std::uint64_t>(*read_wide) == std::bit_cast<std::uint64_t>(wide));
    REQUIRE(io::to_float("-" + text) == -value);
  };
  test::Random random(6);
  for (int i = 0; i < 300'000; ++i) {
    // Up to 19 digits, the point anywhere.
    std::string text = std::to_string(random.bits() >> random.bits() % 60);
    const std::size_t point = random.bits() % (text.size() + 1);
    if (point == 0) text.insert(0, "000", 1 + random.bits() % 3);
    if (point < text.size()) text.insert(std::max<std::size_t>(point, 1), ".");
    check(text);
  }
  // The middle of two floats, in fewer digits than it has: many of these are that middle as
  // doubles.
  for (int i = 0; i < 300'000; ++i) {
    const float low = static_cast<float>(random.bits() >> 40) / 65536.F;
    const double middle = (double{low} + std::nextafter(low, INFINITY)) / 2;
    char text[64];
    std::snprintf(text, sizeof text, "%.*f", static_cast<int>(12 + random.bits() % 4), middle);
    check(text);
  }
}

TEST_CASE("numbers that no float can hold are infinite or 0", "[io]") {
  const std::string zeros(400, '0');
  for (const std::string& text :
       Strings{"1e39", "3.5e38", "1e999", "1e99999999999999999999", "1" + zeros,
               "1" + zeros + "e-9", "0." + zeros + "1e999", "1e+400", "00010e999"}) {
    INFO(text);
    CHECK(io::to_float(text) == INFINITY);
    CHECK(io::to_float("-" + text) == -INFINITY);
    CHECK(io::to_float_or(text, 7) == 7);
  }
  for (const std::string& text :
       Strings{"1e-50", "1e-999", "1e-99999999999999999999", "0." + zeros + "1",
               "1" + zeros + "e-999", "0e999", ".000e-1"}) {
    INFO(text);
    CHECK(io::to_float(text) == 0.F);
    CHECK(std::signbit(io::to_float("-" + text).value()));
  }
}

TEST_CASE("what only begins like a number is none", "[io]") {
  for (const char* text : {"", "+", "-", ".", "+.", "+-5", "--5", "nan", "-nan", "inf", "+inf",
                           "infinity", "0x10", "1,5", "1e", "1e+", "5f", "1.2.3", "e5"}) {
    INFO(text);
    CHECK_FALSE(io::to_float(text).has_value());
  }
  CHECK(io::to_float_or("1,5", 7) == 1);
  CHECK(io::to_float_or("+-5", 7) == 7);
  CHECK(io::to_float_or("inf", 7) == 7);
  CHECK(io::to_float_or("", 7) == 7);
  CHECK(io::to_float("+.5") == .5F);
  CHECK(io::to_float("5.") == 5.F);
  CHECK_THAT(refused("v 0 0 +-5\n"), Catch::Contains("\"+-5\", which is not a finite number"));
}

TEST_CASE("lines of an OBJ end in every way", "[io]") {
  for (const std::string end : {"\n", "\r\n", "\r"}) {
    const auto ended = [&](const Strings& lines) {
      std::string text;
      for (const std::string& line : lines) text += line + end;
      return text;
    };
    const Strings square = {"v 0 0 0 1 1 1", "v 1 0 0", "",       "v 1 1 0 \\",
                            "1 1",           "o a \t",  "v 0 1 0"};
    const mesh::Mesh m = read(ended(square) + "f 1 2 3" + end + "f 1 \\" + end + "3 4");
    CHECK(m.positions.size() == 4);
    CHECK(m.triangles == std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}});
    CHECK(m.parts.names == Strings{"a"});
    CHECK_THAT(refused(ended(square) + "f 1 2 5" + end),
               Catch::Contains("line 8: a face refers to"));
  }
}

TEST_CASE("statements come without marks, ends and blanks", "[io]") {
  const TempFolder folder;
  const auto statements = [&](const std::string& text, io::ObjText::Kind kind) {
    write_file(folder.file("t"), text);
    io::ObjText file(folder.file("t"), kind);
    Strings out;
    for (std::string_view statement; file.next(statement);) out.emplace_back(statement);
    out.push_back(std::to_string(file.longest_bytes()));
    return out;
  };
  using Kind = io::ObjText::Kind;
  CHECK(statements("", Kind::obj) == Strings{"0"});
  CHECK(statements("\xEF\xBB\xBF", Kind::obj) == Strings{"", "0"});
  CHECK(statements("\xEF\xBB\xBF a b \t\r\n\nc\\\r\n d \\\n\ne\rf\\", Kind::obj) ==
        Strings{" a b", "", "c  d", "e", "f", "6"});
  CHECK(statements(" a b \t\r\n\nc\\\rd", Kind::mtl) == Strings{" a b", "", "c\\", "d", "6"});
  // Longer than the pieces that are read.
  const std::string line(300'000, 'x');
  CHECK(statements(line + "\n" + line, Kind::obj) == Strings{line, line, "300000"});
}
