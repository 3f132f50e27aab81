// SPDX-License-Identifier: Apache-2.0
//
// A wavy grid as glTF, packed by the encoders of the two libraries.
#pragma once

#include <meshoptimizer.h>

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "core/vec.h"
#include "support/gltf_builder.h"

namespace pounce::test {

/// side * side vertices; UVs are (column, row) / (side - 1), so that each vertex says which it is.
struct Grid {
  std::uint32_t side = 0;
  std::vector<Vec3f> positions, normals;
  std::vector<Vec2f> uvs;
  std::vector<std::uint32_t> indices;
};

inline Grid make_grid(std::uint32_t side) {
  Grid grid{side, {}, {}, {}, {}};
  for (std::uint32_t y = 0; y < side; ++y) {
    for (std::uint32_t x = 0; x < side; ++x) {
      const float u = static_cast<float>(x) / static_cast<float>(side - 1);
      const float v = static_cast<float>(y) / static_cast<float>(side - 1);
      grid.positions.push_back({u, v, 0.1F * std::sin(9 * u) * std::cos(7 * v)});
      grid.normals.push_back({0, 0, 1});
      grid.uvs.push_back({u, v});
      if (x + 1 == side || y + 1 == side) continue;
      const std::uint32_t a = y * side + x, b = a + 1, c = a + side, d = c + 1;
      grid.indices.insert(grid.indices.end(), {a, b, d, a, d, c});
    }
  }
  return grid;
}

struct DracoChoice {
  bool sequential = false;
  int speed = 5, position_bits = 14;
};

/// Of a library of its own: with Draco's encoder comes a tinygltf that is not ours.
std::string draco_bytes_of(const Grid& grid, const DracoChoice& choice = {});

/// A model of one primitive with these packed bytes, claiming so many vertices and indices.
inline GltfBuilder draco_model(const std::string& packed, std::uint64_t vertices,
                               std::uint64_t indices) {
  GltfBuilder b;
  const int view = b.view(packed);
  const auto accessor = [&](int component, std::uint64_t count, const char* type) {
    return b.push("accessors", {{"componentType", component}, {"count", count}, {"type", type}});
  };
  const int position = accessor(5126, vertices, "VEC3"), normal = accessor(5126, vertices, "VEC3");
  const int uv = accessor(5126, vertices, "VEC2"), index = accessor(5125, indices, "SCALAR");
  auto& primitive =
      b.primitive({{"POSITION", position}, {"NORMAL", normal}, {"TEXCOORD_0", uv}}, index);
  primitive["extensions"]["KHR_draco_mesh_compression"] = {
      {"bufferView", view}, {"attributes", {{"POSITION", 0}, {"NORMAL", 1}, {"TEXCOORD_0", 2}}}};
  b.doc["meshes"][0]["name"] = "Head";
  b.doc["extensionsUsed"] = b.doc["extensionsRequired"] =
      nlohmann::json::array({"KHR_draco_mesh_compression"});
  return b;
}

inline GltfBuilder draco_model(const Grid& grid, const DracoChoice& choice = {}) {
  return draco_model(draco_bytes_of(grid, choice), grid.positions.size(), grid.indices.size());
}

/// A model whose views are packed; their plain bytes are nowhere (a fallback buffer without data).
class MeshoptBuilder : public GltfBuilder {
 public:
  int packed_view(const std::string& packed, const std::string& mode, std::size_t stride,
                  std::size_t count, const std::string& filter = "") {
    const int index = view(packed);
    nlohmann::json& item = doc["bufferViews"].back();
    nlohmann::json extension = {{"buffer", 0},
                                {"byteOffset", item["byteOffset"]},
                                {"byteLength", packed.size()},
                                {"byteStride", stride},
                                {"count", count},
                                {"mode", mode}};
    if (!filter.empty()) extension["filter"] = filter;
    item = {{"buffer", 1},
            {"byteOffset", plain_bytes_},
            {"byteLength", stride * count},
            {"extensions", {{"EXT_meshopt_compression", extension}}}};
    if (mode == "ATTRIBUTES") item["byteStride"] = stride;
    plain_bytes_ += stride * count;
    return index;
  }
  int packed_accessor(int view, int component, std::size_t count, const char* type,
                      bool normalized = false) {
    nlohmann::json item = {
        {"bufferView", view}, {"componentType", component}, {"count", count}, {"type", type}};
    if (normalized) item["normalized"] = true;
    return push("accessors", item);
  }
  std::string write_packed(const std::string& path) const {
    nlohmann::json out = doc;
    out["extensionsUsed"] = out["extensionsRequired"] =
        nlohmann::json::array({"EXT_meshopt_compression", "KHR_mesh_quantization"});
    out["buffers"] = nlohmann::json::array(
        {{{"byteLength", buffer.size()},
          {"uri", "data:application/octet-stream;base64," + base64(buffer)}},
         {{"byteLength", plain_bytes_},
          {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}}});
    write_file(path, out.dump());
    return path;
  }

 private:
  std::size_t plain_bytes_ = 0;
};

inline std::string packed_vertices(const void* values, std::size_t count, std::size_t stride) {
  std::string out(meshopt_encodeVertexBufferBound(count, stride), '\0');
  auto* bytes = reinterpret_cast<unsigned char*>(out.data());
  out.resize(meshopt_encodeVertexBuffer(bytes, out.size(), values, count, stride));
  return out;
}

inline std::string packed_triangles(const Grid& grid) {
  std::string out(meshopt_encodeIndexBufferBound(grid.indices.size(), grid.positions.size()), '\0');
  auto* bytes = reinterpret_cast<unsigned char*>(out.data());
  out.resize(
      meshopt_encodeIndexBuffer(bytes, out.size(), grid.indices.data(), grid.indices.size()));
  return out;
}

inline std::string packed_sequence(const Grid& grid) {
  std::string out(meshopt_encodeIndexSequenceBound(grid.indices.size(), grid.positions.size()),
                  '\0');
  auto* bytes = reinterpret_cast<unsigned char*>(out.data());
  out.resize(
      meshopt_encodeIndexSequence(bytes, out.size(), grid.indices.data(), grid.indices.size()));
  return out;
}

/// Floats, unfiltered: what comes out is what went in.
inline MeshoptBuilder meshopt_model(const Grid& grid, const std::string& mode = "TRIANGLES") {
  MeshoptBuilder b;
  const std::size_t count = grid.positions.size();
  const int position = b.packed_accessor(
      b.packed_view(packed_vertices(grid.positions.data(), count, 12), "ATTRIBUTES", 12, count),
      5126, count, "VEC3");
  const int normal = b.packed_accessor(
      b.packed_view(packed_vertices(grid.normals.data(), count, 12), "ATTRIBUTES", 12, count), 5126,
      count, "VEC3");
  const int uv = b.packed_accessor(
      b.packed_view(packed_vertices(grid.uvs.data(), count, 8), "ATTRIBUTES", 8, count), 5126,
      count, "VEC2");
  const std::string packed = mode == "TRIANGLES" ? packed_triangles(grid) : packed_sequence(grid);
  const int index = b.packed_accessor(b.packed_view(packed, mode, 4, grid.indices.size()), 5125,
                                      grid.indices.size(), "SCALAR");
  b.primitive({{"POSITION", position}, {"NORMAL", normal}, {"TEXCOORD_0", uv}}, index);
  return b;
}

}  // namespace pounce::test
