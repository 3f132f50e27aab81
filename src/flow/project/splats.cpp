// SPDX-License-Identifier: Apache-2.0
//
// A splat scene in front of a target: Gaussians blended around the surface that they make.
//
//   fetch: the join. Large Gaussians have blocks of their own (size classes): they are in many
//          pieces' batches, but make no other block's box larger
//   bin:   nothing: blocks bring their trees of spheres
//   hit:   profile, centre, sum
//   blend: sums become colours
//
// A height needs two passes over all Gaussians that its texels may meet: one finds where the
// surface is, the other averages there (projection/splat_blend.cpp). Where they fit the piece's
// batch they are looked at once, packet by packet; else they go past batch by batch, twice. Sums
// are integers, so batches may be cut anywhere.
#include "flow/project/splats.h"

#include <algorithm>
#include <optional>

#include "flow/project/block_walk.h"
#include "flow/project/page_projector.h"
#include "flow/project/splat_costs.h"

namespace pounce::flow {
namespace {

using store::kTexelsPerBlock;

constexpr std::uint64_t kPieceScratch = 256 << 10;  // index pages, encode buffers

std::uint64_t block_state_bytes(std::uint32_t texels, std::uint32_t triangles,
                                std::uint64_t result_texel_bytes) {
  return projection::SplatState::most_bytes(target::TargetBlock::most_packets(texels)) +
         2 * kTexelsPerBlock + std::uint64_t{triangles} * 220 +
         target::TargetBlock::record_bytes(triangles == 0 ? texels : 0) +
         kTexelsPerBlock * result_texel_bytes + texture::kMaskBytes + 4 * kPageBytes;
}

class SplatMethod {
 public:
  /// What a height's Gaussians go past the texels for.
  enum class Pass : std::uint8_t { whole, profile, sum };
  struct Work : PieceWork {
    projection::SplatState state;
    Pass pass = Pass::whole;
    std::optional<BlockWalk<SplatCache>> walk;  ///< over the blocks of this pass
    std::vector<std::shared_ptr<const source::SplatSet>> batch;
    std::vector<const source::SplatSet*> sets;  ///< of the batch
  };

  SplatMethod(JobContext& job, const SplatProjection& request) : job_(&job), request_(request) {}

  static std::size_t channels() { return 1; }
  std::uint64_t fixed_bytes() const {
    const store::SplatDirectory& d = request_.source->store().directory();
    return kPieceScratch + projection::splat_scratch_bytes(0) +
           splat_reading_bytes(d.most_splats, d.largest_chunk_bytes);
  }
  std::uint64_t least_batch_bytes() const {
    return splat_batch_cost(request_.source->store().directory().most_splats);
  }
  std::uint64_t state_bytes(const store::BlockEntry& entry) const {
    return block_state_bytes(entry.texels, entry.triangles, request_.format.texel_bytes());
  }

  void begin(Work& work) const {
    read_packets(*job_, *request_.target, request_.smallest_edge,
                 target::TargetBlock::Start::at_texel, work, work.state.packets, work.state.groups);
    projection::start(request_.limits, work.state);
  }

  /// A pass without any Gaussians goes by here: its batch would be empty.
  std::uint64_t fetch(Work& work) const {
    work.batch.clear();
    work.sets.clear();
    while (!work.state.open.empty()) {
      if (!work.walk) begin_height(work);
      if (!work.walk->done()) return take(work);
      use(work);
      end_pass(work);
    }
    return 0;
  }

  static void bin(Work&) {}

  void hit(Work& work) const {
    use(work);
    if (work.walk->done()) end_pass(work);
  }

  void blend(Work& work) const {
    work.stored.assign(1, std::vector<std::vector<std::byte>>(work.blocks.size()));
    work.raw_bytes.assign(1, 0);
    work.covered.assign(1, 0);
    projection::count_distances(work.state, request_.limits.max_distance, work.distances);
    std::size_t p = 0;  // packets are in the order of their blocks
    for (std::size_t b = 0; b < work.blocks.size(); ++b) {
      const std::size_t first = p;
      while (p < work.state.packets.size() && work.state.packets[p].block == b) ++p;
      blend_block(work, b, first, p);
    }
  }

 private:
  static std::uint64_t cost(const store::SplatEntry& entry) {
    return splat_batch_cost(entry.splats);
  }

  std::vector<Box3f> boxes(const Work& work) const {
    return projection::open_boxes(work.state, work.blocks.size());
  }

  /// In one pass, if all that its texels may meet fits a batch.
  void begin_height(Work& work) const {
    BlockWalk<SplatCache> count(*request_.source, boxes(work));
    std::uint64_t bytes = 0;
    for (; !count.done() && bytes <= work.batch_bytes; count.next()) bytes += cost(*count.entry());
    work.pass = bytes <= work.batch_bytes ? Pass::whole : Pass::profile;
    work.walk.emplace(*request_.source, boxes(work));
  }

  static std::uint64_t take(Work& work) {
    work.batch = work.walk->take(work.batch_bytes, cost);
    std::uint64_t bytes = 0;
    for (const auto& set : work.batch) {
      work.sets.push_back(set.get());
      bytes += source::SplatSet::most_bytes(set->shapes.size());
    }
    return bytes;
  }

  void use(Work& work) const {
    const projection::SplatSets sets(work.sets);
    switch (work.pass) {
      case Pass::whole:
        return projection::blend_height(sets, request_.limits, *request_.kernels, work.state);
      case Pass::profile:
        return projection::profile_batch(sets, request_.limits, *request_.kernels, work.state);
      case Pass::sum:
        return projection::sum_batch(sets, request_.limits, *request_.kernels, work.state);
    }
  }

  void end_pass(Work& work) const {
    work.batch.clear();
    work.sets.clear();
    if (work.pass == Pass::profile) {
      projection::find_centres(request_.limits, work.state);
      work.pass = Pass::sum;
      work.walk.emplace(*request_.source, boxes(work));
      return;
    }
    projection::next_height(request_.limits, work.state);
    work.walk.reset();
  }

  void blend_block(Work& work, std::size_t b, std::size_t first, std::size_t last) const {
    const std::size_t texel_bytes = request_.format.texel_bytes();
    texture::ResultBlock result;
    result.texels.resize(kTexelsPerBlock * texel_bytes);
    std::uint64_t covered = 0;
    for (std::size_t p = first; p < last; ++p) {
      for (int lane = 0; lane < target::kLanes; ++lane) {
        const std::uint16_t texel = work.state.packets[p].texel[lane];
        if (texel == target::kNoTexel) continue;
        const auto colour = projection::splat_colour(work.state.depths[p], lane);
        if (!colour) continue;
        const texture::TexelValue value{{(*colour)[0], (*colour)[1], (*colour)[2], 1}, 3, false};
        texture::store_texel(request_.format, value, result.texels.data() + texel * texel_bytes);
        result.cover(texel);
        ++covered;
      }
    }
    work.covered[0] += covered;
    if (covered > 0) finish_block(*job_, request_.format, result, 0, b, work);
  }

  JobContext* job_;
  SplatProjection request_;
};

}  // namespace

std::unique_ptr<Projection> project_splats(JobContext& job, const SplatProjection& request) {
  return std::make_unique<PageProjector<SplatMethod>>(job, *request.target,
                                                      SplatMethod(job, request));
}

std::uint64_t project_splats_least_bytes(std::uint64_t result_texel_bytes) {
  const std::uint64_t splats = store::kMostSplatsPerBlock;
  return kPieceScratch + projection::splat_scratch_bytes(0) +
         splat_reading_bytes(splats, splats * sizeof(store::Splat) + kPageBytes) +
         splat_batch_cost(splats) +
         block_state_bytes(kTexelsPerBlock, store::kMostTrianglesPerBlock, result_texel_bytes);
}

}  // namespace pounce::flow
