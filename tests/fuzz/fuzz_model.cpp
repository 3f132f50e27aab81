// SPDX-License-Identifier: Apache-2.0
//
// Models with new textures: the JSON of a target is edited as text. What can be read is written so
// that it can be read again, with the same surface and the new texture, as .glb and as .gltf.
#include <cstring>

#include "core/file.h"
#include "fuzz/fuzz_support.h"
#include "fuzz/gltf_input.h"
#include "io/model/model_writer.h"
#include "io/read_mesh.h"
#include "support/memory_file_system.h"

namespace pounce::fuzz {
namespace {

constexpr std::uint64_t kMostBytes = 64 << 20;

template <class T>
bool same(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

void check_written(const mesh::Mesh& before, const io::ModelRequest& request) {
  const mesh::Mesh after = [&] {
    try {
      return io::read_mesh(request.output);
    } catch (const Error& e) {
      require(false, e.what());
      throw;
    }
  }();
  require(same(before.positions, after.positions) && same(before.normals, after.normals) &&
              same(before.tangents, after.tangents) && same(before.triangles, after.triangles),
          "the surface stays");
  require(before.uv_sets.size() == after.uv_sets.size(), "UV sets stay");
  for (std::size_t set = 0; set < before.uv_sets.size(); ++set)
    require(same(before.uv_sets[set], after.uv_sets[set]), "UVs stay");
  for (std::size_t t = 0; t < before.triangles.size(); ++t) {
    if (before.triangle_material[t] != request.textures[0].material ||
        !before.has_uv(request.uv_set, before.triangles[t][0]))
      continue;  // without the UVs it keeps the old texture
    const mesh::Material& material = after.materials[after.triangle_material[t]];
    const auto& binding = material.textures[static_cast<std::size_t>(request.textures[0].channel)];
    require(binding && binding->uv_set == request.uv_set, "the new texture is there");
    require(after.images[binding->image].problem.empty(), "the new image is there");
  }
}

void write(const mesh::Mesh& mesh, io::ModelRequest request, Channel channel) {
  static const std::string png = "\x89PNG\r\n\x1a\n new";
  static const std::unique_ptr<FileSystem> memory = test::make_memory_file_system();
  static const std::unique_ptr<ReadFile> images = [] {
    const auto file = memory->create_scratch("/");
    file->append(std::as_bytes(std::span(png)));
    return file->reader();
  }();
  request.textures = {
      {mesh.triangle_material.back(), channel, {1, 0.5F, 0.25F, 1}, request.output + ".new.png"}};
  if (io::plan_model(request).least_bytes > kMostBytes) return;
  const io::EncodedImage place{0, png.size()};
  io::write_model(request, *images, std::span(&place, 1));
  check_written(mesh, request);
}

}  // namespace
}  // namespace pounce::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace pounce;
  static const fuzz::Folder folder;
  static const std::string buffer = folder.write("m.bin", std::string(4096, '\x3C'));
  const std::string path = folder.write("m.glb", fuzz::file_bytes(fuzz::text_of(data, size)));
  fuzz::attempt([&] {
    if (io::mesh_cost(path, {}, fuzz::kMostBytes).peak_bytes > fuzz::kMostBytes) return;
    const mesh::Mesh mesh = io::read_mesh(path);
    if (mesh.uv_sets.empty()) return;
    const std::string out = folder.path("out");
    for (const char* ending : {"/o.glb", "/o.gltf"}) {
      std::filesystem::create_directory(out);
      const auto uv_set = static_cast<std::uint32_t>(size % mesh.uv_sets.size());
      const auto channel = static_cast<Channel>(size / 2 % kChannelCount);
      fuzz::attempt([&] { fuzz::write(mesh, {path, out + ending, uv_set, {}, false}, channel); });
      std::filesystem::remove_all(out);
    }
  });
  return 0;
}
