// SPDX-License-Identifier: Apache-2.0
//
// Search outward: which Gaussian does each target texel see first, along its normal, both ways?
//
// The answer is defined without any search: of all facets that are within the maximum distance, are
// hit (or missed by no more than their tolerance) and whose surface faces the texel there, the one
// with the least (key, triangle), where the key is |t| + distance outside, as single precision
// knows it. Heights only save work: at height h every facet with |t| <= h is met, and one beyond
// has at least the key of h. So a texel whose key is below that is final, and the result does not
// depend on the heights, the order of the batches, how patches are found or the maximum distance
// (where something is in reach). It ends because the last height is the maximum distance.
//
// A minimum over (key, triangle) is associative, commutative and idempotent: source blocks may come
// in any order and any number of times, which is what lets the source be streamed past the texels.
#include "projection/search.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace pounce::projection {
namespace {

// The first is max_distance / 64; each next one is four times the last. Rays are culled against
// patches one by one, so reaching too far costs little, and every height costs a pass over the
// source's boxes.
constexpr int kHeights = 4;

}  // namespace

std::vector<float> search_heights(float max_distance) {
  std::vector<float> heights;
  for (int k = kHeights - 1; k >= 0; --k) heights.push_back(std::ldexp(max_distance, -2 * k));
  return heights;
}

void start(SearchState& state) {
  state.hits.resize(state.packets.size());
  for (HitPacket& hit : state.hits) clear(hit);
  state.bundles.reserve(state.packets.size());
  for (const TexelPacket& packet : state.packets) state.bundles.push_back(bundle_of(packet));
  state.open.resize(state.groups.size());
  for (std::uint32_t g = 0; g < state.open.size(); ++g) state.open[g] = g;
}

std::vector<Box3f> open_boxes(const SearchState& state, std::size_t blocks, float height) {
  std::vector<Box3f> boxes(blocks);
  for (const std::uint32_t g : state.open) {
    const surface::PacketGroup& group = state.groups[g];
    for (std::uint32_t p = group.first; p < group.first + group.count; ++p) {
      boxes[state.packets[p].block].extend(state.bundles[p].swept_box(height));
    }
  }
  return boxes;
}

void search_batch(grid::BatchPatches& patches, float height, const SearchLimits& limits,
                  const Kernels& kernels, SearchState& state) {
  grid::PatchSpheres candidates;
  std::array<std::uint16_t, grid::BatchPatches::kMostListed> places;
  for (const std::uint32_t g : state.open) {
    const surface::PacketGroup& group = state.groups[g];
    const std::span bundles(state.bundles.data() + group.first, group.count);
    const RayBundle all = unite(bundles);
    if (grid::PatchGrid* const grid = patches.grid()) {
      candidates.clear();
      grid->query(all, height, [&](const grid::GridItem& item) {
        candidates.add(item.centre, item.radius, item.facet);
      });
    } else {
      const std::size_t count = kernels.cull(patches.list(), all, height, places.data());
      candidates.take(patches.list(), std::span(places).first(count));
    }
    if (candidates.size() == 0) continue;
    for (std::uint32_t p = group.first; p < group.first + group.count; ++p) {
      kernels.search(candidates, state.bundles[p], height, state.packets[p], limits, state.hits[p]);
    }
  }
}

std::size_t middle_height(const SearchState& state, std::span<const float> heights) {
  std::size_t hits = 0;
  std::vector<std::size_t> within(heights.size());
  for (std::size_t p = 0; p < state.packets.size(); ++p) {
    const std::int32_t key = state.hits[p].key[0];  // of one texel of a packet
    if (key == kNoHit) continue;
    ++hits;
    const float distance = distance_of(key, state.packets[p]);
    for (std::size_t h = 0; h < heights.size(); ++h) within[h] += distance <= heights[h] ? 1 : 0;
  }
  std::size_t height = 0;
  while (height + 1 < heights.size() && 2 * within[height] <= hits && hits > 0) ++height;
  return height;
}

std::uint64_t count_distances(float max_distance, const SearchState& state,
                              DistanceCounts& counts) {
  std::uint64_t steps = 0;
  for (std::size_t p = 0; p < state.packets.size(); ++p) {
    const TexelPacket& packet = state.packets[p];
    const HitPacket& hit = state.hits[p];
    // Loops without a branch become vector code.
    std::int32_t used[kLanes], bins[kLanes], steps_of[kLanes];
    for (int lane = 0; lane < kLanes; ++lane) {
      const float share = distance_of(hit.key[lane], packet) / max_distance;
      used[lane] = packet.texel[lane] != surface::kNoTexel && hit.key[lane] != kNoHit ? -1 : 0;
      bins[lane] = distance_bin(share) & used[lane];
      steps_of[lane] = share_steps(share) & used[lane];
    }
    std::int32_t hits = 0, in_steps = 0, all = -1, some = 0;
    for (int lane = 0; lane < kLanes; ++lane) {
      hits -= used[lane];
      in_steps += steps_of[lane];
      all &= bins[lane] | ~used[lane];
      some |= bins[lane];
    }
    steps += static_cast<std::uint64_t>(in_steps);
    if (hits == 0) continue;
    if (all == some) {  // neighbours mostly share a bin
      counts[static_cast<std::size_t>(some)] += static_cast<std::uint64_t>(hits);
      continue;
    }
    for (int lane = 0; lane < kLanes; ++lane)
      counts[static_cast<std::size_t>(bins[lane])] += static_cast<std::uint64_t>(-used[lane]);
  }
  return steps;
}

void close_groups(float height, const Kernels& kernels, SearchState& state) {
  std::erase_if(state.open, [&](std::uint32_t g) {
    const surface::PacketGroup& group = state.groups[g];
    for (std::uint32_t p = group.first; p < group.first + group.count; ++p) {
      if (!kernels.all_final(state.packets[p], state.hits[p], height)) return false;
    }
    return true;
  });
}

// --- the surface that was hit --------------------------------------------------------------------
//
// A search keeps a winner's number, not the winner: while the batch that it came from is there, the
// facet is looked up by that number, and the texel's own ray is put to it once more, in double
// precision and from the texel's own point, as kernels do for the place in the image.
//
// The search itself could carry this along, but its kernels would have to carry all of it for each
// candidate that wins for a while, in all jobs. Evaluated here, once per winner and batch, it costs
// other jobs nothing (docs/decisions/031). A winner may be replaced by a later batch, and is then
// evaluated again.

namespace {

struct Found {
  std::int32_t id = 0;
  const surface::Facet* facet = nullptr;
  const surface::FacetAttributes* attributes = nullptr;
};

Vec3d vector(const float (&v)[3]) { return {v[0], v[1], v[2]}; }

/// Where the ray of a texel meets a facet: barycentrics 1 and 2, clamped into the triangle.
struct Place {
  double w1, w2;
};

Place meet(const surface::Facet& f, Vec3d from, Vec3d along) {
  // As the kernels do: a ray in the plane of its facet would be 0/0 (docs/decisions/015).
  double rising = dot(vector(f.n), along);
  if (std::abs(rising) < kGrazing) rising = rising < 0 ? -kGrazing : kGrazing;
  const Vec3d r = vector(f.m) - from;
  const Vec3d d = along * (dot(vector(f.n), r) / rising) - r;
  // Hits count a little outside of their triangle; position, normal and tangent are those of its
  // border.
  const double w1 = std::max(dot(vector(f.g1), d), 0.0), w2 = std::max(dot(vector(f.g2), d), 0.0);
  const double scale = 1 / std::max(w1 + w2, 1.0);
  return {w1 * scale, w2 * scale};
}

void put(Vec3d v, float& x, float& y, float& z) {
  x = static_cast<float>(v.x);
  y = static_cast<float>(v.y);
  z = static_cast<float>(v.z);
}

void evaluate(const Found& found, const TexelPacket& packet, std::size_t i, SurfacePacket& out) {
  const double step = surface::step_of(packet);
  const Vec3d from{packet.px[i] - packet.inset_x[i] * step, packet.py[i] - packet.inset_y[i] * step,
                   packet.pz[i] - packet.inset_z[i] * step};
  const Vec3d along{packet.nx[i], packet.ny[i], packet.nz[i]};
  const surface::Facet& f = *found.facet;
  const Place at = meet(f, from, along);
  const auto between = [&](const float(&v)[3], const float(&v1)[3], const float(&v2)[3]) {
    return vector(v) + (vector(v1) * at.w1 + vector(v2) * at.w2);
  };
  const Vec3d point = between(f.m, f.e1, f.e2);
  put(point, out.px[i], out.py[i], out.pz[i]);
  put(between(f.s, f.s1, f.s2), out.nx[i], out.ny[i], out.nz[i]);
  out.height[i] = static_cast<float>(dot(along, point - from));
  out.id[i] = found.id;
  if (found.attributes == nullptr) return;
  const surface::FacetAttributes& t = *found.attributes;
  put(between(t.t, t.t1, t.t2), out.tx[i], out.ty[i], out.tz[i]);
  out.handedness[i] = t.handedness;
  float* const samples[4] = {out.red, out.green, out.blue, out.alpha};
  for (std::size_t c = 0; c < 4; ++c)
    samples[c][i] = static_cast<float>(t.c[c] + (t.c1[c] * at.w1 + t.c2[c] * at.w2));
}

bool is_new(const HitPacket& hit, const SurfacePacket& known, std::size_t lane) {
  return hit.key[lane] != kNoHit && hit.id[lane] != known.id[lane];
}

bool by_id(const Found& a, const Found& b) { return a.id < b.id; }

/// The winners that are not known yet, each once.
std::vector<Found> wanted(const SearchState& state, const PageVector<SurfacePacket>& known) {
  std::vector<Found> ids;
  for (std::size_t p = 0; p < known.size(); ++p) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      if (!is_new(state.hits[p], known[p], lane)) continue;
      const std::int32_t id = state.hits[p].id[lane];
      // Neighbouring texels mostly have the same winner, which keeps the list short before it is
      // sorted.
      if (ids.empty() || ids.back().id != id) ids.push_back({id, nullptr, nullptr});
    }
  }
  std::sort(ids.begin(), ids.end(), by_id);
  const auto same = [](const Found& a, const Found& b) { return a.id == b.id; };
  ids.erase(std::unique(ids.begin(), ids.end(), same), ids.end());
  return ids;
}

}  // namespace

void SurfacePoints::start(std::size_t packets) {
  packets_.resize(packets);
  for (SurfacePacket& packet : packets_) std::fill_n(packet.id, kLanes, kNoHit);
}

void SurfacePoints::follow(const SearchState& state,
                           std::span<const std::shared_ptr<const surface::SourceBlock>> batch) {
  std::vector<Found> winners = wanted(state, packets_);
  if (winners.empty()) return;
  const auto find = [&](std::int32_t id) {
    const auto at =
        std::lower_bound(winners.begin(), winners.end(), Found{id, nullptr, nullptr}, by_id);
    return at != winners.end() && at->id == id ? &*at : nullptr;
  };
  // A cut triangle is in several blocks of the batch. Its facets have the same bits, so the last
  // one does.
  for (const auto& block : batch) {
    for (std::size_t f = 0; f < block->facets.size(); ++f) {
      Found* const winner = find(block->facets[f].id);
      if (winner == nullptr) continue;
      winner->facet = &block->facets[f];
      if (!block->attributes.empty()) winner->attributes = &block->attributes[f];
    }
  }
  for (std::size_t p = 0; p < packets_.size(); ++p) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      if (!is_new(state.hits[p], packets_[p], lane)) continue;
      const Found* const winner = find(state.hits[p].id[lane]);
      if (winner->facet != nullptr) evaluate(*winner, state.packets[p], lane, packets_[p]);
    }
  }
}

std::uint64_t SurfacePoints::most_bytes(std::uint64_t packets) {
  // A list of winners grows to twice what it holds, and half of that again while it does.
  return round_to_pages(packets * sizeof(SurfacePacket)) + 3 * packets * kLanes * sizeof(Found);
}

}  // namespace pounce::projection
