// SPDX-License-Identifier: Apache-2.0
#include "grid/patch_grid.h"

#include <unistd.h>

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <set>
#include <vector>

#include "support/random.h"

using namespace pounce;
using namespace pounce::grid;
using pounce::test::Random;

namespace {

enum class Kind { scattered, flat, one, identical, huge_and_tiny, points };

Vec3f random_point(Random& random, float size) {
  return {random.between(-size, size), random.between(-size, size), random.between(-size, size)};
}

/// Patches whose facets are one each, so that a visit tells which patch it is.
surface::SourceBlock random_patches(Random& random, Kind kind, std::size_t count) {
  surface::SourceBlock block;
  for (std::size_t i = 0; i < count; ++i) {
    float size = random.between(0.0F, 0.3F);
    if (kind == Kind::huge_and_tiny) size = random.one_in(10) ? 8.0F : 1e-4F;
    if (kind == Kind::points) size = 0;
    surface::Patch patch;
    Vec3f lo = random_point(random, 5);
    Vec3f hi{lo.x + random.between(0.0F, size), lo.y + random.between(0.0F, size),
             lo.z + random.between(0.0F, size)};
    if (kind == Kind::flat) lo.z = hi.z = 1.5F;
    if (kind == Kind::identical) lo = {1, 1, 1}, hi = {2, 2, 2};
    patch.box = {lo, hi};
    patch.centre = (lo + hi) * 0.5F;
    patch.radius = length(hi - lo) * random.between(0.3F, 0.6F);
    patch.facet = static_cast<std::uint32_t>(i);
    block.patches.push_back(patch);
    block.facets.push_back({});
  }
  return block;
}

struct Ray {
  Vec3d p, n;
};

/// Some rays close together and the bundle that holds them.
RayBundle random_bundle(Random& random, std::vector<Ray>& rays) {
  RayBundle bundle;
  bundle.origin = random_point(random, 5);
  const Vec3f d = random_point(random, 1);
  bundle.direction = d * (1 / length(d));
  if (random.one_in(5)) bundle.direction = {0, 0, random.one_in(2) ? 1.0F : -1.0F};
  bundle.offset = random.between(1e-5F, 0.5F);
  bundle.spread = random.between(1e-5F, 0.5F);
  if (random.one_in(20)) bundle.direction = {}, bundle.spread = 1;
  rays.clear();
  for (int i = 0; i < 16; ++i) {
    const auto inside = [&](double radius) {
      const Vec3d v(random_point(random, 1));
      return v * (radius * random.unit() / std::max(length(v), 1e-9));
    };
    rays.push_back({Vec3d(bundle.origin) + inside(bundle.offset * 0.999),
                    Vec3d(bundle.direction) + inside(bundle.spread * 0.999)});
  }
  return bundle;
}

/// Does the ray, |t| <= height, surely meet both box and sphere at one point?
bool meets(const Ray& ray, const surface::Patch& patch, double height) {
  double low = -height, high = height;
  const double slack = 1e-6;
  const std::array<double, 3> p{ray.p.x, ray.p.y, ray.p.z}, n{ray.n.x, ray.n.y, ray.n.z};
  const std::array<double, 3> lo{patch.box.lo.x, patch.box.lo.y, patch.box.lo.z},
      hi{patch.box.hi.x, patch.box.hi.y, patch.box.hi.z};
  for (std::size_t k = 0; k < 3; ++k) {
    const double a = (lo[k] + slack - p[k]) / n[k], b = (hi[k] - slack - p[k]) / n[k];
    if (std::isnan(a) || std::isnan(b)) return false;
    if (hi[k] - lo[k] < 2 * slack) return false;
    low = std::max(low, std::min(a, b));
    high = std::min(high, std::max(a, b));
  }
  const Vec3d v = ray.p - Vec3d(patch.centre);
  const double radius = double{patch.radius} - slack;
  const double nn = dot(ray.n, ray.n), vn = dot(v, ray.n);
  const double under = vn * vn - nn * (dot(v, v) - radius * radius);
  if (radius <= 0 || nn == 0 || under < 0) return false;
  low = std::max(low, (-vn - std::sqrt(under)) / nn);
  high = std::min(high, (-vn + std::sqrt(under)) / nn);
  return low < high;
}

std::size_t resident_bytes() {
  std::ifstream statm("/proc/self/statm");
  std::size_t whole = 0, resident = 0;
  statm >> whole >> resident;
  return resident * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

}  // namespace

TEST_CASE("a query visits every patch that a ray of the bundle meets, each once") {
  const Kind kind = GENERATE(Kind::scattered, Kind::flat, Kind::one, Kind::identical,
                             Kind::huge_and_tiny, Kind::points);
  const bool all_space = GENERATE(true, false);
  Random random(41 + static_cast<std::uint64_t>(kind));
  std::size_t met = 0, visits = 0;
  for (int round = 0; round < 20; ++round) {
    const std::size_t count = kind == Kind::one ? 1 : 1 + random.below(600);
    const surface::SourceBlock first = random_patches(random, kind, count);
    const surface::SourceBlock second = random_patches(random, kind, count);
    const std::array<const surface::SourceBlock*, 2> blocks{&first, &second};
    std::vector<Ray> rays;
    for (int query = 0; query < 30; ++query) {
      const RayBundle bundle = random_bundle(random, rays);
      const float height = random.one_in(3) ? 8.0F : random.between(0.01F, 1.0F);
      // The region that a grid is made for holds all that is asked of it, sometimes barely.
      const Box3f region =
          all_space ? Box3f{{-100, -100, -100}, {100, 100, 100}} : bundle.swept_box(height);
      PatchGrid grid(blocks, region);
      for (int repeat = 0; repeat < 2; ++repeat) {  // a query leaves the grid as it was
        std::multiset<const surface::Facet*> visited;
        grid.query(bundle, height, [&](const GridItem& item) {
          visited.insert(item.facet);
          if (!bundle.may_meet(item.centre, item.radius, height)) FAIL("a needless visit");
        });
        visits += visited.size();
        for (const surface::SourceBlock* block : blocks) {
          for (const surface::Patch& patch : block->patches) {
            const std::size_t times = visited.count(&block->facets[patch.facet]);
            if (times > 1) FAIL("a patch is visited " << times << " times");
            const bool needed = std::any_of(rays.begin(), rays.end(), [&](const Ray& ray) {
              return meets(ray, patch, height);
            });
            if (needed && times != 1) FAIL("a patch is missed in round " << round);
            met += needed;
          }
        }
      }
    }
  }
  if (kind == Kind::scattered || kind == Kind::identical || kind == Kind::huge_and_tiny)
    CHECK(met > 200);
  if (kind != Kind::one) CHECK(visits > 100);
}

TEST_CASE("a grid without patches answers") {
  PatchGrid grid({}, {{-1, -1, -1}, {1, 1, 1}});
  int visits = 0;
  grid.query({{0, 0, 0}, {0, 0, 1}, 1, 0.1F}, 5, [&](const GridItem&) { ++visits; });
  CHECK(visits == 0);
}

TEST_CASE("a grid of many patches stays within the bytes it says, however uneven they are") {
  const Kind kind = GENERATE(Kind::scattered, Kind::flat, Kind::huge_and_tiny, Kind::points);
  Random random(43);
  constexpr std::size_t kPatches = 400000;
  const surface::SourceBlock block = random_patches(random, kind, kPatches);
  const std::array<const surface::SourceBlock*, 1> blocks{&block};
  const std::size_t before = resident_bytes();
  const PatchGrid grid(blocks, {{-100, -100, -100}, {100, 100, 100}});
  const std::size_t after = resident_bytes();
  CHECK(after - before <= PatchGrid::most_bytes(kPatches) + (1 << 20));
  CHECK(after - before >= kPatches * sizeof(GridItem) / 2);  // it was measured at all
}
