// SPDX-License-Identifier: Apache-2.0
#include "projection/search.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstring>

#include "unit/projection/random_facets.h"

using namespace pounce;
using namespace pounce::projection;
using pounce::test::Random;

namespace {

struct Scene {
  std::vector<surface::SourceBlock> blocks;
  PageVector<TexelPacket> packets;
  std::vector<surface::PacketGroup> groups;
  SearchLimits limits;
};

Scene random_scene(Random& random) {
  Scene scene;
  const float size = random.one_in(2) ? 0.4F : 0.05F;
  const std::uint64_t blocks = 1 + random.below(6);
  for (std::uint64_t i = 0; i < blocks; ++i) {
    scene.blocks.push_back(test::random_source(random, 1 + static_cast<int>(random.below(150)),
                                               size, static_cast<std::uint32_t>(1000 * i)));
  }
  const std::uint64_t groups = 1 + random.below(20);
  for (std::uint64_t g = 0; g < groups; ++g) {
    const auto first = static_cast<std::uint32_t>(scene.packets.size());
    const std::uint64_t packets = 1 + random.below(3);
    const float spread = random.one_in(3) ? 0.5F : 0.02F;
    for (std::uint64_t i = 0; i < packets; ++i) {
      scene.packets.push_back(test::random_packet(random, spread));
      scene.packets.back().block = static_cast<std::uint32_t>(g % 3);
    }
    scene.groups.push_back({first, static_cast<std::uint32_t>(packets)});
  }
  for (TexelPacket& packet : scene.packets)
    packet.coarseness = random.one_in(3) ? 0.0F : random.one_in(2) ? 4.0F : 4096.0F;
  scene.limits = {random.between(0.1F, 1.5F), random.between(0.0F, 0.7F)};
  return scene;
}

/// The definition: the best of all facets, whatever is where.
UnsetPageVector<HitPacket> brute_force(const Scene& scene) {
  UnsetPageVector<HitPacket> hits(scene.packets.size());
  for (std::size_t p = 0; p < hits.size(); ++p) {
    clear(hits[p]);
    for (const surface::SourceBlock& block : scene.blocks) {
      for (const surface::Facet& facet : block.facets)
        kernels("").hit(facet, scene.packets[p], scene.limits, hits[p]);
    }
  }
  return hits;
}

/// The search at these heights, with the source in random batches of blocks, in any order, some
/// twice.
UnsetPageVector<HitPacket> search(const Scene& scene, const std::vector<float>& heights,
                                  Random& random) {
  SearchState state;
  state.packets = scene.packets;
  state.groups = scene.groups;
  start(state);
  REQUIRE(state.open.size() == scene.groups.size());
  for (const float height : heights) {
    const auto open = open_boxes(state, 3, height);
    Box3f region;
    for (const Box3f& box : open) region.extend(box);
    std::vector<const surface::SourceBlock*> order;
    for (const surface::SourceBlock& block : scene.blocks) {
      order.push_back(&block);
      if (random.one_in(5)) order.push_back(&block);
    }
    for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[random.below(i)]);
    for (std::size_t at = 0; at < order.size();) {
      const std::size_t count = std::min<std::size_t>(1 + random.below(4), order.size() - at);
      const std::span<const surface::SourceBlock* const> all(order);
      const std::size_t most_listed =
          random.one_in(2) ? 0 : random.below(grid::BatchPatches::kMostListed + 1);
      grid::BatchPatches patches(all.subspan(at, count), region, most_listed);
      search_batch(patches, height, scene.limits, kernels(""), state);
      at += count;
    }
    close_groups(height, kernels(""), state);
  }
  return state.hits;
}

/// Lanes of which the two say different things.
std::size_t differences(const UnsetPageVector<HitPacket>& a, const UnsetPageVector<HitPacket>& b) {
  std::size_t count = 0;
  for (std::size_t p = 0; p < a.size(); ++p) {
    for (int lane = 0; lane < kLanes; ++lane) {
      const bool is_hit = a[p].key[lane] != kNoHit;
      count += a[p].key[lane] != b[p].key[lane] || a[p].id[lane] != b[p].id[lane] ||
               (is_hit &&
                (a[p].base_x[lane] != b[p].base_x[lane] || a[p].frac_x[lane] != b[p].frac_x[lane] ||
                 a[p].frac_y[lane] != b[p].frac_y[lane] || a[p].page[lane] != b[p].page[lane]));
    }
  }
  return count;
}

}  // namespace

TEST_CASE("the search finds the minimum over all facets at any heights and in any batches") {
  Random random(61);
  std::size_t found = 0, lanes = 0;
  for (int round = 0; round < 300; ++round) {
    const Scene scene = random_scene(random);
    const auto expected = brute_force(scene);
    for (const HitPacket& hit : expected) {
      for (const std::int32_t key : hit.key) found += key != kNoHit;
      lanes += kLanes;
    }
    const float far = scene.limits.max_distance;
    std::vector<float> uneven;
    for (int i = 0; i < 5; ++i) uneven.push_back(random.between(0.0F, far));
    std::sort(uneven.begin(), uneven.end());
    uneven.push_back(far);
    for (const auto& heights : {search_heights(far), {far}, uneven}) {
      const std::size_t wrong = differences(search(scene, heights, random), expected);
      if (wrong != 0) FAIL(wrong << " texels differ in round " << round);
    }
  }
  CHECK(found > lanes / 20);
  CHECK(found < lanes);
}

TEST_CASE("a smaller maximum distance only takes hits away") {
  Random random(62);
  Scene scene = random_scene(random);
  scene.limits.max_distance = 1.5F;
  const auto far = brute_force(scene);
  scene.limits.max_distance = 0.2F;
  const auto near = search(scene, search_heights(0.2F), random);
  for (std::size_t p = 0; p < far.size(); ++p) {
    for (int lane = 0; lane < kLanes; ++lane) {
      if (far[p].key[lane] < key_of(0.19F, scene.packets[p]))
        CHECK(near[p].id[lane] == far[p].id[lane]);
    }
  }
}

TEST_CASE("heights rise to the maximum distance") {
  for (const float far : {1e-6F, 0.3F, 5.0F, 1e6F}) {
    const auto heights = search_heights(far);
    CHECK(heights.front() > 0);
    CHECK(heights.back() == far);
    CHECK(std::is_sorted(heights.begin(), heights.end()));
  }
}

TEST_CASE("a packet's bundle holds its rays, and so does a bundle of bundles") {
  Random random(63);
  const auto inside = [](const Box3f& box, Vec3d p) {
    return box.lo.x <= p.x && p.x <= box.hi.x && box.lo.y <= p.y && p.y <= box.hi.y &&
           box.lo.z <= p.z && p.z <= box.hi.z;
  };
  for (int round = 0; round < 500; ++round) {
    std::vector<TexelPacket> packets;
    std::vector<RayBundle> bundles;
    for (std::uint64_t i = 0; i < 1 + random.below(4); ++i) {
      packets.push_back(test::random_packet(random, random.one_in(2) ? 0.01F : 1));
      if (random.one_in(10)) {  // a crease: normals that cancel out
        packets.back().nx[1] = -packets.back().nx[0];
        packets.back().ny[1] = -packets.back().ny[0];
        packets.back().nz[1] = -packets.back().nz[0];
      }
      bundles.push_back(bundle_of(packets.back()));
    }
    const RayBundle all = unite(bundles);
    const float height = random.between(0.0F, 2.0F);
    for (std::size_t i = 0; i < packets.size(); ++i) {
      for (int lane = 0; lane < kLanes; ++lane) {
        if (packets[i].texel[lane] == surface::kNoTexel) continue;
        const double t = random.between(-1.0, 1.0) * height;
        const Vec3d p{packets[i].px[lane] + t * packets[i].nx[lane],
                      packets[i].py[lane] + t * packets[i].ny[lane],
                      packets[i].pz[lane] + t * packets[i].nz[lane]};
        for (const RayBundle& bundle : {bundles[i], all}) {
          const double off = length(p - (Vec3d(bundle.origin) + Vec3d(bundle.direction) * t));
          if (off > double{bundle.offset} + std::abs(t) * bundle.spread)
            FAIL("a ray leaves its bundle");
          if (!inside(bundle.swept_box(height), p)) FAIL("a ray leaves its box");
          const Vec3f at(p);
          if (!bundle.may_meet(at, 1e-5F, height)) FAIL("a point of a ray is culled");
        }
      }
    }
  }
}

namespace {

/// Packets with hits at distances of up to `most`, some of whose lanes hit nothing.
SearchState with_distances(Random& random, float most) {
  SearchState state;
  const std::uint64_t packets = random.below(40);
  for (std::uint64_t p = 0; p < packets; ++p) {
    state.packets.push_back(test::random_packet(random, 0.1F));
    state.packets.back().coarseness = random.one_in(2) ? 0.0F : 4.0F;
  }
  state.hits.resize(state.packets.size());
  for (std::size_t p = 0; p < state.hits.size(); ++p) {
    clear(state.hits[p]);
    const float near = random.between(0.0F, most), spread = random.one_in(2) ? 0.0F : most / 4;
    for (std::int32_t& key : state.hits[p].key) {
      if (random.one_in(8)) continue;
      key = key_of(std::min(near + random.between(0.0F, 1.0F) * spread, most), state.packets[p]);
    }
  }
  return state;
}

}  // namespace

TEST_CASE("a packet's distances are counted as one by one, in any mixture of bins") {
  Random random(81);
  for (int round = 0; round < 200; ++round) {
    const float most = random.between(0.01F, 3.0F);
    const SearchState state = with_distances(random, most);
    DistanceCounts expected{}, counts{};
    std::uint64_t steps = 0;
    for (std::size_t p = 0; p < state.packets.size(); ++p) {
      for (int lane = 0; lane < kLanes; ++lane) {
        if (state.packets[p].texel[lane] == surface::kNoTexel) continue;
        if (state.hits[p].key[lane] == kNoHit) continue;
        const float distance = distance_of(state.hits[p].key[lane], state.packets[p]);
        count_distance(distance, most, expected);
        steps += distance_steps(distance, most);
      }
    }
    CHECK(count_distances(most, state, counts) == steps);
    CHECK(counts == expected);
  }
}

TEST_CASE("the middle height is the first that holds the middle distance") {
  Random random(82);
  for (int round = 0; round < 200; ++round) {
    const float most = random.between(0.01F, 3.0F);
    const SearchState state = with_distances(random, most);
    const std::vector<float> heights = search_heights(most);
    std::vector<float> distances;
    for (std::size_t p = 0; p < state.packets.size(); ++p) {
      if (state.hits[p].key[0] != kNoHit)
        distances.push_back(distance_of(state.hits[p].key[0], state.packets[p]));
    }
    std::sort(distances.begin(), distances.end());
    const float middle = distances.empty() ? 0 : distances[distances.size() / 2];
    const auto first =
        std::find_if(heights.begin(), heights.end() - 1, [&](float h) { return h >= middle; });
    CHECK(middle_height(state, heights) == static_cast<std::size_t>(first - heights.begin()));
  }
}
