// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/bounds.h"
#include "core/directions.h"
#include "core/vec.h"
#include "mesh/block_bins.h"

namespace pounce::store {

inline constexpr std::size_t kTexelsPerBlock = std::size_t{mesh::kBlockEdge} * mesh::kBlockEdge;
/// Vertices are indexed by 16 bits, and a block's decoded size stays small whatever the mesh.
inline constexpr std::uint32_t kMostTrianglesPerBlock = 4096;
/// No encoded block is larger: three vertices of its own for each of the most triangles, and a run
/// for each texel.
inline constexpr std::size_t kLargestGeometryBytes =
    28 + (3 * 56 + 18) * std::size_t{kMostTrianglesPerBlock} + 4 * kTexelsPerBlock;

inline constexpr std::uint16_t kNoTriangle = 0xFFFF;

/// What a projection needs of one covered texel. Where a block of a target has about as many
/// triangles as texels, these are smaller than the triangles and quicker to read. Its length unit
/// is the block's `step`.
struct TexelRecord {
  std::array<std::int32_t, 3> position{};  ///< in steps
  Octahedral normal{};
  std::uint16_t edge = 0;              ///< upper half of a float's bits: the texel's edge in space
  std::array<std::int8_t, 3> inset{};  ///< from the position to where the ray starts, in steps
  bool operator==(const TexelRecord&) const = default;
};

/// Positions are no larger: times the step they are exact floats.
inline constexpr std::int32_t kLargestPosition = 1 << 24;
inline constexpr float kSmallestStep = 0x1p-126F, kLargestStep = 0x1p100F;
/// Bytes of a record before compression.
inline constexpr std::size_t kRecordBytes = 3 * 4 + 2 * 2 + 2 + 3;

/// What reproduces a 64x64 window of texels: the triangles that touch it and, on the target, which
/// of them owns each texel centre. Positions, normals and dual frames of all texels (or Gaussians)
/// follow from it, at a fraction of a byte per texel. A dense block of a target has records instead
/// of vertices and triangles; one of a source may have fewer triangles than the mesh.
struct GeometryBlock {
  std::uint32_t page = 0;
  std::int32_t x = 0, y = 0;  ///< block coordinates in the page
  // Vertices: structure of arrays, each of the same length.
  std::vector<Vec3f> positions;
  std::vector<Vec3f> normals;
  std::vector<Vec2f> uvs;  ///< as in the mesh: the page's lattice makes them texels
  std::vector<std::array<std::int16_t, 4>> tangents;  ///< unit vector and handedness, times 32767
  std::vector<Vec4f> colours;  ///< of a source where they are asked for, else empty
  // Triangles.
  std::vector<std::array<std::uint16_t, 3>> triangles;  ///< vertex indices
  std::vector<std::uint32_t> ids;  ///< index in the mesh file's order, of one that it stands for
  std::vector<std::array<std::int32_t, 2>> shifts;  ///< periods to subtract; empty: all zero
  /// Target only: kTexelsPerBlock triangle indices in raster order, kNoTriangle where no centre is
  /// covered.
  std::vector<std::uint16_t> owner;
  // Dense blocks of a target: one record per covered texel; `owner` is a texel's record then.
  float step = 0;  ///< what records count in, a power of two
  std::vector<TexelRecord> records;

  std::array<Vec2d, 3> texel_corners(const mesh::Lattice& lattice, std::size_t triangle) const;
};

/// Serialises a block into `raw` (replaced), filtered for compression. Layout: docs/tile-format.md.
void encode(const GeometryBlock& block, std::vector<std::byte>& raw);
/// The inverse. Throws Error(damaged_store) naming `name` if `raw` is not what encode() makes.
GeometryBlock decode_geometry(std::span<const std::byte> raw, const std::string& name);

/// Collects triangles of a mesh into a block, sharing vertices.
class GeometryBlockBuilder {
 public:
  /// `with_colours`: its blocks have those of the mesh.
  explicit GeometryBlockBuilder(const mesh::Mesh& mesh, bool with_colours = false);
  /// Begins an empty block that will hold at most `most_triangles`.
  void start(std::uint32_t page, std::int32_t x, std::int32_t y, std::size_t most_triangles);
  /// Adds a triangle and returns its index in the block.
  std::uint16_t add(const mesh::TriangleInstance& instance, std::uint32_t uv_set, bool has_image);
  /// The same of a triangle that the mesh does not have: `points` are what add_point() returned.
  std::uint16_t add(const std::array<std::uint16_t, 3>& points, std::uint32_t id);
  /// Adds a vertex that the mesh does not have, to a block without colours.
  std::uint16_t add_point(Vec3f position, Vec3f normal, Vec2f uv, Vec4f tangent);
  GeometryBlock& block() { return block_; }
  bool full() const { return block_.triangles.size() >= kMostTrianglesPerBlock; }

 private:
  std::uint16_t local_vertex(std::uint32_t vertex, std::uint32_t uv_set, bool has_image);

  const mesh::Mesh& mesh_;
  bool with_colours_;
  GeometryBlock block_;
  std::vector<std::pair<std::uint32_t, std::uint16_t>>
      slots_;  // open addressing: mesh vertex -> local
};

}  // namespace pounce::store
