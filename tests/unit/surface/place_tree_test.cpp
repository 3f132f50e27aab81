// SPDX-License-Identifier: Apache-2.0
#include "surface/place_tree.h"

#include <catch2/catch.hpp>
#include <limits>
#include <vector>

#include "support/random.h"

namespace pounce::surface {
namespace {

/// By looking at all.
const Place* slow_nearest(const std::vector<Place>& places, Vec3f point, Vec3f normal, float facing,
                          float most) {
  const Place* best = nullptr;
  float least = most * most;
  for (const Place& place : places) {
    const Vec3f to = place.position - point;
    if (dot(to, to) >= least || dot(place.normal, normal) < facing) continue;
    least = dot(to, to);
    best = &place;
  }
  return best;
}

Vec3f corner(test::Random& random) {
  // On a lattice, so that many lie at one place and many as far away.
  const auto at = [&] { return static_cast<float>(random.whole(0, 6)); };
  return {at(), at(), at()};
}

Vec3f anywhere(test::Random& random) {
  return {random.between(-1.F, 7.F), random.between(-1.F, 7.F), random.between(-1.F, 7.F)};
}

Vec3f axis(test::Random& random) {
  const float sign = random.one_in(2) ? 1.F : -1.F;
  switch (random.below(3)) {
    case 0:
      return {sign, 0, 0};
    case 1:
      return {0, sign, 0};
    default:
      return {0, 0, sign};
  }
}

TEST_CASE("a tree of places finds what looking at all of them finds, of equal ones the first") {
  test::Random random(5);
  for (const std::size_t count : {0, 1, 2, 8, 9, 17, 500}) {
    for (const bool on_lattice : {true, false}) {
      std::vector<Place> places(count);
      for (Place& place : places)
        place = {on_lattice ? corner(random) : anywhere(random), axis(random)};
      const PlaceTree tree(places);
      for (int i = 0; i < 500; ++i) {
        const Vec3f point = random.one_in(2) ? corner(random) : anywhere(random);
        const Vec3f normal = axis(random);
        for (const float facing : {-2.F, 0.25F, 1.F}) {
          for (const float most : {0.F, 1.F, 2.5F, 100.F}) {
            const Place* const slow = slow_nearest(places, point, normal, facing, most);
            const Place* const fast = tree.nearest(point, normal, facing, most);
            REQUIRE((fast == nullptr) == (slow == nullptr));
            if (slow == nullptr) continue;
            REQUIRE(fast->position == slow->position);
            REQUIRE(fast->normal == slow->normal);
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace pounce::surface
