// SPDX-License-Identifier: Apache-2.0
//
// What a scene's Gaussians (splats.cpp) and a mesh's texels as Gaussians (gaussians.cpp) have in
// common when they go past the pieces of a target: costs, batches, and colours that become results.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "flow/project/page_projector.h"
#include "gaussian/splat_set.h"
#include "projection/splat_packet.h"
#include "store/blocks/splat_block.h"

namespace pounce::flow {

/// What one block of Gaussians costs a batch: itself prepared, and its share of the candidates.
inline std::uint64_t splat_batch_cost(std::uint64_t splats, std::uint32_t lobes) {
  return gaussian::SplatSet::most_bytes(splats, lobes) +
         splats * projection::SplatCandidates::kBytes;
}

/// The part of a Method (page_projector.h) that does not depend on how Gaussians are blended.
/// `State`: of a piece's texels. `Request`: SplatProjection or GaussianProjection.
template <class Request, class State>
class SplatMethodBase {
 public:
  /// What fits one batch is looked at once instead of twice: a capture of millions in front of a
  /// piece. A thread has one at a time: a second would hold memory and wait.
  static constexpr PieceSize kPieceSize{512ULL << 20, 8, true, 1};

  struct Work : PieceWork {
    State state;
    std::optional<BlockWalk<SplatCache>> walk;  ///< over the blocks of this pass
    std::vector<std::shared_ptr<const gaussian::SplatSet>> batch;
    std::vector<const gaussian::SplatSet*> sets;  ///< of the batch
    gaussian::SplatSet near;                      ///< a batch that is sifted
    std::size_t packets = 0;                      ///< that the piece has room for
  };

  std::size_t channels() const { return request_.channels(); }
  std::uint64_t fixed_bytes() const {
    return at_most(least_batch_bytes()) - least_batch_bytes() + request_.lookup_bytes();
  }
  std::uint64_t least_batch_bytes() const {
    return splat_batch_cost(request_.source->store().directory().most_splats, lobes());
  }
  BlockCost state_cost(const store::BlockEntry& entry) const {
    const auto most = surface::TargetBlock::most_packets(entry.texels);
    const std::uint64_t packets = is_roomy() ? most : count_packets(entry);
    const std::uint64_t looks = request_.packet_bytes(packets) + request_.profile_bytes(packets);
    const std::uint64_t beside = request_.beside_bytes(packets) + result_bytes();
    return request_.looks_in_turn() ? BlockCost(beside, looks) : BlockCost(beside + looks);
  }
  /// What projecting one block needs at once, whatever is in it; its packets take
  /// request.packet_bytes(most_packets()) and their profiles.
  static std::uint64_t least_bytes(std::uint64_t result_texel_bytes, std::size_t channels,
                                   std::uint32_t lobes, std::uint64_t packet_bytes) {
    constexpr std::uint64_t kSplats = store::kMostSplatsPerBlock;
    const std::uint64_t chunk =
        kSplats * (sizeof(store::Splat) + store::lobe_bytes(lobes)) + kPageBytes;
    return at_most(splat_batch_cost(kSplats, lobes), reading_bytes(kSplats, true, lobes, chunk),
                   block_bytes(store::kMostTrianglesPerBlock, result_texel_bytes)) +
           packet_bytes + result_bytes(result_texel_bytes, channels);
  }

  static constexpr std::uint32_t most_packets() {
    return surface::TargetBlock::most_packets(store::kTexelsPerBlock);
  }

  void begin(Work& work) const {
    read_packets(*job_, *index_, request_.smallest_edge, surface::TargetBlock::Start::at_texel,
                 work, work.state.packets, work.state.groups);
    has_read(work.state.packets, work);
    projection::start(request_.limits, work.state);
  }

  static void bin(Work&) {}  // blocks bring their trees of spheres

  /// By one work at a time.
  void keep(const PieceWork& work) const {
    if (request_.keeper != nullptr) request_.keeper->store(work);
  }

 protected:
  SplatMethodBase(job::JobContext& job, Request request)
      : job_(&job),
        request_(std::move(request)),
        index_(std::make_shared<TargetIndex>(request_.target)) {}

  std::uint64_t cost(const store::SplatEntry& entry) const {
    return splat_batch_cost(entry.splats, lobes());
  }
  /// What the blocks that some of these boxes meet cost a batch; of more than `most` some of it.
  std::uint64_t cost(std::vector<Box3f> boxes, std::uint64_t most) const {
    std::uint64_t bytes = 0;
    for (BlockWalk<SplatCache> walk(*request_.source, std::move(boxes));
         !walk.done() && bytes <= most; walk.next()) {
      bytes += cost(*walk.entry());
    }
    return bytes;
  }
  void has_read(PageVector<surface::TexelPacket>& packets, Work& work) const {
    if (!is_roomy()) packets.shrink_to_fit();  // a copy, and memory that no other piece has left
    work.packets = packets.capacity();
  }
  /// What a piece that has begun holds whatever its batch is, but for profiles.
  std::uint64_t begun_bytes(const Work& work) const {
    return fixed_bytes() + request_.packet_bytes(work.state.packets.capacity()) +
           request_.beside_bytes(work.packets) + work.blocks.size() * result_bytes();
  }

  /// The walk's next blocks become the batch. Returns their bytes.
  std::uint64_t take(Work& work) const {
    work.batch = work.walk->take(work.batch_bytes,
                                 [this](const store::SplatEntry& entry) { return cost(entry); });
    std::uint64_t bytes = 0;
    for (const auto& set : work.batch) {
      work.sets.push_back(set.get());
      bytes += gaussian::SplatSet::most_bytes(set->shapes.size(), lobes());
    }
    return bytes;
  }
  /// Of the walk's next blocks what the texels may meet becomes the batch: as much as it holds,
  /// from fewer bytes than whole blocks take that a batch has no room for. Returns the bytes that
  /// it went through; the batch is empty if that was the last of the walk, and nothing was met.
  std::uint64_t sift(Work& work) const {
    const store::SplatStore& store = request_.source->store();
    const std::size_t most = most_sifted(work.batch_bytes);
    std::vector<std::uint16_t> near;
    std::uint64_t bytes = 0;
    for (; !work.walk->done(); work.walk->next()) {
      job_->meter.throw_if_cancelled();
      const store::SplatEntry& entry = *work.walk->entry();
      const store::SplatBlock block = store.read_block(entry, job_->compressor());
      bytes += store::SplatBlock::decoded_bytes(block.size(), !block.normal[0].empty(), lobes());
      gaussian::find_near(block, work.walk->boxes_at(entry), near);
      if (near.empty()) continue;
      if (work.near.shapes.size() + near.size() > most) break;
      if (work.near.shapes.capacity() == 0) work.near.reserve(most, lobes());
      gaussian::add_splats(block, near, request_.source->reader().harmonics, work.near);
    }
    if (work.near.shapes.empty()) return bytes;
    gaussian::finish(work.near);
    work.sets.push_back(&work.near);
    return bytes;
  }

  static void drop_batch(Work& work) {
    work.sets.clear();
    work.batch.clear();
    work.near.clear();
  }

  /// What channel c has of a packet's lanes that are found (a bit each).
  struct PacketValues {
    std::uint32_t found = 0;
    shading::TexelValues values;
  };
  /// Of packets of the piece from `first` on, those of whole blocks; values_of(c, packet) are their
  /// PacketValues, good until it is called again.
  template <class ValuesOf>
  void blend_blocks(Work& work, std::span<const surface::TexelPacket> packets, std::size_t first,
                    const ValuesOf& values_of) const {
    if (work.stored.empty()) {
      work.stored.assign(channels(), std::vector<std::vector<std::byte>>(work.blocks.size()));
      work.raw_bytes.assign(channels(), 0);
      work.covered.assign(channels(), 0);
      work.clipped.assign(channels(), 0);
    }
    while (first < packets.size()) {  // packets are in the order of their blocks
      const std::size_t begin = first, b = packets[first].block;
      while (first < packets.size() && packets[first].block == b) ++first;
      for (std::size_t c = 0; c < channels(); ++c)
        blend_block(work, c, b, packets.subspan(begin, first - begin), begin, values_of);
    }
  }

  job::JobContext* job_;
  Request request_;
  std::shared_ptr<TargetIndex> index_;

 private:
  std::uint32_t lobes() const { return request_.source->store().directory().lobes; }
  /// How many Gaussians a batch of so many bytes holds: those of the largest block at least, and
  /// one of few numbers, so that the pool has the memory of another batch ready.
  std::size_t most_sifted(std::uint64_t batch_bytes) const {
    constexpr std::uint64_t kMany = 1 << 20, kStep = 256;
    std::uint64_t most = batch_bytes * kMany / splat_batch_cost(kMany, lobes());
    while (splat_batch_cost(most, lobes()) > batch_bytes) most -= std::min(most, kStep);
    most -= most % std::max<std::uint64_t>(std::bit_floor(most) / 8, 1);
    return std::max<std::uint64_t>(most, request_.source->store().directory().most_splats);
  }
  std::uint64_t result_bytes() const { return result_bytes(result_texel_bytes(), channels()); }
  /// Are pieces so small, in themselves and beside the budget, that they may cost what they cost at
  /// most?
  bool is_roomy() const {
    constexpr std::uint64_t kSmall = 24 << 20;
    const std::uint64_t block = request_.packet_bytes(most_packets()) +
                                request_.profile_bytes(most_packets()) +
                                request_.beside_bytes(most_packets()) + result_bytes();
    const std::uint64_t most = kPieceSize.most_blocks * block;
    return most <= kSmall &&
           most <= job_->budget.limit() / (8 * std::uint64_t{std::max(job_->threads, 1U)});
  }
  /// Of a block: 256 where it is full and no charts meet, while there may be 448. To make them
  /// twice costs 30 ns per texel, a twentieth of what it takes to blend one.
  std::uint64_t count_packets(const store::BlockEntry& entry) const {
    const std::uint64_t most = surface::TargetBlock::most_packets(entry.texels);
    const runtime::Lease lease(job_->budget,
                               at_most(0) + round_to_pages(most * sizeof(surface::TexelPacket)),
                               "projecting one block of the target");
    const store::GeometryStore& target = *request_.target;
    const surface::TargetBlock maps(target.read_block(entry, job_->compressor()),
                                    target.directory().pages[entry.page], request_.smallest_edge);
    return maps.count_packets(surface::TargetBlock::Order::in_space);
  }
  std::uint64_t result_texel_bytes() const {
    std::uint64_t bytes = 0;
    for (std::size_t c = 0; c < channels(); ++c) bytes += request_.format_of(c).texel_bytes();
    return bytes;
  }
  /// What a piece holds beside its texels' state and its results: with a batch of so many bytes, or
  /// without one, while a block of the target is read or one of its results is made.
  static std::uint64_t at_most(std::uint64_t batch_bytes, std::uint64_t reading_bytes,
                               std::uint64_t block_bytes) {
    constexpr std::uint64_t kPieceScratch = 128 << 10;  // index pages, boxes
    return kPieceScratch +
           std::max(batch_bytes + std::max(reading_bytes, State::scratch_bytes(0)), block_bytes);
  }
  std::uint64_t at_most(std::uint64_t batch_bytes) const {
    const store::SplatDirectory& d = request_.source->store().directory();
    const std::uint64_t block =  // places have none
        request_.target == nullptr
            ? 0
            : block_bytes(request_.target->directory().most_triangles, result_texel_bytes());
    return at_most(batch_bytes,
                   reading_bytes(d.most_splats, d.has_normals, d.lobes, d.largest_chunk_bytes),
                   block);
  }
  /// Stored bytes and raw ones are there at once, then raw ones and the block.
  static std::uint64_t reading_bytes(std::uint64_t splats, bool normals, std::uint32_t lobes,
                                     std::uint64_t chunk_bytes) {
    return chunk_bytes +
           std::max(chunk_bytes, store::SplatBlock::decoded_bytes(splats, normals, lobes));
  }
  /// A block of a target: of triangles, or as many records as texels; then its results, raw and
  /// stored.
  static std::uint64_t block_bytes(std::uint32_t triangles, std::uint64_t result_texel_bytes) {
    return 2 * store::kTexelsPerBlock + surface::TargetBlock::kPackingBytes +
           std::max({std::uint64_t{triangles} * 220,
                     surface::TargetBlock::record_bytes(store::kTexelsPerBlock),
                     4 * store::kTexelsPerBlock * result_texel_bytes});
  }
  static std::uint64_t result_bytes(std::uint64_t texel_bytes, std::uint64_t channels) {
    return store::kTexelsPerBlock * texel_bytes + channels * (shading::kMaskBytes + kPageBytes) +
           sizeof(store::BlockEntry);
  }

  template <class ValuesOf>
  void blend_block(Work& work, std::size_t c, std::size_t b,
                   std::span<const surface::TexelPacket> packets, std::size_t first,
                   const ValuesOf& values_of) const {
    static_assert(surface::kLanes == shading::kValues);
    const shading::TexelFormat& format = request_.format_of(c);
    shading::ResultBlock result;
    result.texels.resize(store::kTexelsPerBlock * format.texel_bytes());
    std::uint64_t covered = 0;
    for (std::size_t p = 0; p < packets.size(); ++p) {
      const std::uint16_t(&texel)[surface::kLanes] = packets[p].texel;
      const PacketValues of_packet = values_of(c, first + p);
      work.clipped[c] += shading::store_texels(format, of_packet.values, of_packet.found, texel,
                                               result.texels.data());
      for (std::uint32_t found = of_packet.found; found != 0; found &= found - 1, ++covered)
        result.cover(texel[std::countr_zero(found)]);
    }
    work.covered[c] += covered;
    if (covered == 0) return;
    // What stays in the cache is kept small.
    store::PlainRoom* const room = request_.keeper == nullptr ? job_->scratch_room() : nullptr;
    finish_block(*job_, format, result, c, b, room, work);
  }
};

}  // namespace pounce::flow
