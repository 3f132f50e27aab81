// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tiny_gltf.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "io/gltf/gltf_file.h"
#include "io/json/untrusted.h"

namespace draco {
class Mesh;
}

namespace pounce::io {

inline constexpr const char* kDraco = "KHR_draco_mesh_compression";

/// Checks the extension of a primitive, if it has it. Throws Error(input).
void check_draco(const JsonCheck& check, const nlohmann::json& primitive, const std::string& place);

/// Has this primitive to be unpacked? Not where all that is packed is there as plain data, too:
/// that is exact.
bool is_draco(const GltfFile& file, const tinygltf::Model& model,
              const tinygltf::Primitive& primitive);

/// As many vertices as may come of it: some more than its accessors say, since Draco parts vertices
/// where surfaces only touch, and exporters count before.
std::uint64_t most_draco_vertices(std::uint64_t accessor_count);

/// What unpacking it takes at most, besides what is read of it.
std::uint64_t draco_bytes(const GltfFile& file, const tinygltf::Model& model,
                          const tinygltf::Primitive& primitive);

/// A primitive unpacked: what its accessors hold that have no bytes of their own.
class DracoPrimitive {
 public:
  /// Throws Error(input) naming `place` where the data are damaged, or hold anything else than the
  /// accessors say: nothing is unpacked that is much larger.
  DracoPrimitive(const GltfFile& file, const tinygltf::Model& model,
                 const tinygltf::Primitive& primitive, const std::string& place);
  ~DracoPrimitive();
  DracoPrimitive(const DracoPrimitive&) = delete;
  DracoPrimitive& operator=(const DracoPrimitive&) = delete;

  /// Is it an attribute that was packed?
  bool has(int accessor) const { return attributes_.contains(accessor); }
  bool is_indices(int accessor) const { return accessor == indices_; }
  std::uint64_t vertices() const;
  std::uint64_t triangles() const;
  /// Three for each triangle.
  void read_indices(std::uint32_t* out) const;
  /// Elements from `first` on as the accessor would have them in its buffer, without gaps.
  void read(int accessor, std::uint64_t first, std::uint64_t count, std::span<std::byte> out) const;

 private:
  [[noreturn]] void fail(const std::string& what) const;
  void require_all_packed(const tinygltf::Primitive& primitive, std::uint64_t vertices) const;
  void find_attribute(const tinygltf::Primitive& primitive, const std::string& name,
                      std::uint32_t id);

  const GltfFile& file_;
  const tinygltf::Model& model_;
  std::string place_;
  int indices_ = -1;
  std::unique_ptr<draco::Mesh> mesh_;
  std::map<int, int> attributes_;  ///< by accessor: the attribute of mesh_
};

}  // namespace pounce::io
