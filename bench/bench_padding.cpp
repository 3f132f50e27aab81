// SPDX-License-Identifier: Apache-2.0
#include "bench_input.h"
#include "shading/pad_seams.h"

namespace pounce::bench {
namespace {

constexpr std::uint32_t kTexelBytes = 3;

/// Round charts on a square grid, as much gutter as chart. Per empty texel.
void padding_disks(benchmark::State& state) {
  const std::uint32_t size = scaled(state.range(0));
  const auto radius = static_cast<std::uint32_t>(state.range(1));
  const std::uint32_t pitch = size / 4;
  std::vector<std::uint8_t> covered(std::size_t{size} * size);
  std::vector<std::byte> texels(covered.size() * kTexelBytes), out(texels.size());
  std::uint64_t empty = 0;
  for (std::uint32_t y = 0; y < size; ++y) {
    for (std::uint32_t x = 0; x < size; ++x) {
      const double dx = x % pitch - pitch / 2.0, dy = y % pitch - pitch / 2.0;
      const bool inside = dx * dx + dy * dy < 0.16 * pitch * pitch;
      covered[std::size_t{y} * size + x] = inside ? 1 : 0;
      empty += inside ? 0 : 1;
      for (std::size_t c = 0; inside && c < kTexelBytes; ++c)
        texels[(std::size_t{y} * size + x) * kTexelBytes + c] = static_cast<std::byte>(x + c);
    }
  }
  std::uint64_t filled = 0;
  for (auto _ : state) {
    shading::SeamPadder padder(size, size, radius, kTexelBytes, mesh::kBlockEdge);
    for (std::uint32_t y = 0; y < size;) {
      const std::uint32_t rows = std::min<std::uint32_t>(mesh::kBlockEdge, size - y);
      padder.push(rows, texels.data() + std::size_t{y} * size * kTexelBytes,
                  covered.data() + std::size_t{y} * size);
      y += rows;
      if (padder.ready_rows() > 0) padder.pop(padder.ready_rows(), out.data());
    }
    filled = padder.filled();
  }
  count_work(state, "texel", static_cast<double>(empty));
  state.counters["filled"] = static_cast<double>(filled) / static_cast<double>(empty);
}
BENCHMARK(padding_disks)->Args({2048, 16})->Args({2048, 64})->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace pounce::bench
