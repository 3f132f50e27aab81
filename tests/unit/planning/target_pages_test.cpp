// SPDX-License-Identifier: Apache-2.0
//
// Which texture sets and UDIM tiles of a target get images, and which triangles are on each.
#include "planning/target_pages.h"

#include <catch2/catch.hpp>

#include "support/bytes.h"

using namespace pounce;
using namespace pounce::planning;

namespace {

/// A mesh whose triangles have these lowest UVs, each 0.5 wide and high, and these materials.
mesh::Mesh mesh_of(const std::vector<std::pair<Vec2f, std::uint32_t>>& triangles) {
  mesh::Mesh made;
  made.path = "t.obj";
  made.materials.resize(3);
  for (std::size_t m = 0; m < 3; ++m) made.materials[m].name = "m" + std::to_string(m);
  made.uv_sets.resize(1);
  made.uv_present.resize(1);  // empty: all have
  for (const auto& [low, material] : triangles) {
    const auto first = static_cast<std::uint32_t>(made.positions.size());
    made.positions.insert(made.positions.end(), 3, Vec3f{});
    made.uv_sets[0].insert(made.uv_sets[0].end(),
                           {low, {low.x + 0.5F, low.y}, {low.x, low.y + 0.5F}});
    made.triangles.push_back({first, first + 1, first + 2});
    made.triangle_material.push_back(material);
  }
  return made;
}

/// Set, UDIM and triangles of each page.
struct Found {
  std::vector<std::string> pages;
  std::vector<std::string> warnings;
};
Found find(const mesh::Mesh& mesh, const PageRequest& request) {
  Found found;
  const TargetPages pages = target_pages(mesh, request, found.warnings);
  for (std::size_t p = 0; p < pages.pages.size(); ++p) {
    std::string text = pages.pages[p].set + " " + std::to_string(pages.pages[p].udim) + ":";
    for (const std::uint32_t t : pages.triangles->of(static_cast<std::uint32_t>(p)))
      text += " " + std::to_string(t);
    found.pages.push_back(text);
  }
  return found;
}

PageRequest by_material() { return {true, false, {}, 0}; }
PageRequest by_tile(std::vector<std::uint32_t> selected = {}) {
  return {false, true, std::move(selected), 0};
}

using Texts = std::vector<std::string>;

TEST_CASE("without tiles all triangles share a page, or those of a material do") {
  const mesh::Mesh mesh = mesh_of({{{0, 0}, 2}, {{0.2F, 0}, 0}, {{0.4F, 0.4F}, 2}});
  CHECK(find(mesh, {}).pages == Texts{"default 1001: 0 1 2"});
  // In the order in which the triangles name them; the material without triangles has no page.
  const Found found = find(mesh, by_material());
  CHECK(found.pages == Texts{"m2 1001: 0 2", "m0 1001: 1"});
  CHECK(found.warnings.empty());
}

TEST_CASE("UVs in one tile wrap without a warning, whichever it is") {
  // Each material has a tile of its own, up to its edges.
  CHECK(
      find(mesh_of({{{1, 0}, 0}, {{1.5F, 0.5F}, 0}, {{0, 2}, 1}}), by_material()).warnings.empty());
  CHECK(find(mesh_of({{{1, 0}, 0}}), {}).warnings.empty());
  // One image for both, or one material in both.
  CHECK(find(mesh_of({{{1, 0}, 0}, {{0, 2}, 1}}), {}).warnings.size() == 1);
  const Found found = find(mesh_of({{{1, 0}, 0}, {{0.9F, 0}, 0}, {{3, 0}, 1}}), by_material());
  REQUIRE(found.warnings.size() == 1);
  CHECK(found.warnings[0].find("of 2 triangles") != std::string::npos);
}

TEST_CASE("without tiles UVs wrap into the image, with a warning") {
  const Found found = find(mesh_of({{{0, 0}, 0}, {{3, 0}, 0}}), {});
  CHECK(found.pages == Texts{"default 1001: 0 1"});
  REQUIRE(found.warnings.size() == 1);
  CHECK(found.warnings[0].find("the UVs of 1 triangles") != std::string::npos);
}

TEST_CASE(
    "tiles come in rising order, and a triangle is on every tile that it shares an area with") {
  const mesh::Mesh mesh =
      mesh_of({{{0.1F, -0.9F}, 1}, {{0.8F, 0.1F}, 0}, {{0.5F, 0}, 1}, {{2, 0}, 0}});
  // v points down here, so that the second row of tiles is above 0. Triangle 1 crosses from 1001
  // into 1002; triangle 2 touches 1002 in a corner alone.
  CHECK(find(mesh, by_tile()).pages ==
        Texts{"default 1001: 1 2", "default 1002: 1", "default 1003: 3", "default 1011: 0"});
  // In a tile the sets come in the order of the file.
  CHECK(find(mesh, {true, true, {}, 0}).pages ==
        Texts{"m1 1001: 2", "m0 1001: 1", "m0 1002: 1", "m0 1003: 3", "m1 1011: 0"});
}

TEST_CASE("selected tiles alone get pages, and those without UVs are named") {
  const mesh::Mesh mesh = mesh_of({{{0, 0}, 0}, {{1, 0}, 0}, {{2, 0}, 0}});
  const Found found = find(mesh, by_tile({1002, 1003, 1050}));
  CHECK(found.pages == Texts{"default 1002: 1", "default 1003: 2"});
  REQUIRE(found.warnings.size() == 1);
  CHECK(found.warnings[0].find("1050") != std::string::npos);
  std::string message;
  CHECK(test::error_kind([&] { find(mesh, by_tile({1042})); }, &message) ==
        static_cast<int>(ErrorKind::input));
  CHECK(message.find("1001-1003") != std::string::npos);
}

TEST_CASE("triangles without UVs, or beyond the UDIM grid, are counted and left out") {
  mesh::Mesh mesh = mesh_of({{{0, 0}, 0}, {{11, 0}, 0}, {{0, 0}, 0}});
  mesh.uv_present[0].assign(9, true);
  mesh.uv_present[0][7] = false;
  const Found found = find(mesh, by_tile());
  CHECK(found.pages == Texts{"default 1001: 0"});
  REQUIRE(found.warnings.size() == 2);
  CHECK(found.warnings[0].find("1 of 3 triangles have no UVs") != std::string::npos);
  CHECK(found.warnings[1].find("the UVs of 1 triangles") != std::string::npos);
}

TEST_CASE("a target that no image could show is refused") {
  const int kInput = static_cast<int>(ErrorKind::input);
  CHECK(test::error_kind([] { find(mesh_of({}), {}); }) == kInput);
  CHECK(test::error_kind([] { find(mesh_of({{{0, 0}, 0}}), {false, false, {}, 1}); }) == kInput);
  CHECK(test::error_kind([] { find(mesh_of({{{-3, 0}, 0}}), by_tile()); }) == kInput);
}

TEST_CASE("a page's tokens are safe in file names") {
  const TargetPage page{"a/b", 0, 1013};
  CHECK(page.tokens() == std::map<std::string, std::string>{
                             {"MATERIAL", "a_b"}, {"UDIM", "1013"}, {"UVTILE", "u3_v2"}});
}

}  // namespace
