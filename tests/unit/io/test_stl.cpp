// SPDX-License-Identifier: Apache-2.0
#include <bit>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>

#include "io/read_mesh.h"
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

using Facet = std::array<Vec3f, 3>;

std::string binary(const std::vector<Facet>& facets, const std::string& head = "") {
  std::string out = head;
  out.resize(80, ' ');
  const auto append = [&](const auto& value) {
    out.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  append(static_cast<std::uint32_t>(facets.size()));
  for (const Facet& facet : facets) {
    append(Vec3f{});
    append(facet);
    append(std::uint16_t{0x7FFF});
  }
  return out;
}

std::string text(const std::vector<Facet>& facets, const std::string& name) {
  std::string out = "solid " + name + "\n";
  for (const Facet& facet : facets) {
    out += " facet normal 0 0 0\n  outer loop\n";
    for (const Vec3f& p : facet) {
      out += "   vertex " + std::to_string(p.x) + " " + std::to_string(p.y) + " " +
             std::to_string(p.z) + "\n";
    }
    out += "  endloop\n endfacet\n";
  }
  return out + "endsolid " + name + "\n";
}

/// Four corners, each the end of three facets.
std::vector<Facet> tetrahedron() {
  const Vec3f o{0, 0, 0}, x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
  return {{{o, y, x}}, {{o, x, z}}, {{o, z, y}}, {{x, y, z}}};
}

}  // namespace

TEST_CASE("STL is read as binary and as text", "[io][stl]") {
  const TempFolder folder;
  const auto [name, bytes] =
      GENERATE(std::pair("binary", binary(tetrahedron())),
               std::pair("binary that says solid", binary(tetrahedron(), "solid exported")),
               std::pair("text", text(tetrahedron(), "")));
  CAPTURE(name);
  write_file(folder.file("m.stl"), bytes);
  const mesh::Mesh mesh = io::read_mesh(folder.file("m.stl"));
  REQUIRE(mesh.triangles.size() == 4);
  // All edges are sharp: three copies of each of the four places, first the places themselves.
  CHECK(mesh.positions.size() == 12);
  CHECK(mesh.positions[0] == Vec3f{0, 0, 0});
  CHECK(mesh.positions[3] == Vec3f{0, 0, 1});
  CHECK(mesh.normals[mesh.triangles[0][0]] == Vec3f{0, 0, -1});
  CHECK(mesh.normals[mesh.triangles[3][1]].x == Approx(std::sqrt(1.0 / 3)));
  CHECK(mesh.uv_sets.empty());
  CHECK(mesh.materials.at(0).name == "default");
  CHECK(io::mesh_cost(folder.file("m.stl")).kept_bytes >= mesh.size_bytes());
}

TEST_CASE("corners of an STL at one place are one vertex", "[io][stl]") {
  const TempFolder folder;
  // A flat square; one place is written with both zeros, another is off by one step of a float.
  const float next = std::nextafter(1.0F, 2.0F);
  write_file(folder.file("m.stl"), binary({{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}}},
                                           {{{-0.0F, 0, 0}, {1, 1, 0}, {0, 1, 0}}},
                                           {{{1, 0, 0}, {2, 0, 0}, {next, 1, 0}}}}));
  const mesh::Mesh mesh = io::read_mesh(folder.file("m.stl"));
  CHECK(mesh.positions.size() == 6);
  CHECK(mesh.triangles[1] == std::array<std::uint32_t, 3>{0, 2, 3});
}

TEST_CASE("solids of an STL are parts", "[io][stl]") {
  const TempFolder folder;
  write_file(folder.file("m.stl"),
             text(tetrahedron(), "left hand") + "SOLID\nendsolid\n" + text(tetrahedron(), "b"));
  const mesh::Mesh mesh = io::read_mesh(folder.file("m.stl"));
  CHECK(mesh.triangles.size() == 8);
  CHECK(mesh.parts.names == std::vector<std::string>{"left hand", "b"});
  CHECK(mesh.parts.runs.at(1).first_triangle == 4);
}

TEST_CASE("a damaged STL is refused", "[io][stl]") {
  const TempFolder folder;
  const auto said = [&](const std::string& bytes) {
    write_file(folder.file("m.stl"), bytes);
    return refusal(folder.file("m.stl"));
  };
  const std::string good = binary(tetrahedron()), words = text(tetrahedron(), "a");
  CHECK_THAT(said(""), Catch::Contains("empty"));
  CHECK_THAT(said(good.substr(0, 40)), Catch::Contains("has 40 bytes"));
  CHECK_THAT(said(good.substr(0, 283)),
             Catch::Contains("truncated: its 4 triangles take 284 bytes, but the file has 283"));
  CHECK(said(good + "more").empty());
  CHECK_THAT(said(binary({})), Catch::Contains("no triangles"));
  CHECK_THAT(said("solid a\nendsolid a\n"), Catch::Contains("no triangles"));
  std::string bad = good;
  const float nan = std::nanf("");
  std::memcpy(bad.data() + 84 + 50 + 12, &nan, 4);
  CHECK_THAT(said(bad), Catch::Contains("triangle 1 has a corner that is not a finite number"));
  const auto replaced = [&](const std::string& from, const std::string& to) {
    std::string out = words;
    return out.replace(out.find(from), from.size(), to);
  };
  CHECK_THAT(said(replaced("vertex 0.000000", "vertex nan")),
             Catch::Contains("line 4: a vertex holds \"nan\""));
  CHECK_THAT(said(replaced("  endloop", "   vertex 1 2 3\n  endloop")),
             Catch::Contains("more than three corners"));
  CHECK_THAT(said(replaced("   vertex 1.000000 0.000000 0.000000\n", "")),
             Catch::Contains("fewer than three corners"));
  CHECK_THAT(said(replaced("outer", "inner")), Catch::Contains("line 3 holds \"inner\""));
  CHECK_THAT(said(words.substr(0, words.find("vertex") + 20)),
             Catch::Contains("not a finite number"));
}

TEST_CASE("reading an STL takes no more memory than its cost says", "[io][stl]") {
  const TempFolder folder;
  const bool apart = GENERATE(false, true);
  std::vector<Facet> facets;
  for (int i = 0; i < 100'000; ++i) {
    const auto x = static_cast<float>(i), step = apart ? 0.25F : 1.0F;
    facets.push_back({{{x, 0, 0}, {x + step, 0, 0}, {x, step, 0}}});
  }
  const std::string path = folder.file("m.stl");
  write_file(path, GENERATE(false, true) ? binary(facets) : text(facets, ""));
  const io::MeshCost cost = io::mesh_cost(path);
  const test::Taken taken = test::taken_by([&] { io::read_mesh(path); });
  CHECK(taken.status == 0);
  CHECK(taken.grown_bytes <= cost.peak_bytes);
}

TEST_CASE("mutants of an STL are read or refused", "[io][stl]") {
  const TempFolder folder;
  const std::string good = GENERATE(binary(tetrahedron()), text(tetrahedron(), "a"));
  test::Random random(3);
  int read = 0, refused = 0;
  for (int i = 0; i < 2000; ++i) {
    std::string mutant = good;
    for (std::uint64_t flips = 1 + random.below(3); flips > 0; --flips)
      mutant[random.below(mutant.size())] = static_cast<char>(random.bits());
    if (random.one_in(8)) mutant.resize(random.below(mutant.size()));
    write_file(folder.file("m.stl"), mutant);
    std::string problem;
    INFO("mutant " << i);
    REQUIRE_NOTHROW(problem = refusal(folder.file("m.stl")));
    ++(problem.empty() ? read : refused);
  }
  CHECK(read > 20);
  CHECK(refused > 100);
}
