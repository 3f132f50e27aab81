// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>
#include <filesystem>
#include <set>

#include "io/model/model_writer.h"
#include "io/read_mesh.h"
#include "pounce/error.h"
#include "support/model_files.h"
#include "support/test_data.h"

using namespace pounce;
namespace fs = std::filesystem;

namespace {

/// Everything but who has which material.
std::string geometry(const mesh::Mesh& m) {
  std::string all;
  const auto add = [&](const auto& values) {
    all.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(values[0]));
  };
  add(m.positions);
  add(m.normals);
  add(m.tangents);
  add(m.triangles);
  for (const auto& set : m.uv_sets) add(set);
  return all;
}

std::vector<io::ModelTexture> all_channels(const mesh::Mesh& mesh, const std::string& stem) {
  std::vector<io::ModelTexture> textures;
  const std::set<std::uint32_t> used(mesh.triangle_material.begin(), mesh.triangle_material.end());
  for (const std::uint32_t material : used) {
    for (int c = 0; c < kChannelCount; ++c) {
      textures.push_back({material,
                          static_cast<Channel>(c),
                          {1, 1, 1, 1},
                          stem + "." + std::to_string(textures.size()) + ".png"});
    }
  }
  return textures;
}

/// The file as a target of both formats. False if it is none.
bool survives(const fs::path& path) {
  mesh::Mesh mesh;
  try {
    if (!io::is_gltf(path.string())) return false;
    mesh = io::read_mesh(path.string());
  } catch (const Error&) {
    return false;
  }
  const test::TempFolder folder;
  for (const char* name : {"out.glb", "out.gltf"}) {
    const io::ModelRequest request{path.string(), folder.file(name), 0,
                                   all_channels(mesh, folder.file("out"))};
    std::vector<std::string> images;
    for (std::size_t k = 0; k < request.textures.size(); ++k) {
      images.push_back("\x89PNG\r\n\x1a\n" + std::to_string(k));
    }
    try {
      io::plan_model(request);
      test::FakeImages(images).write(request);
    } catch (const Error& error) {
      WARN(path.string() << ": " << error.what());
      CHECK(error.kind() == ErrorKind::input);
      continue;
    }
    const mesh::Mesh after = io::read_mesh(request.output);
    CHECK(geometry(after) == geometry(mesh));
    CHECK(after.materials.size() >= mesh.materials.size());
  }
  return true;
}

}  // namespace

TEST_CASE("every file that can be a target comes back with its geometry", "[model][external]") {
  const auto data = test::test_data();
  if (!data) return;
  std::size_t written = 0;
  for (const char* folder : {"meshes", "heads", "bad"}) {
    for (const auto& entry : fs::recursive_directory_iterator(*data / folder)) {
      if (!entry.is_regular_file() || entry.file_size() > (64U << 20)) continue;
      INFO(entry.path().string());
      const std::string ending = entry.path().extension().string();
      if (ending != ".glb" && ending != ".gltf") continue;
      written += survives(entry.path()) ? 1 : 0;
    }
  }
  CHECK(written > 20);
}
