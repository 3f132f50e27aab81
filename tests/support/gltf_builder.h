// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace pounce::test {

inline void write_file(const std::string& path, std::string_view bytes) {
  std::ofstream(path, std::ios::binary)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

inline std::string base64(std::string_view bytes) {
  const char* letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      bits = bits << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      out += i + k > bytes.size() ? '=' : letters[(bits >> (18 - 6 * k)) & 63];
    }
  }
  return out;
}

/// Small glTF files made by hand: append data, get accessor indices, edit `doc` freely, write.
class GltfBuilder {
 public:
  nlohmann::json doc = {{"asset", {{"version", "2.0"}}}};
  std::string buffer;

  /// A buffer view of these bytes; starts at a multiple of 4.
  int view(std::string_view bytes, int stride = 0) {
    while (buffer.size() % 4 != 0) buffer.push_back('\0');
    nlohmann::json item = {
        {"buffer", 0}, {"byteOffset", buffer.size()}, {"byteLength", bytes.size()}};
    if (stride != 0) item["byteStride"] = stride;
    buffer += bytes;
    return push("bufferViews", item);
  }
  template <class T>
  static std::string bytes_of(const std::vector<T>& values) {
    std::string out(values.size() * sizeof(T), '\0');
    std::memcpy(out.data(), values.data(), out.size());
    return out;
  }
  template <class T>
  static int component_type() {
    if constexpr (std::is_same_v<T, std::int8_t>) return 5120;
    if constexpr (std::is_same_v<T, std::uint8_t>) return 5121;
    if constexpr (std::is_same_v<T, std::int16_t>) return 5122;
    if constexpr (std::is_same_v<T, std::uint16_t>) return 5123;
    if constexpr (std::is_same_v<T, std::uint32_t>) return 5125;
    return 5126;
  }
  /// An accessor over values of its own; `type` is glTF's ("VEC3").
  template <class T>
  int add(const std::vector<T>& values, const std::string& type, bool normalized = false) {
    const std::size_t width = type == "SCALAR" ? 1
                              : type == "MAT4" ? 16
                                               : static_cast<std::size_t>(type[3] - '0');
    nlohmann::json item = {{"bufferView", view(bytes_of(values))},
                           {"componentType", component_type<T>()},
                           {"count", values.size() / width},
                           {"type", type}};
    if (normalized) item["normalized"] = true;
    return push("accessors", item);
  }
  int push(const char* collection, const nlohmann::json& item) {
    doc[collection].push_back(item);
    return static_cast<int>(doc[collection].size()) - 1;
  }
  /// One mesh of one primitive, one node showing it. Returns the primitive for editing.
  nlohmann::json& primitive(const nlohmann::json& attributes, int indices = -1) {
    nlohmann::json item = {{"attributes", attributes}};
    if (indices >= 0) item["indices"] = indices;
    const int mesh = push("meshes", {{"primitives", nlohmann::json::array({item})}});
    push("nodes", {{"mesh", mesh}});
    return doc["meshes"].back()["primitives"][0];
  }
  /// The triangle (0,0,0) (1,0,0) (0,1,0) with normals +z, in one mesh and node.
  nlohmann::json& triangle() {
    const int positions = add<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3");
    const int normals = add<float>({0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
    return primitive({{"POSITION", positions}, {"NORMAL", normals}});
  }

  /// As .gltf with the buffer as a data URI. Returns `path`.
  std::string write(const std::string& path) const {
    nlohmann::json out = doc;
    if (!buffer.empty()) {
      out["buffers"] = nlohmann::json::array(
          {{{"byteLength", buffer.size()},
            {"uri", "data:application/octet-stream;base64," + base64(buffer)}}});
    }
    write_file(path, out.dump());
    return path;
  }
  std::string write_glb(const std::string& path) const {
    nlohmann::json out = doc;
    out["buffers"] = nlohmann::json::array({{{"byteLength", buffer.size()}}});
    std::string text = out.dump(), bin = buffer;
    while (text.size() % 4 != 0) text.push_back(' ');
    while (bin.size() % 4 != 0) bin.push_back('\0');
    const auto u32 = [](std::size_t value) {
      const auto word = static_cast<std::uint32_t>(value);
      std::string raw(4, '\0');
      std::memcpy(raw.data(), &word, 4);
      return raw;
    };
    write_file(path, "glTF" + u32(2) + u32(28 + text.size() + bin.size()) + u32(text.size()) +
                         "JSON" + text + u32(bin.size()) + std::string("BIN\0", 4) + bin);
    return path;
  }
};

}  // namespace pounce::test
