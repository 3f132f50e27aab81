// SPDX-License-Identifier: Apache-2.0
//
// What the readers of splat scenes take, by their own word and measured, does not grow with the
// number of Gaussians.
#include <meshoptimizer.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdio>
#include <map>
#include <utility>

#include "io/splats/scene.h"
#include "support/splat_encodings.h"
#include "support/taken.h"

namespace pounce::io {
namespace {

/// What a reader says that it takes, and what its process grew by.
struct Memory {
  std::uint64_t said_bytes = 0, grown_bytes = 0;
};

Memory memory_of(const std::string& path) {
  Memory memory;
  {
    const auto scene = open_splat_scene(path, {});
    memory.said_bytes = std::max(scene->prepare_bytes(), scene->read_bytes());
  }
  const test::TempFolder scratch;
  const test::Taken taken = test::taken_by([&] {
    constexpr std::uint64_t kRows = 4096;
    const auto scene = open_splat_scene(path, {});
    scene->prepare({&posix_file_system(), scratch.path().string()}, [] {});
    store::SplatRows rows;
    rows.lobes = 3;
    store::SplatCounts filtered{};
    for (std::uint64_t first = 0; first < scene->info().splats; first += kRows) {
      rows.splats.clear();
      rows.sh.clear();
      scene->read(first, std::min(kRows, scene->info().splats - first), rows, filtered);
    }
  });
  CHECK(taken.status == 0);
  memory.grown_bytes = taken.grown_bytes;
  return memory;
}

std::map<std::string, Memory> memory_by_format(std::size_t count) {
  std::map<std::string, Memory> found;
  const test::Scene scene = test::random_scene(count, 3);
  const test::TempFolder folder;
  std::ofstream(folder.file("f.ply"), std::ios::binary) << test::ply_bytes(scene, false);
  found["3DGS PLY"] = memory_of(folder.file("f.ply"));
  test::for_each_encoding(scene, [&](const test::SplatEncoding& encoding) {
    found[encoding.format] = memory_of(encoding.path);
  });
  return found;
}

/// The scene as glTF, its accessors packed by meshoptimizer.
test::GltfScene packed_scene(const test::Scene& scene) {
  test::GltfScene out = test::gltf_scene(scene);
  const std::string plain = std::exchange(out.bin, "");
  auto& views = out.document["bufferViews"];
  for (auto& view : views) {
    const auto bytes = view["byteLength"].get<std::size_t>();
    const std::size_t stride = bytes / scene.size();
    const char* const from = plain.data() + view["byteOffset"].get<std::size_t>();
    std::string packed(meshopt_encodeVertexBufferBound(scene.size(), stride), '\0');
    packed.resize(meshopt_encodeVertexBuffer(reinterpret_cast<unsigned char*>(packed.data()),
                                             packed.size(), from, scene.size(), stride));
    view["buffer"] = 1;
    view["extensions"]["EXT_meshopt_compression"] = {
        {"buffer", 0},           {"byteOffset", out.bin.size()}, {"byteLength", packed.size()},
        {"count", scene.size()}, {"byteStride", stride},         {"mode", "ATTRIBUTES"}};
    out.bin += packed;
  }
  out.document["buffers"] = {{{"byteLength", out.bin.size()}},
                             {{"byteLength", plain.size()},
                              {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}}};
  out.document["extensionsUsed"].push_back("EXT_meshopt_compression");
  return out;
}

TEST_CASE("views of splats that are packed are part of what a reader says", "[io]") {
  constexpr std::size_t kCount = 200000;
  const test::TempFolder folder;
  const std::string path = folder.file("packed.glb");
  std::ofstream(path, std::ios::binary) << packed_scene(test::random_scene(kCount, 3)).bytes();
  const Memory memory = memory_of(path);
  std::printf("FIGURE reader meshopt: says %.2f MiB, grew by %.2f\n",
              static_cast<double>(memory.said_bytes) / (1 << 20),
              static_cast<double>(memory.grown_bytes) / (1 << 20));
  CHECK(memory.grown_bytes > 20 * sizeof(float) * kCount);  // all of them are unpacked
#ifndef __SANITIZE_ADDRESS__
  CHECK(memory.grown_bytes <= memory.said_bytes + (3 << 19));
#endif
}

TEST_CASE("readers of ten times as many Gaussians take no more memory", "[io]") {
  // Of the smallest format 20 bytes are a Gaussian: 3.6 MB more in the second file.
  const auto few = memory_by_format(20000), many = memory_by_format(200000);
  REQUIRE(few.size() == 19);
  for (const auto& [format, memory] : many) {
    CAPTURE(format);
    const Memory& before = few.at(format);
    std::printf("FIGURE reader %s: says %.2f MiB, grew by %.2f, before by %.2f\n", format.c_str(),
                static_cast<double>(memory.said_bytes) / (1 << 20),
                static_cast<double>(memory.grown_bytes) / (1 << 20),
                static_cast<double>(before.grown_bytes) / (1 << 20));
    // Of zstd the window is as large as a frame until it is 2 MiB, of SOG the palette has 65,536
    // entries at most, 9 bytes each here; of glTF there are more digits in the JSON.
    std::uint64_t more = 0;
    if (format == "SPZ v4") more = 2 << 20;
    if (format.starts_with("SOG")) more = 9 << 16;
    if (format.starts_with("glTF")) more = 8 << 10;
    CHECK(memory.said_bytes <= before.said_bytes + more);
#ifndef __SANITIZE_ADDRESS__  // which keeps what was let go
    // The rows that it gave are beside it, and what the allocator does not give back.
    CHECK(memory.grown_bytes <= memory.said_bytes + (3 << 19));
#endif
  }
}

}  // namespace
}  // namespace pounce::io
