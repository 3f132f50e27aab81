// SPDX-License-Identifier: Apache-2.0
//
// A mesh in front of a target: exact hits on its facets.
//
//   fetch: the join. Source tiles are never leased whole: of each, only the blocks whose boxes meet
//          the piece's swept boxes are read
//   bin:   the patches of the batch, in a list or a grid
//   hit:   the hit kernels; with a height's last batch, what nothing farther can improve is closed
//   blend: what was hit becomes texels (hit_shading.h)
//
// A piece that meets more source than its batch holds goes through it batch by batch: the best hit
// of a texel is a minimum, so batches may be cut anywhere. What the leases leave keeps decoded
// source blocks for the pieces near it.
//
// Correctness does not depend on heights, batches, threads or on which piece was first: the winner
// is the least (key, triangle number) of all that a texel may hit
// (docs/decisions/007-search-heights-final-key.md). What is tuned here saves work only.
#include "flow/project/mesh.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <optional>

#include "flow/project/known_hits.h"
#include "flow/project/page_projector.h"
#include "flow/stores/build_stores.h"

namespace pounce::flow {
namespace {

using store::kTexelsPerBlock;

constexpr std::uint64_t kPieceScratch =
    256 << 10;  // index pages, lists of candidates and triangles, encode buffers

/// What one source block costs a batch: itself decoded, what it is decoded from, and its share of
/// the list or grid.
std::uint64_t batch_cost(std::uint64_t triangles, std::uint64_t patches, bool with_shape) {
  return surface::SourceBlock::decoded_bytes(triangles, patches, with_shape) + patches * 128;
}

/// What the texels of one target block hold in a piece, at most: packets with hits and rays, what
/// the block is read from (triangles with their axes, or records), and the results of all channels.
/// A term that is missing is no error at run time. It shows as a process that exceeds its budget.
std::uint64_t block_state_bytes(std::uint32_t texels, std::uint32_t triangles,
                                std::uint64_t result_texel_bytes, bool with_points) {
  const std::uint64_t packets = surface::TargetBlock::most_packets(texels);
  const std::uint64_t shape = with_points ? projection::SurfacePoints::most_bytes(packets) +
                                                surface::TexelFrames::bytes(triangles)
                                          : 0;
  return shape +
         packets * (sizeof(surface::TexelPacket) + sizeof(projection::HitPacket) +
                    sizeof(RayBundle) + 16) +
         2 * kTexelsPerBlock + triangles * (268 + sizeof(surface::TexelAxes)) +
         surface::TargetBlock::record_bytes(triangles == 0 ? texels : 0) +
         kTexelsPerBlock * result_texel_bytes + shading::kMaskBytes + 4 * kPageBytes;
}

/// How far from a texel a hit can be: looking farther finds nothing, and heights are shares of how
/// far a search looks. A hit lies outside of its triangle by no more than the triangle's size.
float farthest(const Box3f& source, const Box3f& target) {
  if (source.empty() || target.empty()) return 0;
  Box3f both = source;
  both.extend(target);
  const double apart = length(Vec3d(both.hi) - Vec3d(both.lo));
  const double size = length(Vec3d(source.hi) - Vec3d(source.lo));
  return static_cast<float>((apart + size) * 1.001);
}

class SurfaceMethod {
 public:
  /// Blocks are met once, whatever the batch: a larger one saves nothing. One block stays in the
  /// core's cache from node to node, and the pool of pages has its memory ready for the next.
  static constexpr PieceSize kPieceSize{32ULL << 20, 1};

  struct Work : HitWork {
    std::size_t height = 0;                       ///< index of the height at hand
    std::optional<BlockWalk<SurfaceCache>> walk;  ///< over the blocks of this height
    std::vector<std::shared_ptr<const surface::SourceBlock>> batch;
    std::optional<grid::BatchPatches> patches;  ///< of the batch
  };

  SurfaceMethod(job::JobContext& job, const MeshProjection& request, HitKeeper* keeper)
      : job_(&job),
        source_(request.source),
        index_(std::make_shared<TargetIndex>(request.target)),
        limits_(request.limits),
        kernels_(request.kernels),
        smallest_edge_(request.smallest_edge),
        shading_(job, *request.target, request.channels, request.lookup),
        keeper_(keeper),
        heights_(projection::search_heights(
            std::min(limits_.max_distance,
                     farthest(source_->store().directory().box, request.target->directory().box)))),
        result_texel_bytes_(shading_.result_texel_bytes()),
        with_shape_(std::any_of(request.channels.begin(), request.channels.end(), needs_surface)),
        with_points_(std::any_of(request.channels.begin(), request.channels.end(), needs_points)) {}

  std::size_t channels() const { return shading_.channels().size(); }

  std::uint64_t fixed_bytes() const {
    return kPieceScratch + shading_.lookup_bytes() +
           (keeper_ != nullptr ? HitKeeper::scratch_bytes() : 0);
  }

  std::uint64_t least_batch_bytes() const {
    // The largest block and its chunk, by the word of the store's directory: check_largest() finds
    // out whether it is true where a budget turns out too small.
    const store::GeometryDirectory& d = source_->store().directory();
    return batch_cost(d.most_triangles, d.most_patches, with_shape_) +
           grid::BatchPatches::most_bytes(0) + 3 * std::uint64_t{d.largest_chunk_bytes};
  }

  BlockCost state_cost(const store::BlockEntry& entry) const {
    return block_state_bytes(entry.texels, entry.triangles, result_texel_bytes_, with_points_) +
           (keeper_ != nullptr ? HitKeeper::block_bytes(entry) : 0);
  }

  void begin(Work& work) const {
    read_packets(*job_, *index_, smallest_edge_, surface::TargetBlock::Start::inset, work,
                 work.state.packets, work.state.groups, &work.axes);
    projection::start(work.state);
    if (with_points_) work.points.start(work.state.packets.size());
    // Neighbouring pieces lie about as far from the source: start where the last one found it.
    work.height = neighbours_->height.load(std::memory_order_relaxed);
  }

  /// Height after height: every source block that the open texels may meet goes past them.
  /// A height ends when its walk does. Closing a group earlier would be wrong: one of the blocks to
  /// come may have a better hit within the height.
  std::uint64_t fetch(Work& work) const {
    work.patches.reset();
    work.batch.clear();
    while (!work.state.open.empty() && work.height < heights_.size()) {
      if (!work.walk) {
        work.walk.emplace(*source_, projection::open_boxes(work.state, work.blocks.size(),
                                                           heights_[work.height]));
      }
      if (!work.walk->done()) return take(work);
      end_height(work);
    }
    neighbours_->height.store(projection::middle_height(work.state, heights_),
                              std::memory_order_relaxed);
    return 0;
  }

  static void bin(Work& work) {
    std::vector<const surface::SourceBlock*> blocks;
    for (const auto& block : work.batch) blocks.push_back(block.get());
    work.patches.emplace(blocks, work.walk->region());
  }

  void hit(Work& work) const {
    projection::search_batch(*work.patches, heights_[work.height], limits_, *kernels_, work.state);
    // New winners are evaluated while their facets are in memory: the batch is dropped after this.
    if (with_points_) work.points.follow(work.state, work.batch);
    if (work.walk->done()) end_height(work);
  }

  void blend(Work& work) const {
    if (keeper_ != nullptr && keeper_->is_wanted()) {
      keeper_->encode(work, limits_.max_distance);  // which looks at every hit anyway
    } else {
      work.distance_steps =
          projection::count_distances(limits_.max_distance, work.state, work.distances);
    }
    shading_.shade(work);
  }

  /// By one work at a time.
  void keep(const Work& work) const {
    if (keeper_ != nullptr) keeper_->store(work);
  }

 private:
  std::uint64_t take(Work& work) const {
    work.batch = work.walk->take(work.batch_bytes, [&](const store::BlockEntry& entry) {
      return batch_cost(entry.triangles, entry.patches, with_shape_);
    });
    std::uint64_t bytes = 0;
    for (const auto& block : work.batch) {
      bytes += surface::SourceBlock::decoded_bytes(block->facets.size(), block->patches.size(),
                                                   with_shape_);
    }
    return bytes;
  }

  void end_height(Work& work) const {
    projection::close_groups(heights_[work.height], *kernels_, work.state);
    work.walk.reset();
    ++work.height;
  }

  /// Within which height the piece before found the source. Only saves work.
  struct Neighbours {
    std::atomic<std::size_t> height{0};
  };

  job::JobContext* job_;
  const SurfaceCache* source_;
  std::shared_ptr<TargetIndex> index_;
  projection::SearchLimits limits_;
  const projection::Kernels* kernels_;
  float smallest_edge_;
  HitShading shading_;
  HitKeeper* keeper_;  ///< null: nobody wants the hits later
  std::vector<float> heights_;
  std::shared_ptr<Neighbours> neighbours_ = std::make_shared<Neighbours>();
  std::uint64_t result_texel_bytes_ = 0;
  bool with_shape_ = false;   ///< is some channel of the surface itself?
  bool with_points_ = false;  ///< that, or one asks where its hits are
};

/// Searches. Says damaged, not too little memory, where the source lies about its largest blocks.
class Search final : public Projection {
 public:
  Search(job::JobContext& job, const MeshProjection& request, std::unique_ptr<HitKeeper> keeper)
      : job_(job),
        source_(request.source->store()),
        keeper_(std::move(keeper)),
        projector_(job, *request.target, SurfaceMethod(job, request, keeper_.get())) {}

  PageResult project(ResultCollector& results) override {
    try {
      // Hits of the blocks that are there already are not known: these could only be some of all.
      if (keeper_ != nullptr && !results.makes_all()) keeper_->give_up();
      PageResult result = projector_.project(results);
      if (keeper_ != nullptr) keeper_->publish();
      return result;
    } catch (const Error& e) {
      if (e.kind() == ErrorKind::budget) check_largest(job_, source_);
      throw;
    }
  }

 private:
  job::JobContext& job_;
  const store::GeometryStore& source_;
  std::unique_ptr<HitKeeper> keeper_;
  PageProjector<SurfaceMethod> projector_;
};

}  // namespace

std::unique_ptr<Projection> project_mesh(job::JobContext& job, const MeshProjection& request) {
  std::unique_ptr<HitKeeper> keeper;
  if (may_keep_hits(job, request)) {
    auto known = find_hits(job, request);
    // A map says more of a hit than is kept: on which side it lies, and at what angle.
    const bool has_map = std::any_of(request.channels.begin(), request.channels.end(),
                                     [](const ChannelOutput& channel) { return channel.is_map; });
    if (known != nullptr && !has_map) {
      job.count_store(known->pack(), true);
      return shade_known(job, request, std::move(known));
    }
    if (known == nullptr && job.keeps_pages) keeper = std::make_unique<HitKeeper>(job, request);
  }
  return std::make_unique<Search>(job, request, std::move(keeper));
}

std::uint64_t project_least_bytes(std::uint32_t most_triangles, std::uint32_t largest_chunk_bytes,
                                  std::uint64_t result_texel_bytes, std::uint64_t lookup_bytes,
                                  bool with_shape) {
  // What fixed_bytes(), least_batch_bytes() and state_cost() give for the worst block, from bounds
  // that planning has before any store exists. A change there belongs here, too. Left out are the
  // grid of an empty batch (a page), and hits: these are kept only where the budget is much larger
  // (may_keep_hits()).
  return kPieceScratch + lookup_bytes + batch_cost(most_triangles, most_triangles, with_shape) +
         3 * std::uint64_t{largest_chunk_bytes} +
         block_state_bytes(kTexelsPerBlock, store::kMostTrianglesPerBlock, result_texel_bytes,
                           with_shape);
}

}  // namespace pounce::flow
