// SPDX-License-Identifier: Apache-2.0
//
// Geometry packed with Draco and with meshoptimizer: what comes out, and what damaged or hostile
// bytes cost.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <map>

#include "io/read_mesh.h"
#include "read_error.h"
#include "support/packed_grid.h"
#include "support/random.h"
#include "support/taken.h"
#include "support/test_data.h"

using namespace pounce;
using nlohmann::json;
using test::DracoChoice;
using test::GltfBuilder;
using test::Grid;
using test::MeshoptBuilder;
using test::refusal;
using test::TempFolder;

namespace {

/// The vertex of the grid that has these UVs.
std::uint32_t vertex_of(const Grid& grid, Vec2f uv) {
  const auto place = [&](float value) {
    return static_cast<std::uint32_t>(std::lround(value * static_cast<float>(grid.side - 1)));
  };
  return place(uv.y) * grid.side + place(uv.x);
}

double distance(Vec3f a, Vec3f b) { return length(Vec3d(a) - Vec3d(b)); }

/// The same triangles, in any order and turned in any way, with vertices in any order.
void check_same(const Grid& grid, const mesh::Mesh& mesh, double position_error, double uv_error) {
  using Triangle = std::array<std::uint32_t, 3>;
  const auto first_least = [](Triangle t) {
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    return t;
  };
  REQUIRE(mesh.triangles.size() == grid.indices.size() / 3);
  REQUIRE(mesh.positions.size() == grid.positions.size());
  std::vector<Triangle> wanted, found;
  double worst_position = 0, worst_uv = 0;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const Vec2f uv = mesh.uv_sets.at(0)[v];
    const std::uint32_t is = vertex_of(grid, uv);
    worst_position = std::max(worst_position, distance(mesh.positions[v], grid.positions.at(is)));
    worst_uv = std::max({worst_uv, std::abs(double{uv.x} - grid.uvs[is].x),
                         std::abs(double{uv.y} - grid.uvs[is].y)});
  }
  for (std::size_t i = 0; i < grid.indices.size(); i += 3)
    wanted.push_back(first_least({grid.indices[i], grid.indices[i + 1], grid.indices[i + 2]}));
  for (const auto& t : mesh.triangles) {
    Triangle named{};
    for (std::size_t k = 0; k < 3; ++k) named[k] = vertex_of(grid, mesh.uv_sets[0][t[k]]);
    found.push_back(first_least(named));
  }
  std::sort(wanted.begin(), wanted.end());
  std::sort(found.begin(), found.end());
  CHECK(wanted == found);
  CHECK(worst_position <= position_error);
  CHECK(worst_uv <= uv_error);
}

/// The extension of the primitive, and of a packed view.
json& draco_of(GltfBuilder& b) {
  return b.doc["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"];
}
json& meshopt_of(GltfBuilder& b, std::size_t view) {
  return b.doc["bufferViews"][view]["extensions"]["EXT_meshopt_compression"];
}

/// Mutants of a file: each is read, or refused as bad input; nothing else.
void check_mutants(const std::string& path, const std::string& bytes, std::size_t from,
                   std::uint64_t seed, int count) {
  test::Random random(seed);
  int read = 0, refused = 0;
  for (int i = 0; i < count; ++i) {
    std::string mutant = bytes;
    for (std::uint64_t flips = 1 + random.below(4); flips > 0; --flips) {
      const std::size_t at = from + random.below(bytes.size() - from);
      mutant[at] =
          static_cast<char>(random.one_in(2) ? random.bits() : mutant[at] ^ (1 << random.below(8)));
    }
    if (random.one_in(8)) mutant.resize(from + random.below(bytes.size() - from));
    test::write_file(path, mutant);
    INFO("mutant " << i << " of seed " << seed);
    std::string problem;
    REQUIRE_NOTHROW(problem = refusal(path));
    ++(problem.empty() ? read : refused);
  }
  CHECK(read > 0);
  CHECK(refused > count / 20);
}

}  // namespace

TEST_CASE("Draco gives the mesh back, within what was rounded", "[io][packed]") {
  const TempFolder folder;
  const Grid grid = test::make_grid(GENERATE(2U, 3U, 40U));
  const bool sequential = GENERATE(false, true);
  const int speed = GENERATE(0, 5, 10);
  CAPTURE(grid.side, sequential, speed);
  const std::string path =
      test::draco_model(grid, {sequential, speed, 14}).write(folder.file("m.gltf"));
  const mesh::Mesh mesh = io::read_mesh(path);
  // The longest side is 1: half a step in each of three directions; UVs have 12 bits.
  check_same(grid, mesh, std::sqrt(3.0) * 0.51 / 16383, 0.51 / 4095);
  CHECK(mesh.normals.at(0).z > 0.999F);
  const io::MeshCost cost = io::mesh_cost(path);
  CHECK(cost.kept_bytes >= mesh.size_bytes());
}

TEST_CASE("a Draco mesh as .glb with a node is moved like any other", "[io][packed]") {
  const TempFolder folder;
  GltfBuilder b = test::draco_model(test::make_grid(3));
  b.doc["nodes"][0]["translation"] = {10, 0, 0};
  const mesh::Mesh mesh = io::read_mesh(b.write_glb(folder.file("m.glb")));
  for (const Vec3f& p : mesh.positions) CHECK((p.x >= 9.999F && p.x <= 11.001F));
}

TEST_CASE("plain data beside Draco's are taken as they are", "[io][packed]") {
  const TempFolder folder;
  const Grid grid = test::make_grid(3);
  // Nothing required: the accessors have bytes, and the packed ones are garbage.
  GltfBuilder b;
  const auto floats = [](const auto& values) {
    const float* const first = &values[0].x;
    return std::vector<float>(first, first + sizeof(values[0]) / 4 * values.size());
  };
  const int position = b.add<float>(floats(grid.positions), "VEC3");
  const int uv = b.add<float>(floats(grid.uvs), "VEC2");
  const int normal = b.add<float>(floats(grid.normals), "VEC3");
  auto& primitive = b.primitive({{"POSITION", position}, {"TEXCOORD_0", uv}, {"NORMAL", normal}},
                                b.add<std::uint32_t>(grid.indices, "SCALAR"));
  primitive["extensions"]["KHR_draco_mesh_compression"] = {{"bufferView", b.view("garbage.")},
                                                           {"attributes", {{"POSITION", 0}}}};
  b.doc["extensionsUsed"] = json::array({"KHR_draco_mesh_compression"});
  check_same(grid, io::read_mesh(b.write(folder.file("m.gltf"))), 0, 0);
  b.doc["extensionsRequired"] = json::array({"KHR_draco_mesh_compression"});
  CHECK_THAT(refusal(b.write(folder.file("m.gltf"))), Catch::Contains("do not begin like Draco"));
}

TEST_CASE("Draco data that claim another mesh than the accessors are refused", "[io][packed]") {
  const TempFolder folder;
  const Grid grid = test::make_grid(40);  // 1,600 vertices, 3,042 triangles
  const std::string packed = test::draco_bytes_of(grid, {GENERATE(false, true)});
  const auto said = [&](std::uint64_t vertices, std::uint64_t indices,
                        const std::function<void(GltfBuilder&)>& spoil = {}) {
    GltfBuilder b = test::draco_model(packed, vertices, indices);
    if (spoil) spoil(b);
    return refusal(b.write(folder.file("m.gltf")));
  };
  CHECK(said(1600, 9126).empty());
  CHECK(said(1500, 9126).empty());  // programs count before Draco parts vertices
  CHECK_THAT(said(800, 9126),
             Catch::Contains("mesh 0 \"Head\" primitive 0: its "
                             "KHR_draco_mesh_compression data claim 1600 vertices") &&
                 Catch::Contains("export the model again, or without compression"));
  CHECK_THAT(said(1600, 9123), Catch::Contains("claim 3042 triangles, but at most 3041"));
  CHECK_THAT(said(1600, 9126, [](auto& b) { draco_of(b)["attributes"]["NORMAL"] = 7; }),
             Catch::Contains("have no attribute 7, which should be NORMAL"));
  CHECK_THAT(said(1600, 9126, [](auto& b) { draco_of(b)["attributes"]["NORMAL"] = 2; }),
             Catch::Contains("have 2 numbers for each NORMAL, but its accessor has 3"));
  CHECK_THAT(said(1600, 9126, [](auto& b) { draco_of(b)["attributes"]["NORMAL"] = -1; }),
             Catch::Contains("NORMAL"));
  CHECK_THAT(said(1600, 9126, [](auto& b) { draco_of(b).erase("attributes"); }),
             Catch::Contains("KHR_draco_mesh_compression.attributes is missing"));
  CHECK_THAT(said(1600, 9126, [](auto& b) { draco_of(b)["bufferView"] = 9; }),
             Catch::Contains("bufferView"));
  CHECK_THAT(said(1600, 9126, [](auto& b) { draco_of(b)["attributes"].erase("POSITION"); }),
             Catch::Contains("have no positions"));
  CHECK_THAT(
      said(1600, 9126, [](auto& b) { b.doc["meshes"][0]["primitives"][0].erase("indices"); }),
      Catch::Contains("without indices"));
  CHECK_THAT(said(1600, 9126, [](auto& b) { b.doc["meshes"][0]["primitives"][0]["mode"] = 5; }),
             Catch::Contains("are no list of triangles"));
  // Attributes beside it that are not packed would not fit a mesh of another order and number.
  CHECK_THAT(said(1500, 9126,
                  [](auto& b) {
                    b.doc["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] =
                        b.template add<float>(std::vector<float>(3 * 1500, 1.0F), "VEC3");
                  }),
             Catch::Contains("have 1600 vertices, but attributes that are not packed with them "
                             "have 1500"));
}

TEST_CASE("the head of Draco data is read before anything is made by it", "[io][packed]") {
  const TempFolder folder;
  const Grid grid = test::make_grid(3);
  const std::string good = test::draco_bytes_of(grid);
  const auto said = [&](const std::function<void(std::string&)>& spoil) {
    std::string packed = good;
    spoil(packed);
    return refusal(test::draco_model(packed, 9, 24).write(folder.file("m.gltf")));
  };
  CHECK(said([](auto&) {}).empty());
  CHECK_THAT(said([](auto& p) { p.resize(5); }), Catch::Contains("are truncated"));
  CHECK_THAT(said([](auto& p) { p[0] = 'd'; }), Catch::Contains("do not begin like Draco"));
  CHECK_THAT(said([](auto& p) { p[6] = 1; }), Catch::Contains("version 2.1; glTF has 2.2"));
  CHECK_THAT(said([](auto& p) { p[7] = 0; }), Catch::Contains("are no mesh"));
  CHECK_THAT(said([](auto& p) { p[8] = 9; }), Catch::Contains("unknown method 9"));
  // Behind 11 bytes and the kind of walk: vertices, faces, seams, symbols, splits.
  const std::string billion = "\x80\x94\xEB\xDC\x03";
  CHECK_THAT(said([&](auto& p) { p.replace(12, 1, billion); }),
             Catch::Contains("claim 1000000000 vertices"));
  CHECK_THAT(said([&](auto& p) { p.replace(13, 1, billion); }),
             Catch::Contains("claim 1000000000 triangles"));
  CHECK_THAT(said([](auto& p) { p[14] = '\xFF'; }), Catch::Contains("claim 255 kinds of seams"));
  CHECK_THAT(said([&](auto& p) { p.replace(15, 1, billion); }),
             Catch::Contains("claim 1000000000 symbols"));
  CHECK_THAT(said([](auto& p) { p.replace(12, 1, std::string(6, '\xFF')); }),
             Catch::Contains("a number that is too long"));
  for (std::size_t size = 0; size < good.size(); ++size) {
    CAPTURE(size);
    CHECK(!said([&](auto& p) { p.resize(size); }).empty());
  }
}

TEST_CASE("metadata of Draco data are passed over", "[io][packed]") {
  const TempFolder folder;
  const Grid grid = test::make_grid(3);
  const std::string good = test::draco_bytes_of(grid);
  const auto with = [&](const std::string& metadata) {
    std::string packed = good;
    packed[10] = '\x80';
    packed.insert(11, metadata);
    return test::draco_model(packed, 9, 24).write(folder.file("m.gltf"));
  };
  // One attribute's (its id, one entry "a" = 1 byte, no parts), then the mesh's: a part "b" with
  // nothing in it.
  const std::string metadata("\1\0\1\1a\1x\0\0\1\1b\0\0", 14);
  check_same(grid, io::read_mesh(with(metadata)), 1e-4, 2e-4);
  CHECK_THAT(refusal(with(std::string("\0\1\1a\xFF\xFF\xFF\xFF\x0F", 9))),
             Catch::Contains("are truncated"));
  std::string deep(1, '\0');
  for (int i = 0; i < 40; ++i) deep += std::string("\0\1\1x", 4);
  CHECK_THAT(refusal(with(deep)), Catch::Contains("nested too deep"));
}

TEST_CASE("a tiny Draco file costs next to nothing whatever it claims", "[io][packed]") {
  const TempFolder folder;
  const Grid grid = test::make_grid(3);
  // As many vertices as the accessors of a small file may claim at all: the head says another.
  const std::string path = test::draco_model(test::draco_bytes_of(grid), 1'000'000, 3'000'000)
                               .write(folder.file("m.gltf"));
  const test::Taken taken = test::taken_by([&] { io::read_mesh(path); });
  CHECK(taken.grown_bytes < io::mesh_cost(path).peak_bytes);
  const std::string more =
      test::draco_model(test::draco_bytes_of(grid), 1'000'000'000'000, 3'000'000'000'000)
          .write(folder.file("more.gltf"));
  CHECK_THAT(refusal(more), Catch::Contains("too many for a file of this size"));
  GltfBuilder b = test::draco_model(test::draco_bytes_of(grid), 9, 24);
  for (int i = 0; i < 100'000; ++i) draco_of(b)["attributes"]["_" + std::to_string(i)] = 0;
  CHECK_NOTHROW(refusal(b.write(folder.file("m.gltf"))));
}

TEST_CASE("reading packed meshes takes no more memory than its cost says", "[io][packed]") {
  const TempFolder folder;
  const Grid grid = test::make_grid(400);  // 318,402 triangles
  const auto check = [](const std::string& path) {
    INFO(path);
    const io::MeshCost cost = io::mesh_cost(path);
    const test::Taken taken = test::taken_by([&] { io::read_mesh(path); });
    CHECK(taken.status == 0);
    CHECK(taken.grown_bytes <= cost.peak_bytes + (8U << 20));
    CHECK(double(taken.grown_bytes) >= 0.05 * double(cost.peak_bytes));
  };
  check(test::draco_model(grid).write_glb(folder.file("walk.glb")));
  check(test::draco_model(grid, {true}).write_glb(folder.file("list.glb")));
  check(test::draco_model(grid, {false, 0}).write_glb(folder.file("slow.glb")));
  check(test::meshopt_model(grid).write_packed(folder.file("m.gltf")));
}

TEST_CASE("mutants of Draco data are read or refused", "[io][packed]") {
  const TempFolder folder;
  const DracoChoice choice = GENERATE(DracoChoice{false, 0}, DracoChoice{false, 5},
                                      DracoChoice{true, 0}, DracoChoice{true, 10});
  const Grid grid = test::make_grid(9);
  const std::string path = test::draco_model(grid, choice).write_glb(folder.file("m.glb"));
  std::string bytes(std::filesystem::file_size(path), '\0');
  std::ifstream(path, std::ios::binary).read(bytes.data(), std::streamsize(bytes.size()));
  const std::size_t packed = bytes.find("DRACO");
  REQUIRE(packed != std::string::npos);
  check_mutants(path, bytes, packed + 11, 7 + static_cast<std::uint64_t>(choice.speed), 1000);
}

TEST_CASE("meshoptimizer's codecs give the mesh back exactly", "[io][packed]") {
  const TempFolder folder;
  const Grid grid = test::make_grid(GENERATE(2U, 3U, 40U));
  const std::string mode = GENERATE("TRIANGLES", "INDICES");
  const std::string path = test::meshopt_model(grid, mode).write_packed(folder.file("m.gltf"));
  const mesh::Mesh mesh = io::read_mesh(path);
  check_same(grid, mesh, 0, 0);
  CHECK(io::mesh_cost(path).peak_bytes > mesh.size_bytes());
}

TEST_CASE("meshoptimizer's filters give numbers back", "[io][packed]") {
  const TempFolder folder;
  MeshoptBuilder b;
  // Octahedral normals of 8 bits, positions as exponents, UVs as plain normalised shorts.
  const std::array<float, 12> directions{0, 0, 1, 0, 0.6F, 0, 0.8F, 0, -1, 0, 0, 0};
  std::array<std::uint32_t, 3> packed_normals{};
  meshopt_encodeFilterOct(packed_normals.data(), 3, 4, 8, directions.data());
  const std::array<float, 9> places{0, 0, 0, 1.5F, 0, 0, 0, -2.25F, 1024};
  std::array<std::uint32_t, 9> packed_places{};
  meshopt_encodeFilterExp(packed_places.data(), 3, 12, 15, places.data());
  const std::array<std::uint16_t, 6> uvs{0, 0, 65535, 0, 0, 13107};
  const int position =
      b.packed_accessor(b.packed_view(test::packed_vertices(packed_places.data(), 3, 12),
                                      "ATTRIBUTES", 12, 3, "EXPONENTIAL"),
                        5126, 3, "VEC3");
  const int normal =
      b.packed_accessor(b.packed_view(test::packed_vertices(packed_normals.data(), 3, 4),
                                      "ATTRIBUTES", 4, 3, "OCTAHEDRAL"),
                        5120, 3, "VEC3", true);
  const int uv = b.packed_accessor(
      b.packed_view(test::packed_vertices(uvs.data(), 3, 4), "ATTRIBUTES", 4, 3, "NONE"), 5123, 3,
      "VEC2", true);
  b.primitive({{"POSITION", position}, {"NORMAL", normal}, {"TEXCOORD_0", uv}});
  const mesh::Mesh mesh = io::read_mesh(b.write_packed(folder.file("m.gltf")));
  REQUIRE(mesh.positions.size() == 3);
  for (std::size_t v = 0; v < 3; ++v) {
    CHECK(distance(mesh.positions[v], {places[3 * v], places[3 * v + 1], places[3 * v + 2]}) <=
          0.04);
    CHECK(distance(mesh.normals[v],
                   {directions[4 * v], directions[4 * v + 1], directions[4 * v + 2]}) <= 0.02);
  }
  CHECK(mesh.uv_sets.at(0)[1] == Vec2f{1, 0});
  CHECK(mesh.uv_sets.at(0)[2].y == Approx(0.2));
}

TEST_CASE("packed views that cannot be are refused", "[io][packed]") {
  const TempFolder folder;
  const Grid grid = test::make_grid(4);  // views: positions, normals, UVs, indices
  const auto said = [&](std::size_t view, const json& changes, std::size_t length = 0) {
    MeshoptBuilder b = test::meshopt_model(grid);
    meshopt_of(b, view).update(changes);
    if (length > 0) b.doc["bufferViews"][view]["byteLength"] = length;
    return refusal(b.write_packed(folder.file("m.gltf")));
  };
  CHECK(said(0, json::object()).empty());
  CHECK_THAT(said(0, {{"byteStride", 10}}), Catch::Contains("ATTRIBUTES need a multiple of 4"));
  CHECK_THAT(said(0, {{"byteStride", 260}}), Catch::Contains("byteStride"));
  CHECK_THAT(said(0, {{"byteStride", 0}}), Catch::Contains("byteStride"));
  CHECK_THAT(said(3, {{"byteStride", 1}}), Catch::Contains("indices have 2 or 4 bytes"));
  CHECK_THAT(said(3, {{"count", 53}}), Catch::Contains("53 indices, which are no whole triangles"));
  CHECK_THAT(said(3, {{"filter", "EXPONENTIAL"}}), Catch::Contains("only ATTRIBUTES"));
  CHECK_THAT(said(0, {{"filter", "QUATERNION"}}), Catch::Contains("its filter does not allow"));
  CHECK_THAT(said(0, {{"filter", "COLOR"}}), Catch::Contains("filter is none of"));
  CHECK_THAT(said(0, {{"mode", "POINTS"}}), Catch::Contains("mode is none of"));
  CHECK_THAT(said(0, {{"buffer", 5}}), Catch::Contains("buffer"));
  CHECK_THAT(said(0, {{"byteLength", 1'000'000}}), Catch::Contains("reaches beyond the end"));
  CHECK_THAT(said(0, {{"count", 17}}), Catch::Contains("its view has other sizes"));
  CHECK_THAT(said(0, {{"count", 1'000'000'000}}),
             Catch::Contains("more than") && Catch::Contains("packed bytes hold"));
  CHECK_THAT(said(3, {{"count", 3'000'000'000}}), Catch::Contains("packed bytes hold"));
  CHECK_THAT(said(0, {{"byteLength", 20}}), Catch::Contains("bufferViews[0] cannot be unpacked"));
}

TEST_CASE("many packed views of the same bytes are refused before they are unpacked",
          "[io][packed]") {
  const TempFolder folder;
  // 64 KiB of zeros become 4 MiB; a thousand views of them would be 4 GiB.
  const std::vector<std::uint32_t> zeros(1 << 20);
  const std::string packed = test::packed_vertices(zeros.data(), 1 << 14, 256);
  MeshoptBuilder b;
  b.triangle();
  b.packed_view(packed, "ATTRIBUTES", 256, 1 << 14);
  b.doc["bufferViews"].back().erase("byteStride");
  for (int i = 0; i < 1000; ++i) {
    json view = b.doc["bufferViews"].back();
    b.push("bufferViews", view);
  }
  const std::string path = b.write_packed(folder.file("m.gltf"));
  CHECK_THAT(refusal(path), Catch::Contains("too many for a file of this size"));
  CHECK(test::taken_by([&] { io::read_mesh(path); }).grown_bytes < (64U << 20));
}

TEST_CASE("indices beyond the vertices are refused, packed or not", "[io][packed]") {
  const TempFolder folder;
  Grid grid = test::make_grid(4);
  grid.indices[7] = 16;
  CHECK_THAT(refusal(test::meshopt_model(grid).write_packed(folder.file("m.gltf"))),
             Catch::Contains("is 16, but only 16 vertices exist"));
  grid = test::make_grid(4);
  grid.positions[3].x = std::nanf("");
  CHECK_THAT(refusal(test::meshopt_model(grid).write_packed(folder.file("m.gltf"))),
             Catch::Contains("is not a finite number"));
}

TEST_CASE("mutants of packed views are read or refused", "[io][packed]") {
  const TempFolder folder;
  const Grid grid = test::make_grid(9);
  const std::string mode = GENERATE("TRIANGLES", "INDICES");
  const std::string path = folder.file("m.gltf");
  test::Random random(11);
  int read = 0, refused = 0;
  for (int i = 0; i < 1000; ++i) {
    MeshoptBuilder b = test::meshopt_model(grid, mode);
    for (std::uint64_t flips = 1 + random.below(3); flips > 0; --flips)
      b.buffer[random.below(b.buffer.size())] = static_cast<char>(random.bits());
    std::string problem;
    b.write_packed(path);
    REQUIRE_NOTHROW(problem = refusal(path));
    ++(problem.empty() ? read : refused);
  }
  CHECK(read > 0);
  CHECK(refused > 50);
}

TEST_CASE("a packed view of packed triangles is read", "[io][packed]") {
  const TempFolder folder;
  // Draco's bytes in a view that is packed itself, as numbers of four bytes.
  const Grid grid = test::make_grid(5);
  std::string packed = test::draco_bytes_of(grid);
  while (packed.size() % 4 != 0) packed.push_back('\0');
  const GltfBuilder plain = test::draco_model(packed, 25, 96);
  MeshoptBuilder b;
  b.doc = plain.doc;
  b.doc.erase("bufferViews");
  b.packed_view(test::packed_vertices(packed.data(), packed.size() / 4, 4), "ATTRIBUTES", 4,
                packed.size() / 4);
  check_same(grid, io::read_mesh(b.write_packed(folder.file("m.gltf"))), 1e-4, 2e-4);
}

TEST_CASE("real packed models are the models that were packed", "[io][packed][external]") {
  const auto data = test::test_data();
  if (!data) return;
  struct Pair {
    const char *packed, *plain;
    double most;  ///< distance of corners, by the model's size
  };
  // A head with 14 bits for positions; a duck with 12, and with 3.
  const Pair pair = GENERATE(Pair{"lee_perry_smith/LeePerrySmith.glb",
                                  "lee_perry_smith/LeePerrySmith_plain_textured.glb", 1e-5},
                             Pair{"duck/Duck-vp-12-vt-12-vn-12.glb", "duck/gltf/Duck.gltf", 3e-4},
                             Pair{"duck/Duck-vp-3-vt-3-vn-3.glb", "duck/gltf/Duck.gltf", 0.15});
  CAPTURE(pair.packed);
  const mesh::Mesh packed = io::read_mesh((*data / "meshes" / pair.packed).string());
  const mesh::Mesh plain = io::read_mesh((*data / "meshes" / pair.plain).string());
  REQUIRE(packed.triangles.size() == plain.triangles.size());
  REQUIRE(packed.positions.size() == plain.positions.size());
  // Triangles were put into another order: the nearest corner of the plain model stands for each.
  double worst = 0, size = 0;
  for (const Vec3f& p : plain.positions) size = std::max(size, distance(p, plain.positions[0]));
  for (const Vec3f& p : packed.positions) {
    double nearest = size;
    for (const Vec3f& q : plain.positions) nearest = std::min(nearest, distance(p, q));
    worst = std::max(worst, nearest);
  }
  CHECK(worst <= pair.most * size);
  CHECK(worst > 0);
}

TEST_CASE("the milk truck and the box are read whole", "[io][packed][external]") {
  const auto data = test::test_data();
  if (!data) return;
  // 5,232 + 168 + 864 indices, and two wheels of 2,304; 1,886 vertices where 1,856 are announced.
  const mesh::Mesh truck =
      io::read_mesh((*data / "meshes/milk_truck_draco/CesiumMilkTruck.gltf").string());
  CHECK(truck.triangles.size() == (5232 + 168 + 864 + 2 * 2304) / 3);
  CHECK(truck.positions.size() == 3594);
  const mesh::Mesh box =
      io::read_mesh((*data / "meshes/box_meshopt/BoxTextured_meshopt.glb").string());
  REQUIRE(box.positions.size() == 24);
  for (const Vec3f& p : box.positions) {
    CHECK(std::abs(p.x) == Approx(0.5).margin(1e-4));
    CHECK(std::abs(p.y) == Approx(0.5).margin(1e-4));
    CHECK(std::abs(p.z) == Approx(0.5).margin(1e-4));
  }
  CHECK(box.triangles.size() == 12);
}
