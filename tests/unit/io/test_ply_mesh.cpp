// SPDX-License-Identifier: Apache-2.0
//
// Meshes in PLY: the three encodings, what columns mean, per-corner UVs and textures, damage.
#include <algorithm>
#include <bit>
#include <catch2/catch.hpp>
#include <filesystem>
#include <functional>

#include "core/colour_space.h"
#include "io/read_mesh.h"
#include "io/splats/scene.h"
#include "read_error.h"
#include "support/gltf_builder.h"
#include "support/random.h"
#include "support/taken.h"
#include "support/test_data.h"

using namespace pounce;
using test::refusal;
using test::TempFolder;
using test::write_file;

namespace {

/// Rows of numbers as one of PLY's encodings.
class PlyWriter {
 public:
  explicit PlyWriter(std::string format) : format_(std::move(format)) {}

  template <class T>
  PlyWriter& put(T value) {
    if (format_ == "ascii") {
      if constexpr (sizeof(T) == 1) {
        body_ += std::to_string(static_cast<int>(value)) + " ";
      } else {
        body_ += std::to_string(value) + " ";
      }
      return *this;
    }
    std::array<char, sizeof(T)> raw = std::bit_cast<std::array<char, sizeof(T)>>(value);
    if (format_ == "binary_big_endian") std::reverse(raw.begin(), raw.end());
    body_.append(raw.data(), raw.size());
    return *this;
  }
  template <class T>
  PlyWriter& put_all(std::initializer_list<T> values) {
    for (const T value : values) put(value);
    return *this;
  }
  PlyWriter& end_row() {
    if (format_ == "ascii") body_ += "\n";
    return *this;
  }
  std::string text(const std::string& header) const {
    return "ply\nformat " + format_ + " 1.0\n" + header + "end_header\n" + body_;
  }

 private:
  std::string format_, body_;
};

const char* const kXyz = "property float x\nproperty float y\nproperty float z\n";
const char* const kFaces = "property list uchar int vertex_indices\n";

std::string element(const char* name, int count) {
  return std::string("element ") + name + " " + std::to_string(count) + "\n";
}

/// A text of these vertices and faces.
std::string ascii(const std::string& vertex, int vertices, const std::string& face, int faces,
                  const std::string& body, const std::string& comments = "") {
  return "ply\nformat ascii 1.0\n" + comments + element("vertex", vertices) + vertex +
         element("face", faces) + face + "end_header\n" + body;
}

const char* const kSquare = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

std::string plain_square() {
  return ascii(kXyz, 4, kFaces, 1, std::string(kSquare) + "4 0 1 2 3\n");
}

}  // namespace

TEST_CASE("a PLY mesh is the same in all three encodings", "[io][ply]") {
  const std::string format = GENERATE("ascii", "binary_little_endian", "binary_big_endian");
  const TempFolder folder;
  PlyWriter w(format);
  const std::array<std::array<double, 8>, 4> rows{{{0, 0, 0, 0, 0, 1, 0, 0},
                                                   {2, 0, 0, 0, 0, 1, 1, 0},
                                                   {2, 3, 0.5, 0, 0, 1, 1, 1},
                                                   {0, 3, 0.5, 0, 0, 1, 0, 0.25}}};
  for (const auto& r : rows) {
    w.put(r[0]).put(static_cast<float>(r[1])).put(static_cast<float>(r[2]));
    w.put(std::uint8_t{7});  // a column that nobody knows
    for (std::size_t k = 3; k < 8; ++k) w.put(static_cast<float>(r[k]));
    w.end_row();
  }
  w.put_all<std::uint16_t>({1, 2, 3}).end_row();  // an element between
  w.put(std::uint8_t{3}).put_all<std::int16_t>({0, 1, 2}).put(std::int32_t{5}).end_row();
  w.put(std::uint8_t{4}).put_all<std::int16_t>({0, 1, 2, 3}).put(std::int32_t{5}).end_row();
  w.put(std::uint8_t{2}).put_all<std::int16_t>({0, 1}).put(std::int32_t{5}).end_row();
  write_file(
      folder.file("m.ply"),
      w.text("comment made by hand\n" + element("vertex", 4) +
             "property double x\nproperty float y\nproperty float32 z\nproperty uchar id\n"
             "property float nx\nproperty float ny\nproperty float nz\n"
             "property float s\nproperty float t\n" +
             element("other", 1) + "property ushort a\nproperty ushort b\nproperty ushort c\n" +
             element("face", 3) + "property list uchar short vertex_index\nproperty int flags\n"));
  const std::string path = folder.file("m.ply");
  CHECK(!io::splat_format(path));
  const mesh::Mesh mesh = io::read_mesh(path);
  REQUIRE(mesh.positions.size() == 4);
  CHECK(mesh.positions[2] == Vec3f{2, 3, 0.5F});
  CHECK(mesh.normals[0] == Vec3f{0, 0, 1});
  CHECK(mesh.uv_sets.at(0)[3] == Vec2f{0, 0.75F});  // counted from above
  REQUIRE(mesh.triangles.size() == 3);
  CHECK(mesh.triangles[0] == std::array<std::uint32_t, 3>{0, 1, 2});
  CHECK(mesh.triangles[2] == std::array<std::uint32_t, 3>{0, 2, 3});
  CHECK(mesh.materials.at(0).name == "default");
  REQUIRE(mesh.warnings.size() == 1);
  CHECK_THAT(mesh.warnings[0], Catch::Contains("1 faces with fewer than 3 corners ignored"));
  const io::MeshCost cost = io::mesh_cost(path);
  CHECK(cost.kept_bytes >= mesh.size_bytes());
}

TEST_CASE("indices of a PLY may be of any whole type", "[io][ply]") {
  const TempFolder folder;
  const auto with = [&](const char* type, auto value) {
    using Index = decltype(value);
    PlyWriter w("binary_little_endian");
    for (const float x : {0.0F, 1.0F, 0.0F}) w.put(x).put(x == 0 ? 0.0F : 2.0F).put(1 - x);
    w.put(std::uint32_t{3}).template put_all<Index>({2, 1, 0});
    write_file(folder.file("m.ply"), w.text(element("vertex", 3) + kXyz + element("face", 1) +
                                            "property list uint " + type + " vertex_indices\n"));
    return io::read_mesh(folder.file("m.ply")).triangles.at(0);
  };
  const std::array<std::uint32_t, 3> wanted{2, 1, 0};
  CHECK(with("char", std::int8_t{}) == wanted);
  CHECK(with("uint8", std::uint8_t{}) == wanted);
  CHECK(with("short", std::int16_t{}) == wanted);
  CHECK(with("ushort", std::uint16_t{}) == wanted);
  CHECK(with("int32", std::int32_t{}) == wanted);
  CHECK(with("uint", std::uint32_t{}) == wanted);
  write_file(folder.file("m.ply"), ascii(kXyz, 3, "property list uchar float vertex_indices\n", 1,
                                         "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"));
  CHECK_THAT(refusal(folder.file("m.ply")), Catch::Contains("names vertices by fractions"));
}

TEST_CASE("texture coordinates of vertices have many names", "[io][ply]") {
  const TempFolder folder;
  const auto [u, v] =
      GENERATE(std::pair("u", "v"), std::pair("s", "t"), std::pair("texture_u", "texture_v"),
               std::pair("texture_s", "texture_t"));
  write_file(folder.file("m.ply"),
             ascii(std::string(kXyz) + "property float " + u + "\nproperty float " + v + "\n", 3,
                   kFaces, 1, "0 0 0 0.25 1\n1 0 0 0.5 0.5\n0 1 0 1 0\n3 0 1 2\n"));
  const mesh::Mesh mesh = io::read_mesh(folder.file("m.ply"));
  CHECK(mesh.uv_sets.at(0) == std::vector<Vec2f>{{0.25F, 0}, {0.5F, 0.5F}, {1, 1}});
  CHECK(mesh.uv_present.at(0).empty());
}

TEST_CASE("faces with texture coordinates part vertices at seams", "[io][ply]") {
  const TempFolder folder;
  // Two triangles share an edge: at vertex 2 they have one UV, at vertex 0 two. The third has none.
  write_file(folder.file("m.ply"),
             ascii(kXyz, 4, std::string(kFaces) + "property list uchar float texcoord\n", 3,
                   std::string(kSquare) + "3 0 1 2 6 0 0 1 0 1 1\n3 0 2 3 6 0.5 0 1 1 0 1\n"
                                          "3 3 2 1 0\n"));
  const mesh::Mesh mesh = io::read_mesh(folder.file("m.ply"));
  // 0, 1, 2, 0 again, 3, and 3, 2, 1 without UVs: numbered as faces name them.
  REQUIRE(mesh.triangles.size() == 3);
  CHECK(mesh.triangles[0] == std::array<std::uint32_t, 3>{0, 1, 2});
  CHECK(mesh.triangles[1][1] == 2);
  CHECK(mesh.positions[mesh.triangles[1][0]] == mesh.positions[0]);
  CHECK(mesh.uv_sets.at(0)[0] == Vec2f{0, 1});
  CHECK(mesh.uv_sets.at(0)[2] == Vec2f{1, 0});
  CHECK(mesh.uv_sets.at(0)[mesh.triangles[1][0]] == Vec2f{0.5F, 1});
  CHECK(mesh.has_uv(0, mesh.triangles[1][2]));
  CHECK(!mesh.has_uv(0, mesh.triangles[2][0]));
  write_file(folder.file("m.ply"),
             ascii(kXyz, 4, std::string(kFaces) + "property list uchar float texcoord\n", 1,
                   std::string(kSquare) + "3 0 1 2 4 0 0 1 0\n"));
  CHECK_THAT(refusal(folder.file("m.ply")),
             Catch::Contains("face 0 has 3 corners, but 4 texture coordinates"));
}

TEST_CASE("textures of a PLY become materials", "[io][ply]") {
  const TempFolder folder;
  write_file(folder.file("left side.png"), "x");
  const std::string face =
      std::string(kFaces) + "property list uchar float texcoord\nproperty int texnumber\n";
  const std::string uvs = " 6 0 0 1 0 1 1 ";
  const auto read = [&](const std::string& comments, bool external = false) {
    write_file(folder.file("m.ply"),
               ascii(kXyz, 4, face, 4,
                     std::string(kSquare) + "3 0 1 2" + uvs + "1\n3 0 2 3" + uvs + "0\n3 0 1 3" +
                         uvs + "1\n3 1 2 3" + uvs + "-1\n",
                     comments));
    io::MeshReading reading;
    reading.allow_external = external;
    return io::read_mesh(folder.file("m.ply"), reading);
  };
  const mesh::Mesh mesh = read("comment TextureFile left side.png\ncomment TextureFile b.png\r\n");
  REQUIRE(mesh.materials.size() == 3);  // in the order of their first faces
  CHECK(mesh.materials[0].name == "b");
  CHECK(mesh.materials[1].name == "left side");
  CHECK(mesh.materials[2].name == "default");
  CHECK(mesh.triangle_material == std::vector<std::uint32_t>{0, 1, 0, 2});
  REQUIRE(mesh.images.size() == 2);
  CHECK(mesh.images[0].missing);
  CHECK(mesh.images[1].problem.empty());
  CHECK(mesh.images[1].path == folder.file("left side.png"));
  CHECK(!mesh.materials[2].textures[0]);
  // Elsewhere on this machine.
  const mesh::Mesh outside = read("comment TextureFile /etc/hostname\n");
  CHECK_THAT(outside.images.at(0).problem, Catch::Contains("--allow-external"));
  REQUIRE(outside.warnings.size() == 1);
  CHECK_THAT(outside.warnings[0], Catch::Contains("2 faces have the number of a texture"));
  CHECK(read("comment TextureFile /etc/hostname\n", true).images.at(0).problem.empty());
  // A path of another machine: the file beside the PLY is meant.
  CHECK(read("comment TextureFile C:\\art\\left side.png\n").images.at(0).path ==
        folder.file("left side.png"));
}

TEST_CASE("a texture without coordinates is a warning", "[io][ply]") {
  const TempFolder folder;
  write_file(folder.file("m.ply"), ascii(kXyz, 4, kFaces, 1, std::string(kSquare) + "4 0 1 2 3\n",
                                         "comment TextureFile skin.png\n"));
  const mesh::Mesh mesh = io::read_mesh(folder.file("m.ply"));
  CHECK(mesh.uv_sets.empty());
  CHECK(mesh.images.empty());
  REQUIRE(mesh.warnings.size() == 1);
  CHECK_THAT(mesh.warnings[0], Catch::Contains("no texture coordinates; texture ignored"));
}

TEST_CASE("colours of a PLY are sRGB, of whole numbers or of fractions", "[io][ply]") {
  const TempFolder folder;
  const auto [type, values] =
      GENERATE(std::pair("uchar", "255 0 51 128"), std::pair("float", "1 0 0.2 0.501961"));
  std::string columns(kXyz);
  for (const char* name : {"red", "green", "blue", "alpha"})
    columns += std::string("property ") + type + " " + name + "\n";
  std::string body;
  for (const char* place : {"0 0 0 ", "1 0 0 ", "0 1 0 "})
    body += place + std::string(values) + "\n";
  write_file(folder.file("m.ply"), ascii(columns, 3, kFaces, 1, body + "3 0 1 2\n"));
  io::MeshReading reading;
  reading.vertex_colours = true;
  const mesh::Mesh mesh = io::read_mesh(folder.file("m.ply"), reading);
  CHECK(mesh.has_vertex_colours);
  REQUIRE(mesh.colours.size() == 3);
  CHECK(mesh.colours[1].x == 1);
  CHECK(mesh.colours[1].y == 0);
  CHECK(mesh.colours[1].z == Approx(srgb_to_linear(0.2)).epsilon(1e-6));
  CHECK(mesh.colours[1].w == Approx(128 / 255.0).epsilon(1e-5));
  CHECK(io::read_mesh(folder.file("m.ply")).colours.empty());
}

TEST_CASE("a PLY without normals is smooth across seams and sharp at edges", "[io][ply]") {
  const TempFolder folder;
  // Two faces at a right angle, then two in one plane; each pair has its shared places twice.
  write_file(folder.file("m.ply"), ascii(kXyz, 12, kFaces, 4,
                                         "0 0 0\n1 0 0\n0 1 0\n0 0 0\n1 0 0\n0 0 -1\n"
                                         "5 0 0\n6 0 0\n5 1 0\n6 0 0\n6 1 0.2\n5 1 0\n"
                                         "3 0 1 2\n3 3 5 4\n3 6 7 8\n3 9 10 11\n"));
  const mesh::Mesh mesh = io::read_mesh(folder.file("m.ply"));
  CHECK(mesh.normals[mesh.triangles[0][0]] == Vec3f{0, 0, 1});
  CHECK(std::abs(mesh.normals[mesh.triangles[1][0]].y) == 1);
  const Vec3f a = mesh.normals[mesh.triangles[2][1]], b = mesh.normals[mesh.triangles[3][0]];
  CHECK(a == b);
  CHECK(a.z < 1);
}

TEST_CASE("an origin is taken off in double precision", "[io][ply]") {
  const TempFolder folder;
  write_file(folder.file("m.ply"),
             ascii("property double x\nproperty double y\nproperty double z\n", 3, kFaces, 1,
                   "5000000.125 0 0\n5000001 0 0\n5000000 1 0\n3 0 1 2\n"));
  io::MeshReading reading;
  reading.origin = {5e6, 0, 0};
  CHECK(io::read_mesh(folder.file("m.ply"), reading).positions.at(0).x == 0.125F);
}

TEST_CASE("what a PLY holds decides what it is", "[io][ply]") {
  const TempFolder folder;
  const std::string path = folder.file("m.ply");
  write_file(path, plain_square());
  CHECK(!io::source_splat_format(path));
  // No faces, or no list of vertices: as before.
  write_file(path, ascii(kXyz, 4, kFaces, 0, kSquare));
  CHECK(io::splat_format(path));
  CHECK_THAT(refusal(path), Catch::Contains("a PLY file without faces"));
  write_file(path, ascii(kXyz, 4, "property int a\n", 1, std::string(kSquare) + "1\n"));
  CHECK(io::splat_format(path));
  // Gaussians that bring faces are still Gaussians.
  write_file(path, ascii(std::string(kXyz) + "property float f_dc_0\n", 1, kFaces, 1,
                         "0 0 0 0\n3 0 0 0\n"));
  CHECK(io::splat_format(path));
  // By any name.
  write_file(folder.file("m.obj"), plain_square());
  CHECK(io::read_mesh(folder.file("m.obj")).triangles.size() == 2);
}

TEST_CASE("a damaged PLY mesh is refused with its place", "[io][ply]") {
  const TempFolder folder;
  const auto said = [&](const std::string& text) {
    write_file(folder.file("m.ply"), text);
    return refusal(folder.file("m.ply"));
  };
  const std::string body(kSquare);
  CHECK(said(plain_square()).empty());
  CHECK_THAT(said(ascii(kXyz, 4, kFaces, 1, body + "4 0 1 2 4\n")),
             Catch::Contains("line 14: face 0 refers to vertex 4, but there are only 4"));
  CHECK_THAT(said(ascii(kXyz, 4, kFaces, 1, body + "4 0 1 2 -1\n")), Catch::Contains("vertex -1"));
  CHECK_THAT(said(ascii(kXyz, 4, kFaces, 1, body + "4 0 1 2\n")), Catch::Contains("truncated"));
  CHECK_THAT(said(ascii(kXyz, 4, kFaces, 1, body + "3 0 1 1.5\n")),
             Catch::Contains("an index that is not a whole number"));
  CHECK_THAT(said(ascii(kXyz, 4, kFaces, 1, body + "-3 0 1 2\n")),
             Catch::Contains("a list of -3 entries"));
  CHECK_THAT(said(ascii(kXyz, 4, kFaces, 1, body + "200 0 1 2\n")),
             Catch::Contains("a list of 200 entries"));
  CHECK_THAT(said(ascii(kXyz, 4, kFaces, 1, "0 0 nan\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n")),
             Catch::Contains("line 10: vertex 0 is not a finite number"));
  CHECK_THAT(said(ascii(kXyz, 4, kFaces, 1, "0 0 1e39\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n")),
             Catch::Contains("vertex 0 is"));
  CHECK_THAT(said(ascii("property float x\nproperty float y\n", 4, kFaces, 1, body)),
             Catch::Contains("lack x, y or z"));
  CHECK_THAT(said(ascii(kXyz, 2'000'000'000, kFaces, 1, body)),
             Catch::Contains("announces 2000000000 rows of the element \"vertex\""));
  CHECK_THAT(said(ascii(kXyz, 4, kFaces, 2'000'000'000, body)),
             Catch::Contains("announces 2000000000 rows of the element \"face\""));
  CHECK_THAT(said(ascii(kXyz, 4, kFaces, 1, body + "2 0 1\n")), Catch::Contains("no faces"));
  // Assimp's Wuson.ply: a comment without the word. It has faces, so it is not said to have none.
  std::string remark = plain_square();
  remark.insert(remark.find("element"), "Created by Blender3D 247\n");
  CHECK_THAT(said(remark), Catch::Contains("line 3 of the header contains \"Created by Blender3D"));
  std::string other = plain_square();
  other.replace(other.find("ascii"), 5, "utf-8");
  CHECK_THAT(said(other), Catch::Contains("its format is \"utf-8\""));
  CHECK_THAT(said("ply\nformat ascii 1.0\n" + element("face", 1) + kFaces + element("vertex", 3) +
                  kXyz + "end_header\n3 0 1 2\n0 0 0\n1 0 0\n0 1 0\n"),
             Catch::Contains("faces before its vertices"));
}

TEST_CASE("a list of a PLY never takes more than the file has", "[io][ply]") {
  const TempFolder folder;
  PlyWriter w("binary_little_endian");
  for (int i = 0; i < 9; ++i) w.put(static_cast<float>(i % 4));
  w.put(std::uint32_t{4'000'000'000}).put_all<std::int32_t>({0, 1, 2});
  write_file(folder.file("m.ply"), w.text(element("vertex", 3) + kXyz + element("face", 1) +
                                          "property list uint int vertex_indices\n"));
  const std::string path = folder.file("m.ply");
  CHECK_THAT(refusal(path), Catch::Contains("a list of 4000000000 entries, but only 12 bytes"));
  CHECK(test::taken_by([&] { io::mesh_cost(path); }).grown_bytes < (8U << 20));
}

TEST_CASE("reading a PLY takes no more memory than its cost says", "[io][ply]") {
  const TempFolder folder;
  const bool with_uvs = GENERATE(false, true), with_normals = GENERATE(false, true);
  constexpr int kSide = 300;
  PlyWriter w("binary_little_endian");
  for (int i = 0; i < kSide * kSide; ++i) {
    w.put(static_cast<float>(i % kSide)).put(static_cast<float>(i / kSide)).put(0.0F);
    if (with_normals) w.put_all({0.0F, 0.0F, 1.0F});
  }
  int faces = 0;
  for (int i = 0; i + kSide < kSide * kSide; ++i, ++faces) {
    w.put(std::uint8_t{4}).put_all<std::int32_t>({i, (i + 1) % (kSide * kSide), i + kSide, i + 1});
    if (with_uvs) {
      w.put(std::uint8_t{8});
      for (int k = 0; k < 8; ++k) w.put(static_cast<float>(i % 1000 + k) * 0.001F);
    }
  }
  write_file(
      folder.file("m.ply"),
      w.text(element("vertex", kSide * kSide) + kXyz +
             (with_normals ? "property float nx\nproperty float ny\nproperty float nz\n" : "") +
             element("face", faces) + kFaces +
             (with_uvs ? "property list uchar float texcoord\n" : "")));
  const std::string path = folder.file("m.ply");
  const io::MeshCost cost = io::mesh_cost(path);
  const test::Taken taken = test::taken_by([&] { io::read_mesh(path); });
  CHECK(taken.status == 0);
  CHECK(taken.grown_bytes <= cost.peak_bytes);
  CHECK(double(taken.grown_bytes) >= 0.15 * double(cost.peak_bytes));
}

TEST_CASE("mutants of a PLY mesh are read or refused", "[io][ply]") {
  const TempFolder folder;
  const std::string format = GENERATE("ascii", "binary_little_endian", "binary_big_endian");
  PlyWriter w(format);
  for (int i = 0; i < 9; ++i)
    w.put(static_cast<float>(i % 3)).put(static_cast<float>(i / 3)).put(0.5F).end_row();
  for (const int i : {0, 1, 3, 4}) {
    w.put(std::uint8_t{4}).put_all<std::int32_t>({i, i + 1, i + 4, i + 3}).put(std::uint8_t{8});
    w.put_all({0.0F, 0.0F, 1.0F, 0.0F, 1.0F, 1.0F, 0.0F, 1.0F}).put(std::int32_t{0}).end_row();
  }
  const std::string good =
      w.text("comment TextureFile a.png\n" + element("vertex", 9) + kXyz + element("face", 4) +
             kFaces + "property list uchar float texcoord\nproperty int texnumber\n");
  test::Random random(5);
  int read = 0, refused = 0;
  for (int i = 0; i < 2000; ++i) {
    std::string mutant = good;
    for (std::uint64_t flips = 1 + random.below(3); flips > 0; --flips) {
      char& at = mutant[random.below(mutant.size())];
      at = static_cast<char>(random.one_in(2) ? random.bits() : at ^ (1 << random.below(8)));
    }
    if (random.one_in(8)) mutant.resize(random.below(mutant.size()));
    write_file(folder.file("m.ply"), mutant);
    std::string problem;
    INFO("mutant " << i);
    REQUIRE_NOTHROW(problem = refusal(folder.file("m.ply")));
    ++(problem.empty() ? read : refused);
  }
  CHECK(read > 100);
  CHECK(refused > 100);
}

TEST_CASE("a real PLY of either byte order is read", "[io][ply][external]") {
  const auto data = test::test_data();
  if (!data) return;
  const mesh::Mesh shelf =
      io::read_mesh((*data / "bad/happly/sampledata/platonic_shelf_big_endian.ply").string());
  // Five solids: 4 + 12 + 8 + 36 + 20 triangles.
  CHECK(shelf.triangles.size() == 4 + 12 + 8 + 36 + 20);
}
