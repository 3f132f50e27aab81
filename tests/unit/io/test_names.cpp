// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>

#include "io/read_mesh.h"
#include "mesh/mesh.h"
#include "support/gltf_builder.h"
#include "support/test_data.h"

using namespace pounce;
using test::GltfBuilder;
using test::TempFolder;
using test::write_file;

namespace {

mesh::Mesh read_obj(const std::string& text) {
  const TempFolder folder;
  write_file(folder.file("m.obj"), text);
  return io::read_mesh(folder.file("m.obj"));
}

/// The names of each triangle, joined by '+'.
std::vector<std::string> names_of(const mesh::Mesh& m) {
  std::vector<std::string> out;
  for (std::size_t r = 0; r < m.parts.runs.size(); ++r) {
    const std::size_t end =
        r + 1 < m.parts.runs.size() ? m.parts.runs[r + 1].first_triangle : m.triangles.size();
    std::string text;
    for (const std::uint32_t name : m.parts.part_names[m.parts.runs[r].part]) {
      text += (text.empty() ? "" : "+") + m.parts.names[name];
    }
    while (out.size() < end) out.push_back(text);
  }
  return out;
}

using Names = std::vector<std::string>;
const std::string kCorners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

}  // namespace

TEST_CASE("OBJ objects and groups name the faces after them", "[io]") {
  CHECK(names_of(read_obj(kCorners + "f 1 2 3\n")) == Names{"default"});
  CHECK(names_of(read_obj(kCorners + "o Left Arm \nf 1 2 3 4\ng hand  finger\nf 1 2 3\n"
                                     "o Leg\nf 1 2 3\ng\nf 2 3 4\r\ng a\ng b\nf 1 2 3\n")) ==
        Names{"Left Arm", "Left Arm", "Left Arm+hand+finger", "Leg+hand+finger", "Leg+default",
              "Leg+b"});
}

TEST_CASE("two glTF nodes that show one mesh have its name and their own", "[io]") {
  GltfBuilder b;
  b.triangle();
  b.doc["meshes"][0]["name"] = "eye";
  b.doc["nodes"] = {{{"mesh", 0}, {"name", "Eye.L"}},
                    {{"mesh", 0}, {"name", "Eye.R"}, {"translation", {5, 0, 0}}},
                    {{"mesh", 0}}};
  const TempFolder folder;
  const std::string path = b.write(folder.file("m.gltf"));
  mesh::Mesh m = io::read_mesh(path);
  CHECK(names_of(m) == Names{"Eye.L+eye", "Eye.R+eye", "eye"});
  CHECK(m.files == std::vector<std::string>{path});
  mesh::select(m, {{"Eye.R"}, {}}, "source");
  REQUIRE(m.triangles.size() == 1);
  CHECK(m.positions[m.triangles[0][0]].x == 5);
}

TEST_CASE("glTF without names counts its meshes", "[io]") {
  GltfBuilder b;
  b.triangle();
  b.triangle();
  const TempFolder folder;
  CHECK(names_of(io::read_mesh(b.write(folder.file("m.gltf")))) == Names{"mesh_0", "mesh_1"});
}

TEST_CASE("a mesh names the files that it was read from", "[io]") {
  const TempFolder folder;
  write_file(folder.file("m.mtl"), "newmtl a\n");
  write_file(folder.file("m.obj"), "mtllib m.mtl\nusemtl a\n" + kCorners + "f 1 2 3\n");
  CHECK(io::read_mesh(folder.file("m.obj")).files ==
        std::vector<std::string>{folder.file("m.obj"), folder.file("m.mtl")});
  GltfBuilder b;
  b.triangle();
  write_file(folder.file("m.bin"), b.buffer);
  b.doc["buffers"] = {{{"byteLength", b.buffer.size()}, {"uri", "m.bin"}}};
  b.buffer.clear();
  b.write(folder.file("m.gltf"));
  CHECK(io::read_mesh(folder.file("m.gltf")).files ==
        std::vector<std::string>{folder.file("m.gltf"), folder.file("m.bin")});
}

TEST_CASE("the cost of a mesh holds its names", "[io]") {
  const TempFolder folder;
  const std::string path = folder.file("m.obj");
  const auto check = [&](const std::string& text) {
    write_file(path, text);
    const io::MeshCost cost = io::mesh_cost(path);
    const mesh::Mesh m = io::read_mesh(path);
    CAPTURE(m.parts.names.size(), m.parts.part_names.size(), m.parts.runs.size());
    CHECK(m.size_bytes() <= cost.kept_bytes);
    CHECK(cost.kept_bytes < m.size_bytes() * 6 + (4U << 20));
  };
  std::string each = kCorners, alternating = kCorners, wordy = kCorners;
  for (int i = 0; i < 50000; ++i) {
    const std::string n = std::to_string(i);
    each += "g a_rather_long_name_of_a_group_" + n + "\nf 1 2 3\n";
    alternating += i % 2 == 0 ? "g a\nf 1 2 3\n" : "g b\nf 1 2 3\n";
    wordy += "g x" + n + " y" + n + " z" + n + " w" + n + "\nf 1 2 3\n";
  }
  check(each);
  check(alternating);
  check(wordy);
}
