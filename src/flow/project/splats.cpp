// SPDX-License-Identifier: Apache-2.0
//
// A splat scene in front of a target: what a viewer sees of it along the normals.
//
//   fetch: the join. Large Gaussians have blocks of their own (size classes): they are in many
//          pieces' batches, but make no other block's box larger
//   bin:   nothing: blocks bring their trees of spheres
//   hit:   profile, surface, sum
//   blend: sums become colours
//
// Two passes over all Gaussians that a piece's texels may meet: one finds where the surface is, the
// other averages there (projection/splat_blend.cpp). Where the blocks that hold them fit the
// piece's batch they are shared with other pieces, and looked at once, packet by packet. Else
// blocks are sifted: what the texels may meet is kept, of one block after the other. Where all of
// that fits the batch it is looked at once, too; else it goes past batch by batch, twice. Sums are
// integers, so batches may be cut anywhere.
#include "flow/project/splats.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>
#include <string_view>
#include <tuple>
#include <utility>

#include "flow/project/around.h"
#include "flow/project/splat_method.h"
#include "pounce/error.h"
#include "projection/search.h"

namespace pounce::flow {
namespace {

/// Of all that decides what texels become, where all look along their normals.
Hash128 key_of(const SplatProjection& request) {
  Hasher hash;
  hash.add(std::string_view("along normals"));
  begin_key(request.source->store().pack().key(), *request.target, hash);
  hash.add(request.source->reader().harmonics);
  hash.add(request.linear);
  hash.add(request.alpha);
  hash.add(request.fit);
  hash.add(request.smallest_edge);
  const auto& [reach, min_cosine, window, discness, antialiased, rays, least_opacity,
               least_confidence, expected, deviation, fine_edge] = request.limits;
  for (const float limit : {reach, min_cosine, window, discness, expected, deviation, fine_edge})
    hash.add(limit);
  hash.add(antialiased);
  hash.add(rays);
  hash.add(least_opacity);
  hash.add(least_confidence);
  for (const SplatOutput& output : request.outputs) {
    const auto& [channel, format, input] = output;
    hash.add(channel);
    add_format(format, hash);
    hash.add(input.has_value());
    if (input) add_input(*input, hash);
  }
  return hash.digest();
}

using Base = SplatMethodBase<SplatProjection, projection::SplatState>;

class SplatMethod : public Base {
 public:
  /// What the Gaussians go past the texels for.
  /// first_batch ends with the first fetch, which shows whether that was all: then `whole` finds
  /// surface and sums in one go. Otherwise `profile` runs over all batches, and `sum` over all of
  /// them again.
  enum class Pass : std::uint8_t { first_batch, whole, profile, sum, done };
  struct Work : Base::Work {
    Pass pass = Pass::first_batch;
    std::uint64_t met_bytes = 0;  ///< what all that its texels may meet costs a batch, if known
    bool sifts = false;           ///< blocks
    std::uint64_t leased = 0;     ///< what the piece got
    AroundWork around;            ///< of a scene that is seen from all around
  };

  /// Blocks of small charts have few texels, from all over the target, and ask most of the views'
  /// tiles. Where these have to be decoded for each piece, the fewer pieces the better.
  SplatMethod(job::JobContext& job, const SplatProjection& request) : Base(job, request) {
    request_.in_turn =
        request_.views != nullptr && !request_.views->stays_decoded && has_small_charts();
    if (request_.views == nullptr) return;
    sight_limits_ = request_.views->limits;
    sight_limits_.tells_confidence = request_.limits.least_confidence > views::kLeastConfidence ||
                                     std::any_of(request_.outputs.begin(), request_.outputs.end(),
                                                 [](const SplatOutput& output) {
                                                   return output.channel == Channel::confidence;
                                                 });
  }

  PieceSize piece_size() const {
    PieceSize size = kPieceSize;
    size.is_wide = request_.in_turn;
    if (size.is_wide) size.most_blocks = 1024;
    return size;
  }

  /// All that the texels may meet at once needs no profiles: there is room for more of it.
  std::uint64_t wanted_bytes(Work& work, std::uint64_t most) const {
    const std::uint64_t begun = begun_bytes(work), least = least_batch_bytes();
    if (begun > most)
      throw Error(ErrorKind::internal, "texels need more than their piece's lease (please report)");
    const std::uint64_t room = most - begun;
    work.met_bytes = std::max(cost(boxes(work), room), least);
    std::uint64_t wanted = work.met_bytes;
    // Blocks whose turn comes later may meet more, and have profiles.
    if (turns_follow(work)) wanted = std::max(wanted, least + most_profile_bytes(work));
    return begun + std::min(room, wanted);
  }
  void settle(Work& work, std::uint64_t bytes) const {
    // What the piece got may be less than it wanted. Profiles are needed in two passes only, so
    // they are part of the batch's bytes until it is known that there are two.
    work.leased = bytes;
    work.batch_bytes = bytes - begun_bytes(work);
    work.sifts = work.met_bytes > work.batch_bytes;
    if (work.sifts) work.batch_bytes -= profile_bytes(work);
    work.pass = work.sifts ? Pass::first_batch : Pass::whole;
    work.walk.emplace(*request_.source, boxes(work));
  }

  /// A pass without any Gaussians goes by here: its batch would be empty.
  std::uint64_t fetch(Work& work) const {
    drop_batch(work);
    for (;;) {
      while (work.pass != Pass::done) {
        if (!work.walk->done()) {
          // A batch that is sifted may come out empty although its walk has ended: nothing of these
          // blocks is near. Passing it on would make the graph think that there is no more of the
          // source.
          const std::uint64_t bytes = work.sifts ? sift(work) : take(work);
          if (work.pass == Pass::first_batch)
            work.pass = work.walk->done() ? Pass::whole : Pass::profile;
          if (!work.sets.empty()) return bytes;
        }
        use(work);
        end_pass(work);
      }
      if (!turns_follow(work)) return 0;
      blend(work);
      take_turn(work.around, request_.in_turn, work.state);
      projection::start(request_.limits, work.state);
      wanted_bytes(work, work.leased);
      settle(work, work.leased);
    }
  }

  void hit(Work& work) const {
    use(work);
    if (work.walk->done()) end_pass(work);
  }

  void begin(Work& work) const {
    if (request_.views == nullptr) return Base::begin(work);
    read_packets(*job_, *index_, request_.smallest_edge, surface::TargetBlock::Start::at_texel,
                 work, work.around.packets, work.around.groups);
    has_read(work.around.packets, work);
    // All of a wide piece asks a tile that is decoded for it. Else it is so many packets whose sums
    // stay in the processor's cache while all views go past.
    const std::size_t at_once = request_.in_turn ? work.around.packets.size() : most_packets();
    look_around(*job_, *request_.views, sight_limits_, at_once, work.index % 2 == 1, work.around);
    take_turn(work.around, request_.in_turn, work.state);
    projection::start(request_.limits, work.state);
  }

  /// Those whose turn it is.
  void blend(Work& work) const {
    // Of the last packet that was asked for: all channels of a small block ask for it.
    std::size_t of_packet = std::max(work.around.packets.size(), work.state.packets.size());
    projection::SplatFindings found;
    Values values{};
    const auto blend = [&](std::span<const surface::TexelPacket> packets, std::size_t first,
                           const auto& find) {
      blend_blocks(work, packets, first, [&](std::size_t c, std::size_t p) {
        if (p != of_packet) {
          found = find(p);
          of_packet = p;
          const std::uint16_t(&texel)[surface::kLanes] = packets[p].texel;
          for (std::size_t lane = 0; lane < surface::kLanes; ++lane) {
            if (texel[lane] == surface::kNoTexel) found.drop(lane);
          }
        }
        if (c == 0) count(found, work);
        return PacketValues{found.found, values_of(request_.outputs[c], found, values)};
      });
    };
    const auto along_normals = [&](std::size_t p) {
      return projection::findings(request_.limits, work.state, p);
    };
    if (request_.views == nullptr) return blend(work.state.packets, 0, along_normals);
    const auto turn = std::span(work.around.packets).first(work.around.end);
    blend(turn, work.around.first, [&](std::size_t p) {
      const auto& texels = work.around.packets[p].texel;
      const SceneViews& views = *request_.views;
      projection::SplatFindings seen =
          views::sights_of(views.grid, sight_limits_, work.around.sights[p]);
      std::optional<projection::SplatFindings> ray;
      for (std::size_t lane = 0; lane < surface::kLanes; ++lane) {
        if (texels[lane] == surface::kNoTexel) continue;
        if (seen.has(lane)) {
          if (seen.confidence[lane] < request_.limits.least_confidence) seen.drop(lane);
          continue;
        }
        if (!ray) ray = along_normals(work.around.ray[p]);
        seen.take(lane, *ray);
      }
      return seen;
    });
  }

  /// A work of places instead of texels; the rays of each need blocks of their own.
  void begin(Work& work, std::span<const surface::Place> places, float edge) const {
    surface::make_packets(places, edge, work.state.packets, work.state.groups);
    work.blocks.resize(places.size());
    projection::start(request_.limits, work.state);
  }

 private:
  /// Numbers that values_of() computes.
  struct Values {
    double v[4][surface::kLanes];
  };

  void count(const projection::SplatFindings& found, Work& work) const {
    for (std::uint32_t lanes = found.found; lanes != 0; lanes &= lanes - 1) {
      const double distance = found.distance[std::countr_zero(lanes)];
      projection::count_distance(static_cast<float>(std::abs(distance)), request_.limits.reach,
                                 work.distances);
    }
  }

  /// Of one channel. Points to what was found, or to `values`.
  shading::TexelValues values_of(const SplatOutput& output, const projection::SplatFindings& found,
                                 Values& values) const {
    if (output.channel == Channel::distance) return {{found.distance}, 1};
    if (output.channel == Channel::confidence) {
      for (std::size_t lane = 0; lane < surface::kLanes; ++lane)
        values.v[0][lane] = found.confidence[lane] * request_.fit;
      return {{values.v[0]}, 1};
    }
    shading::TexelValues colours{{found.colour[0], found.colour[1], found.colour[2], found.opacity},
                                 request_.alpha ? 4U : 3U,
                                 request_.linear,
                                 request_.alpha};
    if (output.input) {
      shading::TexelValue colour;
      for (std::uint32_t lanes = found.found; lanes != 0; lanes &= lanes - 1) {
        const auto lane = static_cast<std::size_t>(std::countr_zero(lanes));
        colour = {{}, colours.channels, colours.linear, colours.has_alpha};
        for (std::size_t c = 0; c < 4; ++c) colour.v[c] = colours.v[c][lane];
        shading::apply(*output.input, colour);
        for (std::size_t c = 0; c < 4; ++c) values.v[c][lane] = colour.v[c];
      }
      if (found.found != 0)
        colours = {{values.v[0], values.v[1], values.v[2], values.v[3]},
                   colour.channels,
                   colour.linear,
                   colour.has_alpha,
                   colour.is_final};
    }
    return colours;
  }

  std::vector<Box3f> boxes(const Work& work) const {
    return projection::reachable_boxes(request_.limits, work.state, work.blocks.size());
  }

  bool has_small_charts() const {
    std::uint64_t blocks = 0;
    for (const store::TileEntry& tile : request_.target->directory().tiles) blocks += tile.blocks;
    return request_.target->directory().texels < blocks * store::kTexelsPerBlock / 4;
  }
  bool turns_follow(const Work& work) const {
    return request_.views != nullptr && !work.around.is_last_turn();
  }
  std::uint64_t most_profile_bytes(const Work& work) const {
    return request_.profile_bytes(work.state.packets.capacity());
  }
  std::uint64_t profile_bytes(const Work& work) const {
    return request_.profile_bytes(work.state.packets.size());
  }

  void use(Work& work) const {
    const projection::SplatSets sets(work.sets);
    const auto& [limits, kernels] = std::tie(request_.limits, *request_.kernels);
    const projection::GoOn go_on = [this] { job_->meter.throw_if_cancelled(); };
    switch (work.pass) {
      case Pass::whole:
        return projection::blend_whole(sets, limits, kernels, work.state, go_on);
      case Pass::profile:
        return projection::profile_batch(sets, limits, kernels, work.state, go_on);
      case Pass::sum:
        return projection::sum_batch(sets, limits, kernels, work.state, go_on);
      case Pass::first_batch:
      case Pass::done:
        break;
    }
  }

  void end_pass(Work& work) const {
    drop_batch(work);
    if (work.pass != Pass::profile) {
      work.pass = Pass::done;
      return;
    }
    // All profiles are complete only now. Sums that began earlier would weigh Gaussians by an
    // occlusion that is not known yet.
    projection::find_surfaces(request_.limits, *request_.kernels, work.state);
    work.pass = Pass::sum;
    work.walk.emplace(*request_.source, boxes(work));
  }

  views::SightLimits sight_limits_;  ///< of a scene that is seen from all around
};

}  // namespace

std::unique_ptr<Projection> project_splats(job::JobContext& job, const SplatProjection& request) {
  const auto project = [&job, request](ResultKeeper* keeper) {
    SplatProjection kept = request;
    kept.keeper = keeper;
    return std::make_unique<PageProjector<SplatMethod>>(job, *request.target,
                                                        SplatMethod(job, kept));
  };
  // What views show depends on all of a target's mesh, not on the page's store alone. They are kept
  // themselves (docs/decisions/078-results.md).
  if (request.views != nullptr) return project(nullptr);
  KnownPage page{key_of(request), request.target, {}};
  for (const SplatOutput& output : request.outputs) page.formats.push_back(output.format);
  return known_or_made(job, std::move(page), project);
}

projection::SplatFit find_fit(job::JobContext& job, const SplatProjection& request,
                              std::span<const surface::Place> places, float edge,
                              float usual_reach) {
  // As many packets as a full block has at most, so that projecting one takes as much memory.
  static_assert(surface::kStrewnPlaces == SplatMethod::most_packets());
  // No graph: one work, led by hand through the members that the graph's nodes call.
  const SplatMethod method(job, request);
  SplatMethod::Work work;
  const std::uint64_t bytes =
      method.fixed_bytes() + method.least_batch_bytes() + request.packet_bytes(places.size()) +
      request.profile_bytes(places.size()) + places.size() * sizeof(store::BlockEntry);
  constexpr auto kMeasuring = "measuring how well the scene fits the target";
  const runtime::Lease lease(job.budget, bytes, kMeasuring);
  method.begin(work, places, edge);
  // All blocks at once, if there is room: they stay decoded for texels, and are gone through once.
  // Nothing else is under way that would lease it.
  const std::uint64_t room = job.budget.limit() - std::min(job.budget.limit(), job.budget.leased());
  const std::uint64_t most = bytes + std::min(room / 4, SplatMethod::kPieceSize.largest_share);
  const std::uint64_t wanted = std::max(bytes, method.wanted_bytes(work, most));
  const runtime::Lease rest(job.budget, wanted - bytes, kMeasuring);
  method.settle(work, wanted);
  while (method.fetch(work) > 0) method.hit(work);
  return projection::fit_of(projection::found_places(request.limits, work.state), places.size(),
                            {double{request.limits.reach}, double{usual_reach}});
}

std::uint64_t project_splats_least_bytes(std::uint64_t result_texel_bytes, std::size_t channels,
                                         std::uint32_t lobes, std::uint32_t rays,
                                         bool from_around) {
  return SplatMethod::least_bytes(
      result_texel_bytes, channels, lobes,
      projection::SplatState::most_bytes(SplatMethod::most_packets(), rays) +
          projection::SplatState::profile_bytes(SplatMethod::most_packets(), rays) +
          (from_around ? SplatProjection::around_bytes(SplatMethod::most_packets()) +
                             SplatProjection::kLookupBytes
                       : 0));
}

}  // namespace pounce::flow
