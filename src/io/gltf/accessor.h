// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tiny_gltf.h>

#include <cstdint>
#include <string>
#include <vector>

#include "io/gltf/draco.h"
#include "io/gltf/gltf_file.h"

namespace pounce::io {

/// Reads the elements of accessors, whatever their component type, stride, normalisation and sparse
/// part; one without a buffer view is all zeros, or `unpacked`. Bytes come from the file in pieces
/// of about 1 MiB. `place` names the user of the accessor in messages ("mesh 0 \"Head\" primitive 1
/// POSITION").
class AccessorReader {
 public:
  AccessorReader(const GltfFile& file, const tinygltf::Model& model,
                 const DracoPrimitive* unpacked = nullptr)
      : file_(file), model_(model), unpacked_(unpacked) {}

  const tinygltf::Accessor& accessor(int index) const { return model_.accessors.at(idx(index)); }
  std::uint64_t count(int index) const;

  /// Throws Error(input) if an accessor without bytes (all zeros) claims more than `most` elements:
  /// where nothing else bounds them, this stands between a tiny file and a huge allocation.
  void check_unbacked(int index, std::uint64_t most, const std::string& place) const;

  /// Fills out[0 .. count * components) with real numbers; normalised integers become 0..1 or
  /// -1..1. Throws Error(input) for NaN and infinity unless `any_value`.
  void read_floats(int index, float* out, const std::string& place, bool any_value = false) const;
  /// The same for unsigned integers (indices, joints).
  void read_whole(int index, std::uint32_t* out, const std::string& place) const;
  /// Elements [first, first + count) of an accessor that has a buffer view and no sparse part, as
  /// real numbers of any value.
  void read_range(int index, std::uint64_t first, std::uint64_t count, float* out) const;

  [[noreturn]] void fail(int index, const std::string& place, const std::string& what) const;

 private:
  static std::size_t idx(int index) { return static_cast<std::size_t>(index); }
  template <class Out>
  void read(int index, Out* out, const std::string& place) const;
  template <class Out>
  void read_elements(const tinygltf::Accessor& accessor, std::uint64_t first, std::uint64_t count,
                     Out* out) const;
  template <class Out>
  void read_unpacked(int index, Out* out) const;
  template <class Out>
  void read_sparse(const tinygltf::Accessor& accessor, int index, Out* out,
                   const std::string& place) const;

  const GltfFile& file_;
  const tinygltf::Model& model_;
  const DracoPrimitive* unpacked_;  ///< of the primitive at hand, if it is packed
};

/// UV sets beyond these are ignored; no tool writes more.
inline constexpr std::size_t kMaxUvSets = 8;

/// How many vertices and triangles a primitive gives, and which UV sets it has, judged by its
/// accessors alone.
struct PrimitiveShape {
  std::uint64_t vertices = 0;  ///< in the file
  /// In the Mesh: three per triangle where there are no normals (flat).
  std::uint64_t flattened = 0;
  std::uint64_t triangles = 0;
  std::size_t uv_sets = 0;  ///< one more than the highest TEXCOORD_n
  std::size_t joint_sets = 0;
  bool is_surface = false;  ///< triangles with positions; points and lines are not
  bool has_normals = false;
  bool has_colours = false;  ///< COLOR_0, of a type that glTF has for colours
  bool is_packed = false;    ///< with Draco
};

/// Checks types and counts of every attribute. Throws Error(input) naming place and accessor.
PrimitiveShape check_primitive(const AccessorReader& accessors,
                               const tinygltf::Primitive& primitive, const std::string& place,
                               std::size_t skin_joints);

}  // namespace pounce::io
