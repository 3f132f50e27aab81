// SPDX-License-Identifier: Apache-2.0
//
// Real files: the good ones hold what other tools measured in them; the bad ones are read or
// refused, never anything else. POUNCE_VERDICTS=<file> writes the table of verdicts there.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>

#include "read_error.h"
#include "support/test_data.h"

using namespace pounce;
namespace fs = std::filesystem;

namespace {

struct GoodFile {
  const char* path;
  std::size_t triangles;
  std::size_t vertices;  ///< 0: flat or smoothed, so not the file's
};

bool is_mesh_file(const fs::path& path) {
  static const std::set<std::string> endings{".gltf", ".glb", ".obj", ".ply", ".stl"};
  return endings.contains(path.extension().string());
}

void check_invariants(const mesh::Mesh& m) {
  const std::size_t n = m.positions.size();
  REQUIRE(m.normals.size() == n);
  REQUIRE(m.tangents.size() == n);
  REQUIRE(m.triangle_material.size() == m.triangles.size());
  REQUIRE(m.uv_present.size() == m.uv_sets.size());
  bool good = true;
  for (const auto& t : m.triangles) {
    for (const std::uint32_t corner : t) good = good && corner < n;
  }
  for (const std::uint32_t material : m.triangle_material)
    good = good && material < m.materials.size();
  for (const Vec3f p : m.positions)
    good = good && std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
  for (std::size_t i = 0; i < n; ++i) {
    const float size = length(m.normals[i]);
    good = good && (size == 0 || std::abs(size - 1) < 1e-5F);
    const Vec4f t = m.tangents[i];
    good = good && std::abs(t.x * t.x + t.y * t.y + t.z * t.z - 1) < 1e-5F && std::abs(t.w) == 1;
    good = good && std::abs(dot(Vec3f{t.x, t.y, t.z}, m.normals[i])) < 1e-5F;
  }
  for (std::size_t set = 0; set < m.uv_sets.size(); ++set) {
    REQUIRE(m.uv_sets[set].size() == n);
    good = good && (m.uv_present[set].empty() || m.uv_present[set].size() == n);
    for (const Vec2f uv : m.uv_sets[set]) good = good && std::isfinite(uv.x) && std::isfinite(uv.y);
  }
  for (const auto& material : m.materials) {
    good = good && !material.name.empty();
    for (const auto& texture : material.textures) {
      good = good &&
             (!texture || (texture->image < m.images.size() && texture->uv_set < m.uv_sets.size()));
    }
  }
  CHECK(good);
}

std::string image_start(const mesh::ImageRef& image, std::size_t count) {
  std::ifstream file(image.path, std::ios::binary);
  file.seekg(static_cast<std::streamoff>(image.offset_bytes));
  std::string out(count, '\0');
  file.read(out.data(), static_cast<std::streamsize>(count));
  return out;
}

/// Files that break glTF or OBJ in ways that would give garbage or a crash: each must be refused
/// for its own reason.
const std::map<std::string, std::string>& must_refuse() {
  static const std::map<std::string, std::string> files = {
      {"assimp/glTF2/IncorrectVertexArrays/Cube.gltf", "bufferViews[2] reaches beyond"},
      {"assimp/invalid/malformed.obj", "refers to vertex 12"},
      {"draco/UnusedTexCoords/TexCoord0InvalidTexCoord1Valid.gltf", "MultiUVTest.bin"},
      {"gltf_validator/EXT_texture_webp/data/texture/unresolved_source.gltf", "source is 0"},
      {"gltf_validator/accessor/alignment.gltf", "reads beyond"},
      {"gltf_validator/accessor/unresolved_bufferviews.gltf", "bufferView is 0"},
      {"gltf_validator/asset/1_0_version.gltf", "1.0"},
      {"gltf_validator/buffer/invalid_object.gltf", "not a JSON object"},
      {"gltf_validator/buffer_view/invalid_length.gltf", "reaches beyond"},
      {"gltf_validator/buffer_view/unresolved_buffer.gltf", "buffer is 1"},
      {"gltf_validator/glb/empty_file.glb", "empty"},
      {"gltf_validator/glb/empty_json_object.glb", "asset"},
      {"gltf_validator/glb/invalid_magic.glb", "does not begin"},
      {"gltf_validator/glb/json_and_two_buffers.glb", "two BIN chunks"},
      {"gltf_validator/glb/only_bin_chunk.glb", "must be JSON"},
      {"gltf_validator/glb/truncated_chunk_data.glb", "48 bytes"},
      {"gltf_validator/image/invalid_object.gltf", "not a JSON object"},
      {"gltf_validator/json/invalid_object.gltf", "not a JSON object"},
      {"gltf_validator/material/unresolved_emissive.gltf", "emissiveTexture.index is 0"},
      {"gltf_validator/material/unresolved_normal.gltf", "normalTexture.index is 0"},
      {"gltf_validator/mesh/accessor_attribute_uint32.gltf", "32-bit"},
      {"gltf_validator/mesh/accessor_unequal_count.gltf", "has 4 elements"},
      {"gltf_validator/mesh/empty_object.gltf", "primitives is missing"},
      {"gltf_validator/mesh/indices_invalid_format.gltf", "accessor"},
      {"gltf_validator/mesh/morph_attribute_invalid_count.gltf", "target 0"},
      {"gltf_validator/mesh/position_accessor_invalid_format.gltf", "VEC4"},
      {"gltf_validator/mesh/unequal_joints.gltf", "JOINTS_1"},
      {"gltf_validator/mesh/unresolved_material.gltf", "material is 0"},
      {"gltf_validator/mesh/unresolved_positions.gltf", "POSITION is 0"},
      {"gltf_validator/mesh_data/index_buffer_primitive_restart.gltf", "restart"},
      {"gltf_validator/node/infinite_transform.gltf", "1e309"},
      {"gltf_validator/node/matrix_trs.gltf", "both a matrix"},
      {"gltf_validator/node/node_loop_scene.gltf", "two parents"},
      {"gltf_validator/node/unresolved_camera.gltf", "camera is 0"},
      {"gltf_validator/node/unresolved_mesh.gltf", "mesh is 0"},
      {"gltf_validator/root/empty_object.gltf", "asset is missing"},
      {"gltf_validator/root/invalid_collection_type.gltf", "not an array"},
      {"gltf_validator/scene/unresolved_child_node.gltf", "children is 5"},
      {"gltf_validator/scene/unresolved_node.gltf", "nodes is 0"},
      {"gltf_validator/texture/unresolved_sampler.gltf", "sampler is 0"},
      {"tinygltf/BoundsChecking/integer-out-of-bounds.gltf", "whole number"},
      {"tinygltf/BoundsChecking/invalid-buffer-index.gltf", "buffer is 1"},
      {"tinygltf/BoundsChecking/invalid-buffer-view-index.gltf", "only 0"},
      {"tinygltf/BoundsChecking/invalid-primitive-indices.gltf", "only 0"},
      {"tinyobjloader/invalid-face-definition.obj", "fewer than 3 corners"},
      {"tinyobjloader/invalid-relative-texture-index.obj", "line 2"},
      {"tinyobjloader/invalid-relative-vertex-index.obj", "vertex -4"},
      {"tinyobjloader/issue-140-zero-face-idx.obj", "index 0"},
      {"tinyobjloader/test-nan.obj", "nan"},
      {"trimesh/empty.obj", "no faces"},
  };
  return files;
}

}  // namespace

TEST_CASE("real meshes hold the triangles that other tools count", "[io][data][external]") {
  const auto data = test::test_data();
  if (!data) return;
  // 24 in TextureTransformTest: its 9 quads are shown by 12 nodes.
  const std::vector<GoodFile> files = {
      {"meshes/SimpleSparseAccessor/SimpleSparseAccessor.gltf", 12, 0},
      {"meshes/TextureSettingsTest/TextureSettingsTest.gltf", 72, 144},
      {"meshes/TextureTransformTest/TextureTransformTest.gltf", 24, 0},
      {"meshes/box_textured_webp/BoxTexturedWebp.gltf", 12, 24},
      {"meshes/cesium_man/CesiumMan.glb", 4672, 3273},
      {"meshes/duck/gltf/Duck.gltf", 4212, 2399},
      {"meshes/lee_perry_smith/LeePerrySmith_plain_textured.glb", 17684, 9223},
      {"meshes/makehuman/base.obj", 36972, 0},
      {"meshes/mediapipe_face/canonical_face_model.obj", 898, 0},
      {"meshes/multi_uv/MultiUVTest.gltf", 12, 24},
      {"meshes/spot/spot.obj", 5856, 0},
      {"meshes/spot_glb/cow.glb", 5856, 0},
      {"meshes/water_bottle/SpecGlossVsMetalRough.gltf", 9028, 5114},
      {"meshes/playbot_proxy/playbot_proxy.glb", 19986, 0},
      {"heads/head_src.glb", 10092, 0},
      {"heads/head_src.obj", 10092, 0},
      {"udim/materialx_cube/cube.obj", 12, 0},
      {"meshes/box_meshopt/BoxTextured_meshopt.glb", 12, 24},
      {"meshes/duck/Duck-vp-12-vt-12-vn-12.glb", 4212, 2399},
      {"meshes/lee_perry_smith/LeePerrySmith.glb", 17684, 9223},
      {"meshes/milk_truck_draco/CesiumMilkTruck.gltf", 3624, 3594},
  };
  for (const GoodFile& file : files) {
    INFO(file.path);
    const mesh::Mesh m = io::read_mesh((*data / file.path).string());
    CHECK(m.triangles.size() == file.triangles);
    if (file.vertices != 0) CHECK(m.positions.size() == file.vertices);
    check_invariants(m);
    const io::MeshCost cost = io::mesh_cost((*data / file.path).string());
    CHECK(cost.kept_bytes >= m.size_bytes());
    CHECK(cost.peak_bytes >= cost.kept_bytes);
  }
}

TEST_CASE("a mesh whose images nobody reads is read", "[io][data][external]") {
  const auto data = test::test_data();
  if (!data) return;
  const mesh::Mesh balloon =
      io::read_mesh((*data / "meshes/balloon_ktx2/CesiumBalloonKTX2.glb").string());
  CHECK(balloon.triangles.size() > 1000);
  CHECK_THAT(balloon.images.at(0).problem, Catch::Contains("KHR_texture_basisu"));
}

TEST_CASE("splat scenes in glTF are named", "[io][data][external]") {
  const auto data = test::test_data();
  if (!data) return;
  for (const char* file : {"splats/playbot_lod3_converted/playbot_lod3.glb",
                           "splats/khr_gaussian_splatting/khr_conformance_matrix.glb",
                           "splats/khr_gaussian_splatting/khr_extensible_fallback.gltf"}) {
    INFO(file);
    CHECK_THAT(test::refusal((*data / file).string()),
               Catch::Contains("a Gaussian splat scene in glTF (KHR_gaussian_splatting"));
  }
}

TEST_CASE("images of real files are found where they are", "[io][data][external]") {
  const auto data = test::test_data();
  if (!data) return;
  const mesh::Mesh man = io::read_mesh((*data / "meshes/cesium_man/CesiumMan.glb").string());
  REQUIRE(man.images.size() == 1);
  CHECK(man.images[0].size_bytes == 209908);
  CHECK(image_start(man.images[0], 3) == "\xFF\xD8\xFF");
  const mesh::Mesh cow = io::read_mesh((*data / "meshes/spot_glb/cow.glb").string());
  CHECK(image_start(cow.images.at(0), 8) == "\x89PNG\r\n\x1a\n");
  CHECK(cow.images.at(0).size_bytes == 78699);
  const mesh::Mesh spot = io::read_mesh((*data / "meshes/spot/spot.obj").string());
  CHECK(image_start(spot.images.at(0), 8) == "\x89PNG\r\n\x1a\n");
}

TEST_CASE("one object in OBJ and GLB is the same surface with the same UVs",
          "[io][data][external]") {
  const auto data = test::test_data();
  if (!data) return;
  const mesh::Mesh obj = io::read_mesh((*data / "heads/head_src.obj").string());
  const mesh::Mesh glb = io::read_mesh((*data / "heads/head_src.glb").string());
  REQUIRE(obj.triangles.size() == glb.triangles.size());
  double worst_position = 0, worst_uv = 0, worst_normal = 0;
  for (std::size_t i = 0; i < obj.triangles.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = obj.triangles[i][k], b = glb.triangles[i][k];
      worst_position =
          std::max(worst_position, double{length(obj.positions[a] - glb.positions[b])});
      worst_normal = std::max(worst_normal, double{length(obj.normals[a] - glb.normals[b])});
      const Vec2f d = obj.uv_sets.at(0)[a] - glb.uv_sets.at(0)[b];
      worst_uv = std::max({worst_uv, std::abs(double{d.x}), std::abs(double{d.y})});
    }
  }
  CHECK(worst_position < 1e-4);
  CHECK(worst_uv < 1e-5);
  CHECK(worst_normal < 1e-2);
}

TEST_CASE("a skinned man stands upright at his own height", "[io][data][external]") {
  const auto data = test::test_data();
  if (!data) return;
  const mesh::Mesh man = io::read_mesh((*data / "meshes/cesium_man/CesiumMan.glb").string());
  Vec3f lo = man.positions[0], hi = lo;
  for (const Vec3f p : man.positions) {
    lo = {std::min(lo.x, p.x), std::min(lo.y, p.y), std::min(lo.z, p.z)};
    hi = {std::max(hi.x, p.x), std::max(hi.y, p.y), std::max(hi.z, p.z)};
  }
  // About 1.5 m tall along y, feet near the ground; he looks along x.
  CHECK(hi.y - lo.y == Approx(1.5).margin(.1));
  CHECK(std::abs(lo.y) < .1);
  CHECK(hi.x - lo.x < .6);
}

TEST_CASE("every bad mesh is read or refused, and the harmful ones are refused",
          "[io][data][external]") {
  const auto data = test::test_data();
  if (!data) return;
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(*data / "bad")) {
    if (entry.is_regular_file() && is_mesh_file(entry.path())) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  CHECK(files.size() >= 120);
  std::string table;
  std::set<std::string> refused;
  for (const fs::path& path : files) {
    const std::string name = fs::relative(path, *data / "bad").string();
    INFO(name);
    std::string verdict = "read", message;
    try {
      const mesh::Mesh m = io::read_mesh(path.string());
      check_invariants(m);
      message = std::to_string(m.triangles.size()) + " triangles";
      for (const auto& warning : m.warnings) message += "; " + warning;
    } catch (const Error& e) {
      CHECK((e.kind() == ErrorKind::input || e.kind() == ErrorKind::storage));
      verdict = "refused";
      message = e.what();
      CHECK_THAT(message, Catch::Contains(path.string()));
      refused.insert(name);
      const auto expected = must_refuse().find(name);
      if (expected != must_refuse().end()) CHECK_THAT(message, Catch::Contains(expected->second));
    }
    for (std::size_t at = 0; (at = message.find(data->string() + "/", at)) != std::string::npos;) {
      message.erase(at, data->string().size() + 1);
    }
    table += verdict + "|" + name + "|" + message + "\n";
  }
  for (const auto& item : must_refuse()) {
    INFO(item.first);
    CHECK(refused.contains(item.first));
  }
  CHECK(files.size() - refused.size() >= 12);  // those that break a rule and harm nobody: 16
  if (const char* out = std::getenv("POUNCE_VERDICTS"); out != nullptr) std::ofstream(out) << table;
}
