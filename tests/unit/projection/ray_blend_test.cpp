// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>
#include <stdexcept>

#include "projection/splat_blend.h"
#include "unit/projection/splat_runs.h"

namespace pounce::projection {
namespace {

using namespace test;

TEST_CASE("a blend of a mesh's Gaussians ends where it is told to", "[projection]") {
  Random random(4);
  const auto sets = make_sets(random_splats(random, 200, false), 100);
  const RayLimits limits{0.4F, 0.4F, 0.17F};
  RayState state;
  SplatState packets = piece_of_packets(random, 10);
  state.packets = std::move(packets.packets);
  state.groups = std::move(packets.groups);
  start(limits, state);
  int calls = 0;
  const GoOn third = [&] {
    if (++calls == 3) throw std::runtime_error("stop");
  };
  const auto all = pointers(sets);
  CHECK_THROWS_AS(add_batch(all, limits, splat_kernels(""), state, third), std::runtime_error);
  CHECK(calls == 3);
  add_batch(all, limits, splat_kernels(""), state, third);
  CHECK(calls == 3 + 10);  // of every packet that is open
}

}  // namespace
}  // namespace pounce::projection
