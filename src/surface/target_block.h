// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <vector>

#include "core/bounds.h"
#include "core/page_pool.h"
#include "store/blocks/geometry_block.h"

namespace pounce::surface {

inline constexpr int kLanes = 16;  ///< texels in a packet: one AVX-512 register of floats

/// Sixteen target texels that lie together on the surface: structure of arrays, one lane each.
/// Unused lanes have a zero normal, which faces nothing.
struct alignas(64) TexelPacket {
  float px[kLanes], py[kLanes], pz[kLanes];  ///< where the ray starts
  float nx[kLanes], ny[kLanes], nz[kLanes];  ///< unit normal
  float per_texel[kLanes];                   ///< 1 / the texel's edge on the surface
  std::uint16_t texel[kLanes];  ///< y * 64 + x within the block; kNoTexel in unused lanes
  std::uint16_t owner[kLanes];  ///< triangle (record) of the block; of unused lanes some other
  std::uint32_t block = 0;      ///< index of the block in its piece of work
  /// A power of two, two to four times the largest coordinate of the triangles that own the texels:
  /// distances from here are as exact as this is large (step_of()). Of records whose step is
  /// coarser than that: what makes it their step.
  float coarseness = 0;
  bool is_inset = false;  ///< some ray starts elsewhere than at its texel's own point
  /// From the texel's own point to where the ray starts, in whole steps: a little into the owner.
  std::int8_t inset_x[kLanes], inset_y[kLanes], inset_z[kLanes];
};
inline constexpr std::uint16_t kNoTexel = 0xFFFF;

/// What distances from these texels are told apart by, in space: the last place of `coarseness`,
/// four of a coordinate's, about what a hit's arithmetic loses.
inline constexpr float kStepShare = 0x1p-23F;
inline float step_of(const TexelPacket& packet) { return packet.coarseness * kStepShare; }

/// Packets of one 8x8 window, or with Order::in_space of one block, that lie together: looked up at
/// once.
struct PacketGroup {
  std::uint32_t first = 0, count = 0;
};

/// From a texel to the next of its triangle, on the surface.
struct TexelAxes {
  Vec3f x, y;
};

/// The projection maps of a block, by texel: position, normal and the texel's edge on the surface.
class TargetBlock {
 public:
  enum class Start {
    at_texel,  ///< rays start where their texel is
    inset      ///< 32 steps inside of its owner
  };
  /// `smallest_edge` bounds the texel's edge from below (for triangles without area in space), > 0.
  TargetBlock(const store::GeometryBlock& block, const mesh::Lattice& lattice, float smallest_edge,
              Start start = Start::at_texel);

  struct Texel {
    Vec3f position, normal;
    float per_texel = 0;
  };
  /// `texel` must be covered.
  Texel texel(std::uint32_t texel) const;
  Vec3f position(std::uint32_t texel) const;  ///< of that alone
  bool covered(std::uint32_t texel) const { return owner_[texel] != store::kNoTriangle; }

  enum class Order {
    in_windows,  ///< packets never cross an 8x8 window of the image
    in_space     ///< texels of small charts share packets with what lies near them
  };
  /// Gaussians count the same whoever shares a packet; of surfaces ties would break differently.
  static constexpr Order order_of(Start start) {
    return start == Start::at_texel ? Order::in_space : Order::in_windows;
  }
  /// Appends the block's packets and groups. Texels that lie far apart (another chart) do not share
  /// one, unless there would be more than most_packets(). A packet does not depend on how the
  /// target is cut.
  void make_packets(std::uint32_t block_index, PageVector<TexelPacket>& packets,
                    std::vector<PacketGroup>& groups, Order order = Order::in_windows) const;
  /// How many packets that appends, by making them.
  std::size_t count_packets(Order order) const;
  /// What making packets takes beside them, at most.
  static constexpr std::uint64_t kPackingBytes = 164 << 10;
  /// The axes of each triangle's texels; empty for a block of records, whose texels are known by
  /// their edges alone.
  std::vector<TexelAxes> axes() const;
  /// At most so many packets for a block with so many covered texels: 64 windows of up to 4
  /// clusters, or of joined fragments not more than one in eleven texels.
  static constexpr std::uint32_t most_packets(std::uint32_t texels) {
    return texels < 448 ? texels : 448;
  }
  /// Bytes of a decoded block of so many records and of its maps.
  static std::uint64_t record_bytes(std::uint64_t records) {
    return records * (sizeof(store::TexelRecord) + store::kRecordBytes + sizeof(RecordTexel));
  }

  /// The block with records instead of triangles, for a dense target: the maps that they give
  /// differ by no more than single precision does, or a few 1/2048 of a texel. Nothing where that
  /// cannot be. `block` is what these maps were made from, with Start::inset.
  std::optional<store::GeometryBlock> as_records(const store::GeometryBlock& block) const;

 private:
  /// A decoded record.
  struct RecordTexel {
    Texel map;
    std::array<std::int8_t, 3> inset{};
  };
  using Four = float __attribute__((vector_size(16)));
  struct Affine {
    Vec3f p, pu, pv, n, nu, nv;
    float x = 0, y = 0;  ///< anchor, in texels of the block
    float per_texel = 0;
    float coarseness = 0;  ///< see TexelPacket
    /// One of the vectors, and what lies behind it.
    Four four(Vec3f Affine::*vector) const {
      Four out;
      std::memcpy(&out, static_cast<const void*>(&(this->*vector)), sizeof out);
      return out;
    }
  };
  /// By sign bits, so -0 counts as negative. A start that is moved for it moves by nothing.
  static bool any_negative(Four v) {
    std::array<std::int32_t, 4> bits;
    std::memcpy(bits.data(), &v, sizeof bits);
    return (bits[0] | bits[1] | bits[2] | bits[3]) < 0;
  }
  /// A triangle's edges in the image, each as an affine function: how far inside of it a texel
  /// lies, in texels. The fourth is always inside.
  struct Edges {
    Four x{}, y{}, at_anchor{};
    float most = 0;  ///< no ray starts farther inside
    /// How much farther inside than `start` a texel is, `dx` and `dy` from the anchor.
    Four beyond(float dx, float dy, float start) const {
      return at_anchor + (x * dx + y * dy) - start;
    }
  };
  static Edges make_edges(const std::array<Vec2d, 3>& corners, Vec2d anchor);
  /// How far inside of a triangle rays start where distances have this coarseness, in texels.
  float start_of(std::uint16_t triangle, float coarseness) const;
  /// From a point of a triangle to where its ray starts; see Edges::beyond.
  Vec3f way_inside(std::uint16_t triangle, Four beyond) const;
  float record_step() const;
  store::TexelRecord record(std::uint32_t texel, float step) const;
  void read_records(const store::GeometryBlock& block, float smallest_edge, Start start);
  void fill_records(const std::uint16_t* texels, std::size_t count, TexelPacket& packet) const;
  bool has_records() const { return !records_.empty(); }
  float per_texel(std::uint32_t texel) const {
    return has_records() ? records_[owner_[texel]].map.per_texel
                         : triangles_[owner_[texel]].per_texel;
  }
  struct Window;
  Window window(std::uint32_t index) const;
  bool is_deep(const Window& window) const;
  bool is_together(const Window& window, std::vector<std::uint8_t>& last_asked,
                   std::uint8_t index) const;
  std::size_t take_cluster(Window& rest, bool all, std::array<std::uint16_t, 64>& out) const;
  void add_group(std::span<const std::uint16_t> texels, bool is_deep, std::uint32_t block,
                 PageVector<TexelPacket>& packets, std::vector<PacketGroup>& groups) const;
  void make_packets_in_space(std::uint32_t block_index, PageVector<TexelPacket>& packets,
                             std::vector<PacketGroup>& groups) const;
  void fill(const std::uint16_t* texels, std::size_t count, bool is_deep,
            TexelPacket& packet) const;
  bool is_of_one(const std::uint16_t* texels, std::size_t count) const;
  void move_starts(std::size_t count, TexelPacket& packet) const;
  void fill_deep(const std::uint16_t* texels, std::size_t count, TexelPacket& packet) const;
  static void make_unit(TexelPacket& packet);
  void move_start(std::size_t lane, Four beyond, TexelPacket& packet) const;

  std::vector<std::uint16_t> owner_;
  std::vector<Affine> triangles_;
  std::vector<Edges> edges_;  ///< by triangle; empty where rays start at their texels
  // Instead of triangles, for a block of records.
  std::vector<RecordTexel> records_;
  float records_coarseness_ = 0;
  bool records_are_inset_ = false;
};

/// Tight boxes around the covered texels of each triangle, for the index.
std::vector<Box3f> texel_boxes(const store::GeometryBlock& block, const mesh::Lattice& lattice);

}  // namespace pounce::surface
