// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>

#include "mesh/mesh.h"
#include "pounce/error.h"

using namespace pounce;
using mesh::Parts;
using mesh::Selection;

namespace {

/// Six triangles, numbered by their first corner: two of node "Head" with the mesh "face", one of
/// "Eye.L", one of "Eye.R" (both of the mesh "eye"), two of "Body".
mesh::Mesh figure() {
  mesh::Mesh m;
  m.path = "figure.glb";
  m.positions.resize(8);
  mesh::PartsBuilder parts;
  const auto add = [&](const std::vector<std::string>& names, std::uint32_t material) {
    parts.start(static_cast<std::uint32_t>(m.triangles.size()), names);
    m.triangles.push_back({static_cast<std::uint32_t>(m.triangles.size()), 6, 7});
    m.triangle_material.push_back(material);
  };
  m.materials.resize(4);
  m.materials[0].name = "skin";
  m.materials[1].name = "cornea";
  m.materials[2].name = "cloth[1]";
  m.materials[3].name = "unused";
  add({"Head", "face"}, 0);
  add({"Head", "face"}, 0);
  add({"Eye.L", "eye"}, 1);
  add({"Eye.R", "eye"}, 1);
  add({"Body", "body"}, 0);
  add({"Body", "body"}, 2);
  m.parts = parts.finish(6);
  return m;
}

std::vector<std::uint32_t> left(const Selection& selection) {
  mesh::Mesh m = figure();
  mesh::select(m, selection, "target");
  std::vector<std::uint32_t> numbers;
  for (const auto& t : m.triangles) numbers.push_back(t[0]);
  CHECK(m.triangle_material.size() == numbers.size());
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    CHECK(m.triangle_material[i] == figure().triangle_material[numbers[i]]);
  }
  return numbers;
}

std::string refusal(const Selection& selection, mesh::Mesh m = figure()) {
  try {
    mesh::select(m, selection, "target");
  } catch (const Error& e) {
    CHECK(e.kind() == ErrorKind::input);
    return e.what();
  }
  FAIL("not refused");
  return {};
}

using Numbers = std::vector<std::uint32_t>;

}  // namespace

TEST_CASE("a selection keeps the triangles of matching parts in file order", "[mesh]") {
  CHECK(left({}) == Numbers{0, 1, 2, 3, 4, 5});
  CHECK(left({{"Head"}, {}}) == Numbers{0, 1});
  CHECK(left({{"face"}, {}}) == Numbers{0, 1});  // the other name of the same triangles
  CHECK(left({{"eye"}, {}}) == Numbers{2, 3});
  CHECK(left({{"Eye.R"}, {}}) == Numbers{3});
  CHECK(left({{"Body", "Eye.?"}, {}}) == Numbers{2, 3, 4, 5});
  CHECK(left({{"*"}, {}}) == Numbers{0, 1, 2, 3, 4, 5});
  CHECK(left({{"[A-D]*"}, {}}) == Numbers{4, 5});
}

TEST_CASE("mesh and material must both be selected", "[mesh]") {
  CHECK(left({{}, {"skin"}}) == Numbers{0, 1, 4});
  CHECK(left({{"Body"}, {"skin"}}) == Numbers{4});
  CHECK(left({{}, {"c*"}}) == Numbers{2, 3, 5});
}

TEST_CASE("patterns are a shell's, and a name with brackets is found as it is", "[mesh]") {
  CHECK(mesh::matches("cloth[1]", "cloth[1]"));
  CHECK(mesh::matches("cloth[1]", "cloth1"));
  CHECK(mesh::matches("cloth\\[*", "cloth[1]"));
  CHECK_FALSE(mesh::matches("cloth", "cloth[1]"));
  CHECK_FALSE(mesh::matches("head", "Head"));
  CHECK_FALSE(mesh::matches("?", ""));
  CHECK(mesh::matches("*", "a/b|c:d"));
  CHECK(mesh::matches("[!A-Z]*", "arm"));
  CHECK_FALSE(mesh::matches("[!A-Z]*", "Arm"));
  CHECK(left({{}, {"cloth[1]"}}) == Numbers{5});
}

TEST_CASE("parts stay right after a selection", "[mesh]") {
  mesh::Mesh m = figure();
  mesh::select(m, {{"Eye.R", "Body"}, {}}, "target");
  CHECK(m.parts.runs == std::vector<Parts::Run>{{0, 2}, {1, 3}});
  mesh::select(m, {{"Body"}, {}}, "target");
  CHECK(m.triangles.size() == 2);
  CHECK(m.triangles[0][0] == 4);
}

TEST_CASE("a selection of nothing lists the names and the nearest", "[mesh]") {
  CHECK(refusal({{"haed"}, {}}) ==
        "figure.glb: --target-mesh haed: matches nothing; available are \"Head\", \"face\", "
        "\"Eye.L\", \"eye\", \"Eye.R\", \"Body\", \"body\"; did you mean \"Head\"?");
  const std::string material = refusal({{}, {"leather"}});
  CHECK(
      material ==
      "figure.glb: --target-material leather: matches nothing; available are \"skin\", \"cornea\", "
      "\"cloth[1]\"");
  const std::string both = refusal({{"Head"}, {"cornea"}});
  CHECK(both.find("no triangle is in both") != std::string::npos);

  mesh::Mesh many;
  many.path = "many.obj";
  many.materials.resize(1);
  mesh::PartsBuilder parts;
  for (std::uint32_t i = 0; i < 25; ++i) {
    parts.start(i, {"part_" + std::to_string(i)});
    many.triangles.push_back({});
    many.triangle_material.push_back(0);
  }
  many.parts = parts.finish(25);
  const std::string text = refusal({{"zzzzzzzzzz*"}, {}}, many);
  CHECK(text.find("\"part_9\" and 15 more") != std::string::npos);
  CHECK(text.find("part_10") == std::string::npos);
  CHECK(text.find("did you mean") == std::string::npos);
}

TEST_CASE("one idle pattern beside a good one is a warning", "[mesh]") {
  mesh::Mesh m = figure();
  mesh::select(m, {{"Head", "Tail*"}, {}}, "source");
  CHECK(m.triangles.size() == 2);
  REQUIRE(m.warnings.size() == 1);
  CHECK(m.warnings[0].find("--source-mesh Tail*: matches nothing") != std::string::npos);
}

TEST_CASE("parts without triangles leave no trace", "[mesh]") {
  mesh::PartsBuilder parts;
  parts.start(0, {"empty"});
  parts.start(0, {"a", "", "a"});
  parts.start(3, {"nothing"});
  parts.start(3, {"a"});
  const Parts made = parts.finish(5);
  CHECK(made.names == std::vector<std::string>{"a"});
  CHECK(made.runs == std::vector<Parts::Run>{{0, 0}});
  CHECK(made.part_names == std::vector<std::vector<std::uint32_t>>{{0}});
}
