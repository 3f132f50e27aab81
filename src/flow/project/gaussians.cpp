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
// The blend is a sum over all that a ray meets (projection/splat_blend.cpp), so one pass is enough.
//
// Most texels meet Gaussians within the first reach and are done. Only the others look twice as
// far, again and again up to the maximum distance. So the reach of a texel depends on what it meets
// alone, and a large --max-distance costs time only where nothing is near (docs/paper.md).
#include "flow/project/gaussians.h"

#include <algorithm>
#include <optional>
#include <string_view>

#include "flow/project/splat_method.h"

namespace pounce::flow {
namespace {

/// Of all that decides what texels become.
Hash128 key_of(const GaussianProjection& request) {
  Hasher hash;
  hash.add(std::string_view("texels on rays"));
  begin_key(request.source->store().pack().key(), *request.target, hash);
  add_format(request.format, hash);
  hash.add(request.linear);
  hash.add(request.has_alpha);
  const auto& [max_distance, first_reach, min_cosine] = request.limits;
  for (const float limit : {max_distance, first_reach, min_cosine, request.smallest_edge})
    hash.add(limit);
  return hash.digest();
}

class GaussianMethod : public SplatMethodBase<GaussianProjection, projection::RayState> {
 public:
  GaussianMethod(job::JobContext& job, const GaussianProjection& request)
      : SplatMethodBase(job, request) {}

  /// The first reach is the last for most texels; farther ones go in batches of its size.
  std::uint64_t wanted_bytes(Work& work, std::uint64_t most) const {
    const std::uint64_t begun = begun_bytes(work), room = most - begun;
    const auto boxes = projection::open_boxes(work.state, work.blocks.size());
    return begun + std::min(room, std::max(cost(boxes, room), least_batch_bytes()));
  }
  void settle(Work& work, std::uint64_t bytes) const {
    work.batch_bytes = bytes - begun_bytes(work);
  }

  /// A reach without any Gaussians goes by here.
  std::uint64_t fetch(Work& work) const {
    // A walk lives as long as its reach. Groups are closed and widened only when all blocks of the
    // reach have passed: until then a texel that has met nothing may still do.
    drop_batch(work);
    while (!work.state.open.empty()) {
      if (!work.walk)
        work.walk.emplace(*request_.source, projection::open_boxes(work.state, work.blocks.size()));
      if (!work.walk->done()) return take(work);
      end_reach(work);
    }
    return 0;
  }

  void hit(Work& work) const {
    projection::add_batch(work.sets, request_.limits, *request_.kernels, work.state,
                          [this] { job_->meter.throw_if_cancelled(); });
    drop_batch(work);
    if (work.walk->done()) end_reach(work);
  }

  void blend(Work& work) const {
    projection::count_distances(work.state, request_.limits.max_distance, work.distances);
    double colours[4][surface::kLanes] = {};
    const auto values_of = [&](std::size_t, std::size_t p) {
      PacketValues out{0,
                       {{colours[0], colours[1], colours[2], colours[3]},
                        request_.has_alpha ? 4U : 3U,
                        request_.linear,
                        request_.has_alpha}};
      for (int lane = 0; lane < surface::kLanes; ++lane) {
        if (work.state.packets[p].texel[lane] == surface::kNoTexel) continue;
        // No Gaussian on the ray is no colour: the texel is not covered, which is not the same as
        // transparent.
        const auto colour = projection::ray_colour(work.state.sums[p], lane);
        if (!colour) continue;
        for (std::size_t c = 0; c < 4; ++c) colours[c][lane] = (*colour)[c];
        out.found |= std::uint32_t{1} << lane;
      }
      return out;
    };
    blend_blocks(work, work.state.packets, 0, values_of);
  }

 private:
  void end_reach(Work& work) const {
    projection::widen(request_.limits, work.state);
    work.walk.reset();
  }
};

}  // namespace

float first_reach(double diagonal, ImageSize size) {
  // The root is by hand: the C library's own differs from machine to machine in the last bit.
  const double texels = static_cast<double>(size.width) * size.height;
  std::uint64_t cells = 1;
  while (static_cast<double>(cells * cells * cells) < texels) ++cells;
  return static_cast<float>(std::max(diagonal / static_cast<double>(cells) / 2, 1e-30));
}

std::unique_ptr<Projection> project_gaussians(job::JobContext& job,
                                              const GaussianProjection& request) {
  const KnownPage page{key_of(request), request.target, {request.format}};
  return known_or_made(job, page, [&job, request](ResultKeeper* keeper) {
    GaussianProjection kept = request;
    kept.keeper = keeper;
    return std::make_unique<PageProjector<GaussianMethod>>(job, *request.target,
                                                           GaussianMethod(job, kept));
  });
}

std::uint64_t project_gaussians_least_bytes(std::uint64_t result_texel_bytes) {
  return GaussianMethod::least_bytes(
      result_texel_bytes, 1, 0, GaussianProjection::packet_bytes(GaussianMethod::most_packets()));
}

}  // namespace pounce::flow
