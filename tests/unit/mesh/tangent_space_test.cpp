// SPDX-License-Identifier: Apache-2.0
#include "mesh/tangent_space.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <string>
#include <tuple>

#include "io/read_mesh.h"
#include "support/test_data.h"

using namespace pounce;
using mesh::Mesh;

namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;

struct Known {
  std::string name;
  Mesh mesh;  ///< a vertex per corner
  std::vector<Vec4f> tangents;
};

/// Tangents recorded from the reference implementation; see mikk_corners.js.
std::vector<Known> recorded() {
  std::ifstream file(std::string(POUNCE_SOURCE_DIR) + "/tests/unit/mesh/mikk_corners.txt");
  std::vector<Known> all;
  std::string word;
  for (std::size_t corners = 0; file >> word;) {
    Known& known = all.emplace_back();
    file >> known.name >> corners;
    Mesh& m = known.mesh;
    m.materials.emplace_back();
    m.uv_sets.resize(1);
    m.uv_present.resize(1);
    for (std::uint32_t i = 0; i < corners; ++i) {
      Vec3f p, n;
      Vec2f uv;
      Vec4f t;
      file >> p.x >> p.y >> p.z >> n.x >> n.y >> n.z >> uv.x >> uv.y >> t.x >> t.y >> t.z >> t.w;
      m.positions.push_back(p);
      m.normals.push_back(n);
      m.uv_sets[0].push_back({uv.x, -uv.y});  // the reference's v is up
      known.tangents.push_back(t);
      if (i % 3 == 0) m.triangles.push_back({i, i + 1, i + 2});
    }
    m.tangents.resize(corners);
    m.triangle_material.assign(m.triangles.size(), 0);
  }
  return all;
}

double degrees_between(Vec4f a, Vec4f b) {
  const Vec3d u{a.x, a.y, a.z}, v{b.x, b.y, b.z};
  return std::atan2(length(cross(u, v)), dot(u, v)) / kDegree;
}

/// The same surface with equal corners as one vertex.
Mesh welded(const Mesh& in) {
  Mesh out = in;
  std::map<std::tuple<float, float, float, float, float, float, float, float>, std::uint32_t> seen;
  for (auto& triangle : out.triangles) {
    for (std::uint32_t& v : triangle) {
      const Vec3f &p = in.positions[v], &n = in.normals[v];
      const Vec2f t = in.uv_sets[0][v];
      v = seen.try_emplace({p.x, p.y, p.z, n.x, n.y, n.z, t.x, t.y}, v).first->second;
    }
  }
  return out;
}

}  // namespace

TEST_CASE("tangents are those of the reference implementation", "[mesh]") {
  const std::vector<Known> all = recorded();
  REQUIRE(all.size() == 7);
  for (const Known& known : all) {
    const mesh::CornerTangents made = mesh::mikk_tangents(known.mesh, {0});
    for (std::size_t c = 0; c < known.tangents.size(); ++c) {
      CAPTURE(known.name, c);
      const Vec4f t = made.tangents[made.of_corner[c]];
      CHECK(degrees_between(t, known.tangents[c]) < 0.01);
      const bool is_known = !(t.x == 1 && t.y == 0 && t.z == 0);
      if (is_known) CHECK(t.w == known.tangents[c].w);
    }
  }
}

TEST_CASE("tangents do not depend on how vertices are shared", "[mesh]") {
  for (const Known& known : recorded()) {
    const Mesh shared = welded(known.mesh);
    const mesh::CornerTangents a = mesh::mikk_tangents(known.mesh, {0});
    const mesh::CornerTangents b = mesh::mikk_tangents(shared, {0});
    for (std::size_t c = 0; c < known.tangents.size(); ++c) {
      CAPTURE(known.name, c);
      CHECK(a.tangents[a.of_corner[c]] == b.tangents[b.of_corner[c]]);
    }
  }
}

TEST_CASE("a vertex is split where its corners' tangents differ, and only there", "[mesh]") {
  for (const Known& known : recorded()) {
    Mesh m = welded(known.mesh);
    const Mesh before = m;
    const mesh::CornerTangents made = mesh::mikk_tangents(m, {0});
    const std::uint64_t added = mesh::set_tangents(m, {0}, {true});
    CAPTURE(known.name);
    CHECK(m.positions.size() == before.positions.size() + added);
    CHECK(m.normals.size() == m.positions.size());
    CHECK(m.uv_sets[0].size() == m.positions.size());
    CHECK(m.tangents.size() == m.positions.size());
    for (std::size_t c = 0; c < 3 * m.triangles.size(); ++c) {
      const std::uint32_t v = m.triangles[c / 3][c % 3], old = before.triangles[c / 3][c % 3];
      CHECK(m.tangents[v] == made.tangents[made.of_corner[c]]);
      CHECK(m.positions[v] == before.positions[old]);
      CHECK(m.normals[v] == before.normals[old]);
      CHECK(m.uv_sets[0][v] == before.uv_sets[0][old]);
    }
    // Only where the image is turned over do frames differ around one corner.
    const bool splits = known.name == "mirrored" || known.name == "warped" || known.name == "fin";
    if (!splits && known.name != "flat_uvs" && known.name != "sphere") CHECK(added == 0);
    if (known.name == "mirrored") CHECK(added == 5);
  }
}

TEST_CASE("a file's own tangents stay, unless they are of other UVs", "[mesh]") {
  for (const bool keeps : {true, false}) {
    Mesh m = recorded().front().mesh;
    m.own_tangents.assign(m.positions.size(), false);
    m.own_tangents[4] = true;
    m.tangents[4] = {0, 1, 0, -1};
    mesh::set_tangents(m, {0}, {keeps});
    CHECK((m.tangents[4] == Vec4f{0, 1, 0, -1}) == keeps);
    CHECK(m.tangents[3].x > 0.9F);
  }
}

TEST_CASE("triangles of two materials have frames of their own", "[mesh]") {
  // One quad, bent along its diagonal in UV space: together its halves share two corners' frames.
  Mesh m;
  m.materials.resize(2);
  m.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  m.normals.assign(6, {0, 0, 1});
  m.tangents.resize(6);
  m.uv_sets = {{{0, 0}, {1, 0}, {1, -1}, {0, 0}, {1, -1}, {0, -0.5F}}};
  m.uv_present.resize(1);
  m.triangles = {{0, 1, 2}, {3, 4, 5}};
  m.triangle_material = {0, 0};
  const auto x_of = [&](std::size_t corner) {
    const mesh::CornerTangents made = mesh::mikk_tangents(m, {0, 0});
    return made.tangents[made.of_corner[corner]];
  };
  CHECK(x_of(0).x < 0.999F);
  CHECK(x_of(0) == x_of(3));
  m.triangle_material = {0, 1};
  CHECK(x_of(0) == Vec4f{1, 0, 0, 1});
  CHECK(x_of(3).x < 0.99F);
}

// Public models against the reference, npm's "mikktspace" (tools/install-oracles.sh BUILD/npm).
TEST_CASE("tangents of public models are the reference's", "[mesh][oracle][external]") {
  const auto data = test::test_data();
  const std::string oracle = POUNCE_BUILD_DIR "/npm";
  if (!data) return;
  if (!std::filesystem::is_directory(oracle + "/node_modules/mikktspace"))
    return test::skip("npm's mikktspace (tools/install-oracles.sh BUILD/npm)");
  test::TempFolder temp;
  for (const char* name : {"spot/spot.obj", "duck/gltf/Duck.gltf", "cesium_man/CesiumMan.glb",
                           "lee_perry_smith/LeePerrySmith_plain_textured.glb",
                           "water_bottle/SpecGlossVsMetalRough.gltf", "makehuman/base.obj",
                           "mediapipe_face/canonical_face_model.obj"}) {
    const Mesh m = io::read_mesh((*data / "meshes" / name).string(), {});
    if (m.uv_sets.empty()) continue;
    const std::vector<std::uint32_t> sets(m.materials.size(), 0);
    const mesh::CornerTangents made = mesh::mikk_tangents(m, sets);
    const std::string in = temp.file("corners"), out = temp.file("tangents");
    std::vector<std::uint32_t> order;  // material by material, as the reference is to see them
    for (std::uint32_t k = 0; k < m.materials.size(); ++k) {
      for (std::uint32_t t = 0; t < m.triangles.size(); ++t) {
        if (m.triangle_material[t] == k) order.push_back(t);
      }
    }
    {
      std::ofstream file(in, std::ios::binary);
      for (const std::uint32_t t : order) {
        for (const std::uint32_t v : m.triangles[t]) {
          const Vec3f &p = m.positions[v], &n = m.normals[v];
          const Vec2f uv = m.uv_sets[0][v];
          const std::array<float, 9> row{p.x,  p.y,   p.z,
                                         n.x,  n.y,   n.z,
                                         uv.x, -uv.y, static_cast<float>(m.triangle_material[t])};
          file.write(reinterpret_cast<const char*>(row.data()), sizeof row);
        }
      }
    }
    const std::string command = "cd '" + oracle + "' && node '" +
                                POUNCE_SOURCE_DIR "/tests/unit/mesh/mikk_oracle.js' '" + in +
                                "' '" + out + "'";
    REQUIRE(std::system(command.c_str()) == 0);
    std::ifstream file(out, std::ios::binary);
    std::size_t close = 0, all = 0;
    double worst = 0;
    for (const std::uint32_t t : order) {
      for (std::size_t k = 0; k < 3; ++k, ++all) {
        Vec4f wanted;
        REQUIRE(file.read(reinterpret_cast<char*>(&wanted), sizeof wanted));
        const Vec4f own = made.tangents[made.of_corner[3 * t + k]];
        const double off = degrees_between(own, wanted);
        worst = std::max(worst, off);
        const bool is_known = !(wanted.x == 1 && wanted.y == 0 && wanted.z == 0);
        if (off <= 0.1 && (!is_known || own.w == wanted.w)) ++close;
      }
    }
    std::printf("%s: %zu of %zu corners within 0.1 degrees, the worst off by %g\n", name, close,
                all, worst);
    CHECK(static_cast<double>(close) >= 0.999 * static_cast<double>(all));
  }
}
