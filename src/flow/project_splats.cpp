// SPDX-License-Identifier: Apache-2.0
//
// The join of a splat scene's store with a target's: blocks of Gaussians stream past each piece of
// the target.
//
//   target_stream: read ─▶ search ─▶ blend ─▶ store
//                             │ (join, gather, profile, centre, sum: height after height)
//                          splat store
//
// A height needs two passes over all Gaussians that its texels may meet: one finds where the
// surface is, the other averages there (projection/splat_blend.cpp). Where they fit the piece's
// batch they are looked at once, packet by packet; else they go past batch by batch, twice. Sums
// are integers, so batches may be cut anywhere. Large Gaussians have blocks of their own (size
// classes): they are in many pieces' batches, but make no other block's box larger.
#include "flow/project_splats.h"

#include <algorithm>

#include "flow/splat_cache.h"

namespace pounce::flow {
namespace {

using tiles::kTexelsPerBlock;

constexpr std::uint64_t kPieceScratch = 256 << 10;  // index pages, encode buffers

/// What one block costs a batch: itself prepared, and its share of the candidates.
std::uint64_t batch_cost(std::uint64_t splats) {
  return source::SplatSet::most_bytes(splats) + splats * projection::SplatCandidates::kBytes;
}

/// What reading a block takes until it is prepared.
std::uint64_t reading_bytes(std::uint64_t splats, std::uint64_t chunk_bytes) {
  return tiles::SplatBlock::decoded_bytes(splats, true) + 3 * chunk_bytes;
}

std::uint64_t block_state_bytes(std::uint32_t texels, std::uint32_t triangles,
                                std::uint64_t result_texel_bytes) {
  return projection::SplatState::most_bytes(target::TargetBlock::most_packets(texels)) +
         2 * kTexelsPerBlock + std::uint64_t{triangles} * 220 +
         kTexelsPerBlock * result_texel_bytes + texture::kMaskBytes + 4 * kPageBytes;
}

struct Work : PieceWork {
  projection::SplatState state;
};

class SplatProjector : public PageProjector {
 public:
  SplatProjector(JobContext& job, const SplatProjection& request)
      : job_(job), request_(request), cache_(job, *request_.source) {
    cut();
  }

  ~SplatProjector() override { job_.report.tiles_read += cache_.tiles_read(); }

  PageResult project(std::uint32_t page) override {
    return stream_page<Work>(
        job_, *request_.target, target_.pieces, page, 1,
        [&](const Piece& piece) { return read_piece(piece); },
        [&](Work& work) { search_piece(work); }, [&](Work& work) { blend_piece(work); });
  }

 private:
  void cut() {
    const tiles::SplatDirectory& d = request_.source->directory();
    const std::uint64_t fixed = kPieceScratch + projection::splat_scratch_bytes(0) +
                                reading_bytes(d.most_splats, d.largest_chunk_bytes);
    target_ = cut_target(job_, *request_.target, fixed, batch_cost(d.most_splats),
                         [&](const tiles::BlockEntry& entry) {
                           return block_state_bytes(entry.texels, entry.triangles,
                                                    request_.format.texel_bytes());
                         });
  }

  std::shared_ptr<Work> read_piece(const Piece& piece) {
    auto work = std::make_shared<Work>();
    read_packets(job_, *request_.target, piece, request_.smallest_edge,
                 target::TargetBlock::Start::at_texel, *work, work->state.packets,
                 work->state.groups);
    projection::start(request_.limits, work->state);
    return work;
  }

  void search_piece(Work& work) {
    projection::SplatState& state = work.state;
    while (!state.open.empty()) {
      const auto boxes = projection::open_boxes(state, work.blocks.size());
      std::uint64_t bytes = 0;
      for_blocks(boxes, [&](const tiles::SplatEntry& entry) { bytes += batch_cost(entry.splats); });
      if (bytes <= target_.batch_bytes) {
        for_batches(boxes, [&](projection::SplatSets sets) {
          projection::blend_height(sets, request_.limits, *request_.kernels, state);
        });
      } else {
        for_batches(boxes, [&](projection::SplatSets sets) {
          projection::profile_batch(sets, request_.limits, *request_.kernels, state);
        });
        projection::find_centres(request_.limits, state);
        for_batches(boxes, [&](projection::SplatSets sets) {
          projection::sum_batch(sets, request_.limits, *request_.kernels, state);
        });
      }
      projection::next_height(request_.limits, state);
    }
  }

  /// use(entry) for every block that some box meets.
  template <class Use>
  void for_blocks(const std::vector<Box3f>& boxes, Use use) {
    Box3f all;
    for (const Box3f& box : boxes) all.extend(box);
    const auto& tiles = request_.source->directory().tiles;
    for (std::uint32_t t = 0; t < tiles.size(); ++t) {
      if (!tiles[t].box.overlaps(all)) continue;
      const auto index = cache_.index(t);
      for (const tiles::SplatEntry& entry : *index) {
        if (std::any_of(boxes.begin(), boxes.end(),
                        [&](const Box3f& box) { return entry.box.overlaps(box); })) {
          use(entry);
        }
      }
    }
  }

  /// use(sets) for these blocks, as many at a time as a batch holds; at least once, if with
  /// nothing.
  template <class Use>
  void for_batches(const std::vector<Box3f>& boxes, Use use) {
    std::vector<std::shared_ptr<const source::SplatSet>> held;
    std::vector<const source::SplatSet*> sets;
    std::uint64_t bytes = 0;
    const auto flush = [&] {
      use(projection::SplatSets(sets));
      held.clear();
      sets.clear();
      bytes = 0;
    };
    for_blocks(boxes, [&](const tiles::SplatEntry& entry) {
      const std::uint64_t cost = batch_cost(entry.splats);
      if (!sets.empty() && bytes + cost > target_.batch_bytes) flush();
      bytes += cost;
      held.push_back(cache_.set(entry));
      sets.push_back(held.back().get());
    });
    flush();
  }

  void blend_piece(Work& work) {
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

  void blend_block(Work& work, std::size_t b, std::size_t first, std::size_t last) {
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
    if (covered > 0) finish_block(job_, request_.format, result, 0, b, work);
  }

  JobContext& job_;
  const SplatProjection request_;
  SplatCache cache_;
  CutTarget target_;
};

}  // namespace

std::unique_ptr<PageProjector> project_splats(JobContext& job, const SplatProjection& request) {
  return std::make_unique<SplatProjector>(job, request);
}

std::uint64_t project_splats_least_bytes(std::uint64_t result_texel_bytes) {
  const std::uint64_t splats = tiles::kMostSplatsPerBlock;
  return kPieceScratch + projection::splat_scratch_bytes(0) +
         reading_bytes(splats, splats * sizeof(tiles::Splat) + kPageBytes) + batch_cost(splats) +
         block_state_bytes(kTexelsPerBlock, tiles::kMostTrianglesPerBlock, result_texel_bytes);
}

}  // namespace pounce::flow
