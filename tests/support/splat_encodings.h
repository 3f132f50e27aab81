// SPDX-License-Identifier: Apache-2.0
//
// One scene as a file of each kind that is read.
#pragma once

#include <functional>

#include "support/splat_encoders.h"
#include "support/test_data.h"

namespace pounce::test {

/// Named as the readers call it, so that a test knows that it reads what it means to.
struct SplatEncoding {
  std::string format;
  std::string path;
  bool has_harmonics = true;
};

/// An archive without compression, as a SOG is bundled.
inline std::string zip_bytes(const std::filesystem::path& folder) {
  std::string archive, directory;
  std::uint16_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    std::ifstream file(entry.path(), std::ios::binary);
    const std::string data{std::istreambuf_iterator<char>(file), {}};
    const auto at = static_cast<std::uint32_t>(archive.size());
    const auto size = static_cast<std::uint32_t>(data.size());
    std::string common;  // of both headers
    put(common, std::uint16_t{20}), put(common, std::uint32_t{0}), put(common, std::uint32_t{0});
    put(common,
        static_cast<std::uint32_t>(crc32(0, reinterpret_cast<const Bytef*>(data.data()), size)));
    put(common, size), put(common, size);
    put(common, static_cast<std::uint16_t>(name.size())), put(common, std::uint16_t{0});
    archive += "PK\3\4" + common + name + data;
    directory += "PK\1\2" + std::string("\24\0", 2) + common + std::string(10, '\0');
    put(directory, at);
    directory += name;
    ++count;
  }
  std::string end = "PK\5\6" + std::string(4, '\0');
  put(end, count), put(end, count);
  put(end, static_cast<std::uint32_t>(directory.size()));
  put(end, static_cast<std::uint32_t>(archive.size()));
  return archive + directory + end + std::string(2, '\0');
}

/// As gltf_scene(), in the types of KHR_mesh_quantization and of the extension itself: means within
/// 4 and rotations in 16 bits, sigmas within 1 in 16, opacity in 8.
inline GltfScene quantised_gltf_scene(const Scene& scene) {
  GltfScene out = gltf_scene(scene);
  std::string mean, rotation, sigma, opacity;
  const auto short_of = [](float v) { return static_cast<std::int16_t>(std::lround(v * 32767)); };
  for (const SceneSplat& s : scene) {
    for (const float v : s.mean) put(mean, short_of(v / 4));
    put(mean, std::uint16_t{0});  // elements begin at multiples of 4 bytes
    for (const std::size_t k : {1U, 2U, 3U, 0U}) put(rotation, short_of(s.q[k]));
    for (const float v : s.log_sigma)
      put(sigma, static_cast<std::uint16_t>(bits_of(std::exp(v) / 4, 16)));
    put(sigma, std::uint16_t{0});
    put_byte(opacity, s.alpha * 255);
  }
  const std::string prefix = "KHR_gaussian_splatting:";
  const auto strided = [&] { out.document["bufferViews"].back()["byteStride"] = 8; };
  out.add_accessor("POSITION", "VEC3", 5122, true, scene.size(), mean);
  strided();
  out.add_accessor(prefix + "ROTATION", "VEC4", 5122, true, scene.size(), rotation);
  out.add_accessor(prefix + "SCALE", "VEC3", 5123, true, scene.size(), sigma);
  strided();
  out.add_accessor(prefix + "OPACITY", "SCALAR", 5121, true, scene.size(), opacity);
  out.document["nodes"][0]["scale"] = {4, 4, 4};
  return out;
}

/// An SPZ in a glTF: accessors say what there is and hold nothing.
inline GltfScene spz_in_gltf(const Scene& scene, const std::string& spz) {
  GltfScene out = gltf_scene(scene);
  out.bin.clear();
  out.document["bufferViews"] = nlohmann::json::array();
  out.add_accessor("COLOR_0", "SCALAR", 5121, false, spz.size(), spz);
  out.primitive()["attributes"] = {{"POSITION", 0}};
  for (auto& accessor : out.document["accessors"]) accessor.erase("bufferView");
  out.primitive()["extensions"]["KHR_gaussian_splatting"]["extensions"]
                 ["KHR_gaussian_splatting_compression_spz_2"]["bufferView"] = 0;
  return out;
}

/// The scene in every encoding but the first, which is what the others are measured by: a 3DGS PLY
/// of floats. Each is written, given to `visit` and removed, so that large scenes fit.
inline void for_each_encoding(const Scene& scene,
                              const std::function<void(const SplatEncoding&)>& visit) {
  const TempFolder folder;
  int number = 0;
  const auto file = [&](const std::string& format, const char* ending, const std::string& bytes,
                        bool has_harmonics = true) {
    const std::string path = folder.file("scene" + std::to_string(number++) + ending);
    std::ofstream(path, std::ios::binary) << bytes;
    visit({format, path, has_harmonics});
    std::filesystem::remove(path);
  };
  file("3DGS PLY of doubles", "d.ply", ply_bytes_of(scene, "double"));
  file("3DGS PLY of halves", "h.ply", ply_bytes_of(scene, "ushort"));
  file("SuperSplat compressed PLY", ".ply", compressed_ply_bytes(scene));
  file("SPZ v1", ".spz", gzipped(spz_bytes(scene, 1)));
  file("SPZ v2", ".spz", gzipped(spz_bytes(scene, 2)));
  file("SPZ v3", ".spz", gzipped(spz_bytes(scene, 3)));
  file("SPZ v4", ".spz", spz_bytes(scene, 4));
  for (const unsigned version : {1U, 2U}) {
    const std::string name = "SOG v" + std::to_string(version);
    write_sog(scene, folder.path() / "sog", version);
    visit({name + " (a folder)", folder.file("sog")});
    file(name + " (bundled)", ".sog", zip_bytes(folder.path() / "sog"));
  }
  const std::string gltf = "glTF (KHR_gaussian_splatting)";
  file(gltf, ".glb", gltf_scene(scene).bytes());
  file(gltf + ", quantised", ".glb", quantised_gltf_scene(scene).bytes());
  file("glTF (KHR_gaussian_splatting_compression_spz_2)", ".glb",
       spz_in_gltf(scene, gzipped(spz_bytes(scene, 2))).bytes());
  file(".splat", ".splat", dot_splat_bytes(scene), false);
  for (const unsigned level : {0U, 1U, 2U}) {
    file(".ksplat (level " + std::to_string(level) + ")", ".ksplat", ksplat_bytes(scene, level));
  }
}

}  // namespace pounce::test
