// SPDX-License-Identifier: Apache-2.0
//
// Splat scenes onto meshes, files in and out: against a brute force, and the same bytes always.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>

#include "core/file.h"
#include "flow/test_knobs.h"
#include "io/read_mesh.h"
#include "pounce/transfer.h"
#include "support/bytes.h"
#include "support/many_threads.h"
#include "support/random_scene.h"
#include "support/reference_splats.h"
#include "support/splat_scenes.h"
#include "support/test_data.h"
#include "support/whole_image.h"

namespace pounce::test {
namespace {

constexpr std::uint64_t kMiB = 1 << 20;

double diagonal(const mesh::Mesh& mesh) {
  Vec3d lo{1e30, 1e30, 1e30}, hi{-1e30, -1e30, -1e30};
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t v : triangle) {
      const Vec3d p(mesh.positions[v]);
      lo = {std::min(lo.x, p.x), std::min(lo.y, p.y), std::min(lo.z, p.z)};
      hi = {std::max(hi.x, p.x), std::max(hi.y, p.y), std::max(hi.z, p.z)};
    }
  }
  return length(hi - lo);
}

/// Gaussians of every kind strewn over a mesh: about as wide as their neighbours are far.
std::vector<ReferenceSplat> strew(const mesh::Mesh& mesh, Random& random, std::size_t count,
                                  bool with_normals) {
  auto scene = random_splats(random, count, with_normals);
  const double size = diagonal(mesh);
  for (ReferenceSplat& s : scene) {
    const auto& corner = mesh.triangles[random.below(mesh.triangles.size())];
    double u = random.unit(), v = random.unit();
    if (u + v > 1) {
      u = 1 - u;
      v = 1 - v;
    }
    const auto blend = [&](const std::vector<Vec3f>& values) {
      return Vec3d(values[corner[0]]) * (1 - u - v) + Vec3d(values[corner[1]]) * u +
             Vec3d(values[corner[2]]) * v;
    };
    const double lift = s.mean.z * 0.3 * size;  // most near the surface, some in a second layer
    s.mean = blend(mesh.positions) + blend(mesh.normals) * lift;
    for (double& sigma : s.sigma) sigma *= 0.5 * size;
    s.rotation = random_rotation(random);
    if (random.one_in(3)) s.sigma[2] = s.sigma[1];
    s.alpha = std::min(s.alpha, 0.99);
    if (length(s.normal) > 0) s.normal = blend(mesh.normals);
    s = as_floats(s);
  }
  return scene;
}

/// A target and a scene around it, in files.
TransferOptions splat_scene(const TempFolder& folder, std::uint32_t seed, std::size_t count) {
  TransferOptions options = make_random_scene(folder.path().string(), seed);
  options.channels.clear();
  options.all_channels = false;
  options.source_textures.clear();
  Random random(seed);
  const mesh::Mesh target = io::read_mesh(options.targets.front());
  options.source = folder.file("scene.ply");
  write_reference_splats(options.source, strew(target, random, count, seed % 2 == 0));
  options.max_distance = {5.3, true};
  options.output = folder.file("out.png");
  options.coverage_output = folder.file("coverage.png");
  options.resources.use_cache = false;
  options.resources.memory_bytes = 256 * kMiB;
  return options;
}

std::vector<std::byte> run(const TransferOptions& options, const flow::TestKnobs& knobs = {}) {
  flow::transfer(options, knobs);
  return read_whole(posix_file_system(), options.output);
}

/// Transfers a scene of 3000 Gaussians and looks at every fifth texel.
void compare_with_brute_force(const TransferOptions& options, bool antialiased) {
  const Report report = transfer(options);
  CHECK(report.source_filtered.empty());
  CHECK(report.source_gaussians == 3000);

  const auto scene = read_reference_splats(options.source);
  const mesh::Mesh target = io::read_mesh(options.targets.front());
  const WholeImage out = read_whole_image(options.output),
                   coverage = read_whole_image(options.coverage_output);
  REQUIRE(out.channels == 3);
  const TargetRaster raster = raster_target(target, out.width, out.height);
  ReferenceLimits limits;
  limits.max_distance = options.max_distance.value / 100 * diagonal(target);
  limits.min_cosine = std::cos(options.max_angle_deg * std::numbers::pi / 180);
  limits.window = report.depth_window;
  limits.antialiased = antialiased;
  std::size_t compared = 0, unsure = 0, wrong = 0, empty = 0;
  double largest = 0;
  for (std::size_t i = 0; i < raster.owner.size(); i += 5) {
    const auto texel = reference_texel(target, raster, i);
    if (!texel || raster.on_edge[i] != 0) continue;
    const ReferenceBlend expected = reference_blend(scene, *texel, limits);
    if (expected.unsure) {
      ++unsure;
      continue;
    }
    ++compared;
    const bool covered = coverage.at(i, 0) > 0.5;
    wrong += covered != expected.covered ? 1 : 0;
    empty += expected.covered ? 0 : 1;
    if (!covered || !expected.covered) continue;
    const std::array<double, 3> colour{expected.colour.x, expected.colour.y, expected.colour.z};
    for (std::size_t c = 0; c < 3; ++c)
      largest = std::max(largest, std::abs(out.at(i, c) - colour[c]));
  }
  CAPTURE(compared, unsure, wrong, empty, largest * 255);
  CHECK(compared > 300);
  CHECK(unsure * 10 < compared);
  CHECK(wrong == 0);
  CHECK(largest <= 1.0 / 255);
  std::printf("FIGURE splat reference largest %.3f/255 compared %zu unsure %zu empty %zu\n",
              largest * 255, compared, unsure, empty);
}

}  // namespace

TEST_CASE("splat scenes agree with the brute force", "[flow]") {
  const std::uint32_t seed = GENERATE(range(1U, 7U));
  CAPTURE(seed);
  const TempFolder folder;
  compare_with_brute_force(splat_scene(folder, seed, 3000), false);
}

TEST_CASE("a scene marked antialiased is blended as one", "[flow]") {
  const TempFolder folder;
  TransferOptions options = splat_scene(folder, 2, 3000);
  options.size = ImageSize{60, 60};  // texels as large as the Gaussians, or the mark means little
  const auto plain = run(options);
  write_reference_splats(options.source, read_reference_splats(options.source), "antialiased 1");
  CHECK(run(options) != plain);
  compare_with_brute_force(options, true);
}

TEST_CASE("splats give the same bytes however they are streamed", "[flow]") {
  const std::uint32_t seed = GENERATE(21U, 24U);
  const TempFolder folder;
  TransferOptions options =
      splat_scene(folder, seed, 20000);  // several blocks, one at a time below
  options.size = ImageSize{300, 260};
  options.resources.threads = 1;
  const auto expected = run(options, {.in_core = true});
  for (const unsigned threads : {1U, 5U}) {
    for (const std::uint64_t tile_cap : {std::uint64_t{1}, std::uint64_t{0}}) {
      options.resources.threads = threads;
      const flow::TestKnobs knobs{.tile_cap_bytes = tile_cap};
      options.resources.memory_bytes = 512 * kMiB;
      const std::uint64_t least = flow::plan(options, knobs).least_memory_bytes;
      for (const std::uint64_t memory : {least, 512 * kMiB}) {
        options.resources.memory_bytes = memory;
        CAPTURE(seed, threads, tile_cap, memory);
        options.resources.use_cache = false;
        CHECK(run(options, knobs) == expected);
        options.resources.use_cache = true;
        options.resources.cache_dir = folder.file("cache");
        std::filesystem::remove_all(options.resources.cache_dir);
        CHECK(run(options, knobs) == expected);  // cold
        CHECK(run(options, knobs) == expected);  // warm
      }
    }
  }
  options.resources.use_cache = false;
  for (const char* isa : {"sse2", "avx2", "avx512"}) {
    CAPTURE(seed, isa);
    try {
      const auto made = run(options, {.isa = isa});  // CHECK would keep what it throws
      CHECK(made == expected);
    } catch (const Error& e) {
      CHECK(e.kind() == ErrorKind::usage);  // this processor has no such kernels
    }
  }
}

TEST_CASE("what a splat scene cannot give is refused with the reason", "[flow]") {
  const TempFolder folder;
  TransferOptions options = splat_scene(folder, 3, 100);
  const auto refusal = [&](const TransferOptions& asked, ErrorKind kind, const std::string& part) {
    std::string message;
    CHECK(error_kind([&] { transfer(asked); }, &message) == exit_status(kind));
    CAPTURE(message);
    CHECK(message.find(part) != std::string::npos);
    CHECK(!std::filesystem::exists(asked.output));
  };
  TransferOptions other = options;
  other.channels = {Channel::base_color, Channel::emissive};
  refusal(other, ErrorKind::input, "no emissive");
  other = options;
  other.source_textures = {{Channel::base_color, "a.png"}};
  refusal(other, ErrorKind::usage, "--source-texture");
  other = options;
  other.source = folder.file("scene.spz");
  std::ofstream(other.source, std::ios::binary) << "NGSP" << std::string(28, '\4');
  refusal(other, ErrorKind::input, "splat-transform");
  other = options;
  other.resources.memory_bytes = kMiB;
  refusal(other, ErrorKind::budget, "--memory");
}

TEST_CASE("a splat scene without a size gives 1024 texels", "[flow]") {
  const TempFolder folder;
  TransferOptions options = splat_scene(folder, 3, 100);
  options.size.reset();
  options.all_channels = true;  // baseColor is all there is
  transfer(options);
  const WholeImage out = read_whole_image(options.output);
  CHECK(out.width == 1024);
  CHECK(out.height == 1024);
}

}  // namespace pounce::test
