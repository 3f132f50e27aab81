// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>

#include "io/obj/polygon.h"
#include "read_error.h"
#include "support/gltf_builder.h"
#include "support/random.h"
#include "support/test_data.h"

using namespace pounce;
using test::refusal;
using test::TempFolder;
using test::write_file;
using Triangle = std::array<std::uint32_t, 3>;

namespace {

mesh::Mesh read(const std::string& text) {
  const TempFolder folder;
  write_file(folder.file("m.obj"), text);
  return io::read_mesh(folder.file("m.obj"));
}

std::string refused(const std::string& text) {
  const TempFolder folder;
  write_file(folder.file("m.obj"), text);
  return refusal(folder.file("m.obj"));
}

const std::string kQuad = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

double area(const std::vector<Vec3f>& corners, const std::vector<Triangle>& triangles) {
  double sum = 0;
  for (const auto& t : triangles) {
    sum += cross(Vec3d(corners[t[1]] - corners[t[0]]), Vec3d(corners[t[2]] - corners[t[0]])).z / 2;
  }
  return sum;
}

}  // namespace

TEST_CASE("OBJ corners with equal indices are one vertex, and v is turned over", "[io]") {
  const mesh::Mesh m = read(kQuad +
                            "vt 0 0\nvt 1 0.25\nvt 1 1\nvt 0 1\nvn 0 0 2\n"
                            "f 1/1/1 2/2/1 3/3/1\nf 1/1/1 3/3/1 4/4/1\n");
  CHECK(m.positions == std::vector<Vec3f>{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}});
  CHECK(m.triangles == std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}});
  CHECK(m.uv_sets.at(0) == std::vector<Vec2f>{{0, 1}, {1, .75F}, {1, 0}, {0, 0}});
  CHECK(m.normals == std::vector<Vec3f>(4, {0, 0, 1}));
  CHECK(m.tangents[0].w == 1);
  CHECK(m.materials.at(0).name == "default");
}

TEST_CASE("negative indices count from the last line before the face", "[io]") {
  const mesh::Mesh m =
      read(kQuad + "vn 0 0 1\nf -4//-1 -3//-1 -2//-1\nv 9 9 9\nf -5//1 -3//1 -2//1\n");
  CHECK(m.triangles == std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}});
  CHECK(m.positions[3] == Vec3f{0, 1, 0});
}

TEST_CASE("what is not surface is ignored", "[io]") {
  const mesh::Mesh m = read("# head\n#MRGB ff00ff\no head\ng a b c\n\ns 1\n" + kQuad +
                            "vp 0.3\nl 1 2\np 1\ncstype bspline\r\n\tf 1 2 \\\n 3\t4 \r\n");
  CHECK(m.triangles.size() == 2);
  CHECK(m.uv_sets.empty());
  CHECK(m.normals == std::vector<Vec3f>(4, {0, 0, 1}));
}

TEST_CASE("a last line without an end is read", "[io]") {
  CHECK(read(kQuad + "f 1 2 3").triangles.size() == 1);
}

TEST_CASE("concave polygons are cut along their inside", "[io]") {
  // An L: a fan from corner 0 would leave it.
  const std::vector<Vec3f> ell{{2, 0, 0}, {2, 1, 0}, {1, 1, 0}, {1, 2, 0}, {0, 2, 0}, {0, 0, 0}};
  const auto triangles = io::triangulate(ell);
  CHECK(triangles.size() == 4);
  CHECK(area(ell, triangles) == 3);
  for (const auto& t : triangles) CHECK(area(ell, {t}) > 0);
  // The same in the other planes, and seen from behind.
  for (int turn = 0; turn < 3; ++turn) {
    std::vector<Vec3f> turned, reversed;
    for (const Vec3f p : ell) {
      turned.push_back(turn == 0 ? p : turn == 1 ? Vec3f{p.z, p.x, p.y} : Vec3f{p.y, p.z, p.x});
    }
    reversed.assign(turned.rbegin(), turned.rend());
    for (const auto& corners : {turned, reversed}) {
      double sum = 0;
      for (const auto& t : io::triangulate(corners)) {
        sum += length(cross(Vec3d(corners[t[1]] - corners[t[0]]),
                            Vec3d(corners[t[2]] - corners[t[0]]))) /
               2;
      }
      CHECK(sum == 3);
    }
  }
}

/// The rule that triangulate() follows, in the plainest way, for polygons in the xy plane: cut the
/// first ear off, again and again.
std::vector<std::array<std::uint32_t, 3>> first_ears(const std::vector<Vec3f>& corners) {
  const auto turn = [&](std::uint32_t i, std::uint32_t j, std::uint32_t k) {
    const Vec3d a(corners[i]), b(corners[j]), c(corners[k]);
    return (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
  };
  std::vector<std::uint32_t> ring;
  for (std::uint32_t i = 0; i < corners.size(); ++i) ring.push_back(i);
  std::vector<std::array<std::uint32_t, 3>> out;
  const auto is_ear = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    if (turn(a, b, c) <= 0) return false;
    return std::none_of(ring.begin(), ring.end(), [&](std::uint32_t p) {
      const Vec3f at = corners[p];
      if (at == corners[a] || at == corners[b] || at == corners[c]) return false;
      return turn(a, b, p) >= 0 && turn(b, c, p) >= 0 && turn(c, a, p) >= 0;
    });
  };
  for (std::size_t i = 0; i < ring.size() && ring.size() > 3; ++i) {
    const std::size_t n = ring.size();
    const std::uint32_t a = ring[(i + n - 1) % n], b = ring[i], c = ring[(i + 1) % n];
    if (!is_ear(a, b, c)) continue;
    out.push_back({a, b, c});
    ring.erase(ring.begin() + static_cast<std::ptrdiff_t>(i));
    i = static_cast<std::size_t>(-1);
  }
  for (std::size_t i = 1; i + 1 < ring.size(); ++i) out.push_back({ring[0], ring[i], ring[i + 1]});
  return out;
}

TEST_CASE("ears are cut in the order of the corners", "[io]") {
  test::Random random(11);
  for (int round = 0; round < 3000; ++round) {
    const int n = 4 + static_cast<int>(random.bits() % 40);
    std::vector<Vec3f> corners;
    for (int i = 0; i < n; ++i) {
      // Stars; and corners of a coarse grid, which touch and cross each other.
      const double angle = 6.283185307179586 * i / n, radius = 0.2 + double(random.bits() % 100);
      if (round % 2 == 0) {
        corners.push_back({float(radius * std::cos(angle)), float(radius * std::sin(angle)), 0});
      } else {
        corners.push_back({float(random.bits() % 5), float(random.bits() % 5), 0});
      }
    }
    // Seen from below, or convex, it is another matter.
    Vec3d sum;
    bool concave = false;
    for (int i = 0; i < n; ++i) {
      const auto at = [&](int k) { return Vec3d(corners[static_cast<std::size_t>((i + k) % n)]); };
      sum = sum + cross(at(0), at(1));
      concave = concave || cross(at(1) - at(0), at(2) - at(0)).z < 0;
    }
    if (sum.z <= 0 || !concave) continue;
    CAPTURE(round);
    REQUIRE(io::triangulate(corners) == first_ears(corners));
  }
}

TEST_CASE("a huge polygon is cut in a moment", "[io]") {
  std::vector<Vec3f> star;
  for (int i = 0; i < 200000; ++i) {
    const double angle = i * 2 * 3.14159265358979 / 200000, radius = i % 2 == 0 ? 1 : .9;
    star.push_back(Vec3f(Vec3d{std::cos(angle) * radius, std::sin(angle) * radius, 0}));
  }
  CHECK(io::triangulate(star).size() == 199998);
}

TEST_CASE("missing normals are smooth up to 60 degrees and sharp above", "[io]") {
  // Two squares folded along the y axis.
  const auto folded = [](double degrees) {
    const double a = degrees * 3.14159265358979323846 / 180;
    return read("v -1 0 0\nv 0 0 0\nv 0 1 0\nv -1 1 0\nv " + std::to_string(std::cos(a)) + " 0 " +
                std::to_string(-std::sin(a)) + "\nv " + std::to_string(std::cos(a)) + " 1 " +
                std::to_string(-std::sin(a)) + "\nf 1 2 3 4\nf 2 5 6 3\n");
  };
  const mesh::Mesh smooth = folded(50);
  CHECK(smooth.positions.size() == 6);
  // Vertex 2 touches triangles (1,2,3) and (2,5,6) (2,6,3): a third left, two thirds right.
  const double s = std::sin(50 * 3.14159265358979323846 / 180),
               c = std::cos(50 * 3.14159265358979323846 / 180);
  const Vec3d expected = Vec3d{2 * s, 0, 1 + 2 * c} * (1 / length(Vec3d{2 * s, 0, 1 + 2 * c}));
  CHECK(length(Vec3d(smooth.normals[1]) - expected) < 1e-5);
  const mesh::Mesh sharp = folded(70);
  CHECK(sharp.positions.size() == 8);
  for (std::size_t i = 0; i < sharp.triangles.size(); ++i) {
    const auto& t = sharp.triangles[i];
    const Vec3d a(sharp.positions[t[0]]), b(sharp.positions[t[1]]), d(sharp.positions[t[2]]);
    const Vec3d face = cross(b - a, d - a) * (1 / length(cross(b - a, d - a)));
    for (const std::uint32_t corner : t) CHECK(length(Vec3d(sharp.normals[corner]) - face) < 1e-6);
  }
}

TEST_CASE("smooth normals do not break at UV seams", "[io]") {
  const mesh::Mesh m = read(
      "v -1 0 0\nv 0 0 0.2\nv 0 1 0.2\nv -1 1 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
      "f 1/1 2/2 3/3 4/4\nf 2/1 5/2 6/3 3/4\n");
  std::map<float, Vec3f> by_y;  // normals on the seam x = 0
  for (std::size_t i = 0; i < m.positions.size(); ++i) {
    if (m.positions[i].x != 0) continue;
    const auto [it, is_new] = by_y.try_emplace(m.positions[i].y, m.normals[i]);
    if (!is_new) CHECK(it->second == m.normals[i]);
  }
  CHECK(by_y.size() == 2);
  CHECK(m.positions.size() == 8);
}

TEST_CASE("faces with and without texture coordinates can share a file", "[io]") {
  const mesh::Mesh m = read(kQuad + "vt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\nf 1 3 4\n");
  REQUIRE(m.uv_present.size() == 1);
  CHECK(m.uv_present[0] == std::vector<bool>{true, true, true, false, false, false});
  CHECK_FALSE(m.has_uv(0, 3));
}

TEST_CASE("MTL materials give textures, factors and wrap modes", "[io]") {
  const TempFolder folder;
  write_file(folder.file("my skin.png"), "png");
  write_file(folder.file("glow.png"), "png");
  write_file(folder.file("my head.mtl"),
             "newmtl the skin\r\nKd 0.5 0.25 1\r\nd 0.5\r\nmap_Kd textures\\my skin.png\r\n"
             "newmtl glow\nmap_Kd -clamp on gone.png\nKe 0 0 0\nmap_Ke glow.png\nmap_Pr rough.png\n"
             "newmtl plain\n");
  const std::string uv = "vt 0 0\nvt 1 0\nvt 1 1\n";
  write_file(folder.file("m.obj"),
             "mtllib my head.mtl\n" + kQuad + uv +
                 "usemtl glow\nf 1/1 2/2 3/3\nusemtl the skin \nf 1/1 2/2 3/3\n"
                 "usemtl plain\nf 1/1 2/2 3/3\nusemtl glow\nf 1/1 2/2 3/3\n");
  const mesh::Mesh m = io::read_mesh(folder.file("m.obj"));
  CHECK(m.triangle_material == std::vector<std::uint32_t>{0, 1, 2, 0});
  REQUIRE(m.materials.size() == 3);
  const mesh::Material &glow = m.materials[0], &skin = m.materials[1], &plain = m.materials[2];
  CHECK(skin.name == "the skin");
  CHECK(skin.factors[0] == std::array<float, 4>{.5F, .25F, 1, .5F});
  REQUIRE(skin.textures[0].has_value());
  // Not in "textures", but beside the MTL.
  CHECK(m.images.at(skin.textures[0]->image).path == folder.file("my skin.png"));
  CHECK(m.images.at(skin.textures[0]->image).problem.empty());
  CHECK(skin.textures[0]->wrap_u == mesh::Wrap::repeat);
  CHECK(skin.textures[0]->transform == mesh::UvTransform{});
  REQUIRE(glow.textures[0].has_value());
  CHECK(glow.textures[0]->wrap_v == mesh::Wrap::clamp);
  CHECK_THAT(m.images.at(glow.textures[0]->image).problem, Catch::Contains("missing"));
  CHECK(glow.factors[0] == std::array<float, 4>{1, 1, 1, 1});
  REQUIRE(glow.textures[static_cast<std::size_t>(Channel::emissive)].has_value());
  CHECK(glow.factors[static_cast<std::size_t>(Channel::emissive)] ==
        std::array<float, 4>{1, 1, 1, 1});
  CHECK_FALSE(glow.textures[static_cast<std::size_t>(Channel::metallic_roughness)].has_value());
  CHECK(plain.factors[0] == std::array<float, 4>{1, 1, 1, 1});
  CHECK(m.warnings.empty());
  REQUIRE(glow.other_textures.size() == 1);
  CHECK(glow.other_textures[0].slot == "map_Pr");
  CHECK(m.images.at(glow.other_textures[0].image).path == folder.file("rough.png"));
}

TEST_CASE("a missing MTL file or material is a warning", "[io]") {
  const mesh::Mesh m = read("mtllib gone.mtl\n" + kQuad + "usemtl skin\nf 1 2 3 4\n");
  CHECK(m.materials.at(0).name == "skin");
  REQUIRE(m.warnings.size() == 2);
  CHECK_THAT(m.warnings[0], Catch::Contains("gone.mtl"));
  REQUIRE(m.unread_files.size() == 1);
  CHECK_THAT(m.unread_files[0].path, Catch::EndsWith("gone.mtl"));
  CHECK(m.unread_files[0].refused.empty());
}

TEST_CASE("bad OBJ lines are refused, naming file and line", "[io]") {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {kQuad + "f 1 2 9\n", "line 5: a face refers to vertex 9, but only 4"},
      {kQuad + "f 1 2 -9\n", "line 5: a face refers to vertex -9"},
      {kQuad + "f 1 2 0\n", "line 5: the corner \"0\" has index 0"},
      {kQuad + "vt 0 0\nf 1/1 2/2 3/1\n",
       "line 6: a face refers to texture coordinate 2, but only 1"},
      {kQuad + "f 1//1 2//1 3//1\n", "line 5: a face refers to normal 1, but only 0"},
      {kQuad + "f 1 2 x\n", "line 5: the corner \"x\""},
      {kQuad + "f 1 2 3/2f\n", "line 5"},
      {kQuad + "f 1 2 99999999999999999999\n", "line 5"},
      {kQuad + "f 1/1/1/1 2 3\n", "line 5"},
      {"v 0 0 nan\n" + kQuad, "line 1: a vertex holds \"nan\""},
      {"\n\nv 0 0 inf\n" + kQuad, "line 3: a vertex holds \"inf\""},
      {"v 0 0 1e300\n" + kQuad, "line 1: a vertex is too large"},
      {"v 0 0 1e999\n" + kQuad, "line 1: a vertex is too large"},
      {"v 0 0\n" + kQuad, "line 1: a vertex has 2 numbers, but needs 3"},
      {"v 0 0 1,5\n" + kQuad, "line 1: a vertex holds \"1,5\""},
      {"vt nan 0\n" + kQuad, "line 1: a texture coordinate holds"},
      {"vn 0 1 -nan\n" + kQuad, "line 1: a normal holds"},
      {kQuad, "no faces"},
      {kQuad + "f 1 2\n", "no faces (4 vertices, 1 faces with fewer than 3 corners)"},
      {"", "no faces"},
  };
  for (const auto& [text, message] : cases) {
    INFO(text);
    CHECK_THAT(refused(text), Catch::Contains(message));
  }
}

TEST_CASE("numbers in every notation are read", "[io]") {
  const mesh::Mesh m = read("v +1.5e0 -.5 5.\nv 1E-400 0 0 1.0\nv 0 1 0 nan 0 0\nf 1 2 3\n");
  CHECK(m.positions[0] == Vec3f{1.5F, -.5F, 5});
  CHECK(m.positions[1] == Vec3f{0, 0, 0});
}

TEST_CASE("the cost of an OBJ bounds what it takes, and not by much", "[io]") {
  const TempFolder folder;
  std::string text = "vn 0 0 1\n";
  const int n = 150;
  for (int i = 0; i <= n * (n + 1); ++i) {
    text += "v " + std::to_string(i % n) + " " + std::to_string(i / n) + " 0\nvt 0." +
            std::to_string(i) + " 0\n";
  }
  for (int y = 0; y < n; ++y) {
    for (int x = 1; x < n; ++x) {
      const auto corner = [&](int i) {
        return " " + std::to_string(i) + "/" + std::to_string(i) + "/1";
      };
      text += "f" + corner(y * n + x) + corner(y * n + x + 1) + corner(y * n + n + x + 1) +
              corner(y * n + n + x) + "\n";
    }
  }
  write_file(folder.file("m.obj"), text);
  const io::MeshCost cost = io::mesh_cost(folder.file("m.obj"));
  const mesh::Mesh m = io::read_mesh(folder.file("m.obj"));
  CHECK(m.positions.size() == n * (n + 1));
  CHECK(cost.kept_bytes >= m.size_bytes());
  CHECK(cost.kept_bytes < m.size_bytes() / 5 * 6 + (1 << 20));
  CHECK(cost.peak_bytes >= cost.kept_bytes);
}
