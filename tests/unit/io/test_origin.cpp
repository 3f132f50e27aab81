// SPDX-License-Identifier: Apache-2.0
// Positions far from 0, less the job's origin: with all digits that the file has.
#include <catch2/catch.hpp>

#include "io/read_mesh.h"
#include "support/gltf_builder.h"
#include "support/test_data.h"

using namespace pounce;
using test::GltfBuilder;
using test::TempFolder;
using test::write_file;

namespace {

const Vec3d kOrigin{448256, 5411904, 0};

}  // namespace

TEST_CASE("an OBJ's positions keep their digits less the origin", "[io]") {
  const TempFolder folder;
  const std::string path = folder.file("m.obj");
  write_file(path,
             "v 448256.0625 5411904.03125 1e-3\nv 448257 5411904 0\nv 448256 5411905 0\nf 1 2 3\n");
  const mesh::Mesh near = io::read_mesh(path, {false, {}, false, true, kOrigin});
  CHECK(near.positions[0] == Vec3f{0.0625F, 0.03125F, 1e-3F});
  CHECK(near.positions[2] == Vec3f{0, 1, 0});
  // Without, single precision holds halves there.
  CHECK(io::read_mesh(path).positions[0] == Vec3f{448256.0625F, 5411904, 1e-3F});
  write_file(path, "v 1e39 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  CHECK_THROWS_WITH(io::read_mesh(path, {false, {}, false, true, kOrigin}),
                    Catch::Contains("line 1: a vertex is too large for a float"));
}

TEST_CASE("a node's translation is added in double precision", "[io]") {
  GltfBuilder b;
  b.triangle();
  b.doc["nodes"] = {{{"children", {1}}, {"translation", {448256.0625, 5411904.03125, 2.0}}},
                    {{"mesh", 0}, {"translation", {0.125, 0, 0}}}};
  b.doc["scenes"] = {{{"nodes", {0}}}};
  const TempFolder folder;
  const std::string path = b.write(folder.file("m.gltf"));
  const mesh::Mesh here = io::read_mesh(path, {false, {}, false, true, kOrigin});
  GltfBuilder plain;
  plain.triangle();
  const mesh::Mesh own = io::read_mesh(plain.write(folder.file("own.gltf")));
  REQUIRE(here.positions.size() == own.positions.size());
  for (std::size_t i = 0; i < own.positions.size(); ++i)
    CHECK(here.positions[i] - own.positions[i] == Vec3f{0.1875F, 0.03125F, 2});
}
