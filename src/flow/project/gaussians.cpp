// SPDX-License-Identifier: Apache-2.0
//
// A mesh's texels, as Gaussians, in front of a target: the paper's method.
//
//   fetch: the join; a reach's blocks go past as many at a time as a batch holds
//   bin:   nothing: blocks bring their trees of spheres
//   hit:   add what the rays meet; once a reach's blocks have all passed, look farther where there
//          was nothing
//   blend: sums become colours
//
// The blend is a sum over all that a ray meets (projection/ray_blend.cpp), so one pass is enough.
#include "flow/project/gaussians.h"

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
  return projection::RayState::most_bytes(target::TargetBlock::most_packets(texels)) +
         2 * kTexelsPerBlock + std::uint64_t{triangles} * 220 +
         kTexelsPerBlock * result_texel_bytes + texture::kMaskBytes + 4 * kPageBytes;
}

class GaussianMethod {
 public:
  struct Work : PieceWork {
    projection::RayState state;
    std::optional<BlockWalk<SplatCache>> walk;  ///< over the blocks of this reach
    std::vector<std::shared_ptr<const source::SplatSet>> batch;
  };

  GaussianMethod(JobContext& job, const GaussianProjection& request)
      : job_(&job), request_(request) {}

  static std::size_t channels() { return 1; }
  std::uint64_t fixed_bytes() const {
    const store::SplatDirectory& d = request_.source->store().directory();
    return kPieceScratch + projection::ray_scratch_bytes(0) +
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

  /// A reach without any Gaussians goes by here.
  std::uint64_t fetch(Work& work) const {
    work.batch.clear();
    while (!work.state.open.empty()) {
      if (!work.walk)
        work.walk.emplace(*request_.source, projection::open_boxes(work.state, work.blocks.size()));
      if (!work.walk->done()) return take(work);
      end_reach(work);
    }
    return 0;
  }

  static void bin(Work&) {}

  void hit(Work& work) const {
    std::vector<const source::SplatSet*> sets;
    for (const auto& set : work.batch) sets.push_back(set.get());
    projection::add_batch(sets, request_.limits, *request_.kernels, work.state);
    work.batch.clear();
    if (work.walk->done()) end_reach(work);
  }

  void blend(Work& work) const {
    work.stored.assign(1, std::vector<std::vector<std::byte>>(work.blocks.size()));
    work.raw_bytes.assign(1, 0);
    work.covered.assign(1, 0);
    work.clipped.assign(1, 0);
    projection::count_distances(work.state, request_.limits.max_distance, work.distances);
    std::size_t p = 0;  // packets are in the order of their blocks
    for (std::size_t b = 0; b < work.blocks.size(); ++b) {
      const std::size_t first = p;
      while (p < work.state.packets.size() && work.state.packets[p].block == b) ++p;
      blend_block(work, b, first, p);
    }
  }

 private:
  static std::uint64_t take(Work& work) {
    work.batch = work.walk->take(work.batch_bytes, [](const store::SplatEntry& entry) {
      return splat_batch_cost(entry.splats);
    });
    std::uint64_t bytes = 0;
    for (const auto& set : work.batch) bytes += source::SplatSet::most_bytes(set->shapes.size());
    return bytes;
  }

  void end_reach(Work& work) const {
    projection::widen(request_.limits, work.state);
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
        const auto colour = projection::ray_colour(work.state.sums[p], lane);
        if (!colour) continue;
        const texture::TexelValue value{*colour, request_.has_alpha ? 4U : 3U, request_.linear,
                                        request_.has_alpha};
        work.clipped[0] += texture::store_texel(request_.format, value,
                                                result.texels.data() + texel * texel_bytes);
        result.cover(texel);
        ++covered;
      }
    }
    work.covered[0] += covered;
    if (covered > 0) finish_block(*job_, request_.format, result, 0, b, work);
  }

  JobContext* job_;
  GaussianProjection request_;
};

}  // namespace

float first_reach(double diagonal, ImageSize size) {
  // The root is by hand: the C library's own differs from machine to machine in the last bit.
  const double texels = static_cast<double>(size.width) * size.height;
  std::uint64_t cells = 1;
  while (static_cast<double>(cells * cells * cells) < texels) ++cells;
  return static_cast<float>(std::max(diagonal / static_cast<double>(cells) / 2, 1e-30));
}

std::unique_ptr<Projection> project_gaussians(JobContext& job, const GaussianProjection& request) {
  return std::make_unique<PageProjector<GaussianMethod>>(job, *request.target,
                                                         GaussianMethod(job, request));
}

std::uint64_t project_gaussians_least_bytes(std::uint64_t result_texel_bytes) {
  const std::uint64_t splats = store::kMostSplatsPerBlock;
  return kPieceScratch + projection::ray_scratch_bytes(0) +
         splat_reading_bytes(splats, splats * sizeof(store::Splat) + kPageBytes) +
         splat_batch_cost(splats) +
         block_state_bytes(kTexelsPerBlock, store::kMostTrianglesPerBlock, result_texel_bytes);
}

}  // namespace pounce::flow
