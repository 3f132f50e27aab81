// SPDX-License-Identifier: Apache-2.0
//
// --method gaussian, files in and out: against brute force, and the same bytes always.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <numbers>
#include <string>

#include "core/file.h"
#include "flow/transfer.h"
#include "io/read_mesh.h"
#include "pounce/transfer.h"
#include "recipes.h"
#include "support/bytes.h"
#include "support/many_threads.h"
#include "support/memory_file_system.h"
#include "support/mesh_files.h"
#include "support/random.h"
#include "support/reference_gaussians.h"
#include "support/test_data.h"

namespace pounce::test {
namespace {

constexpr std::uint64_t kMiB = 1 << 20;
constexpr double kThickness = 0.01;  // docs/decisions/014

/// A wavy sheet of cells x cells squares; `lift` moves it along z, `swap` turns its UVs.
mesh::Mesh sheet(std::uint32_t cells, float lift, bool swap, float u_scale) {
  mesh::Mesh out;
  out.uv_sets.resize(1);
  const auto n = static_cast<float>(cells);
  for (std::uint32_t j = 0; j <= cells; ++j) {
    for (std::uint32_t i = 0; i <= cells; ++i) {
      const float x = static_cast<float>(i) / n, y = static_cast<float>(j) / n;
      const float slope_x = 0.5F * std::cos(5 * x), slope_y = -0.4F * std::sin(4 * y);
      out.positions.push_back({x, y, 0.1F * std::sin(5 * x) + 0.1F * std::cos(4 * y) + lift});
      const Vec3f normal{-slope_x, -slope_y, 1};
      out.normals.push_back(normal * (1 / length(normal)));
      const Vec2f uv{0.02F + 0.96F * (swap ? y : x), 0.02F + 0.96F * (swap ? 1 - x : y)};
      out.uv_sets[0].push_back({uv.x * u_scale, uv.y});
    }
  }
  for (std::uint32_t j = 0; j < cells; ++j) {
    for (std::uint32_t i = 0; i < cells; ++i) {
      const std::uint32_t a = j * (cells + 1) + i, b = a + 1, c = a + cells + 1, d = c + 1;
      out.triangles.push_back({a, b, d});
      out.triangles.push_back({a, d, c});
    }
  }
  return out;
}

/// The same sheet a second time, deeper, with the right half of the image.
mesh::Mesh two_layers(std::uint32_t cells, float apart) {
  mesh::Mesh out = sheet(cells, 0, false, 0.5F);
  const mesh::Mesh back = sheet(cells, -apart, false, 0.5F);
  const auto first = static_cast<std::uint32_t>(out.positions.size());
  out.positions.insert(out.positions.end(), back.positions.begin(), back.positions.end());
  out.normals.insert(out.normals.end(), back.normals.begin(), back.normals.end());
  for (const Vec2f& uv : back.uv_sets[0]) out.uv_sets[0].push_back({uv.x + 0.5F, uv.y});
  for (const auto& t : back.triangles)
    out.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  return out;
}

WholeImage random_image(std::uint32_t width, std::uint32_t height, std::uint32_t channels,
                        std::uint32_t seed) {
  Random random(seed);
  WholeImage image{width, height, channels, false, {}};
  for (std::size_t i = 0; i < std::size_t{width} * height * channels; ++i) {
    const bool is_alpha = channels == 4 && i % 4 == 3;
    image.samples.push_back(is_alpha && random.one_in(3) ? 0 : random.unit());
  }
  return image;
}

TransferOptions sheets(const TempFolder& folder, std::uint32_t channels) {
  TransferOptions options;
  write_glb(folder.file("source.glb"), two_layers(8, 0.15F));
  write_glb(folder.file("target.glb"), sheet(7, 0.01F, true, 1));
  write_whole_image(folder.file("skin.png"), random_image(160, 80, channels, 5));
  options.source = folder.file("source.glb");
  options.targets = {folder.file("target.glb")};
  options.material.textures = {{Channel::base_color, folder.file("skin.png")}};
  options.output = folder.file("out.png");
  options.image.coverage_output = folder.file("coverage.png");
  options.image.size = ImageSize{96, 96};
  options.mesh.method = Method::gaussian;
  options.resources.use_cache = false;
  options.resources.memory_bytes = 256 * kMiB;
  return options;
}

double diagonal(const mesh::Mesh& mesh) {
  Vec3d lo{1e30, 1e30, 1e30}, hi{-1e30, -1e30, -1e30};
  for (const Vec3f& p : mesh.positions) {
    lo = {std::min(lo.x, double{p.x}), std::min(lo.y, double{p.y}), std::min(lo.z, double{p.z})};
    hi = {std::max(hi.x, double{p.x}), std::max(hi.y, double{p.y}), std::max(hi.z, double{p.z})};
  }
  return length(hi - lo);
}

std::vector<std::byte> run(const TransferOptions& options, const job::TestKnobs& knobs = {}) {
  flow::transfer(options, knobs);
  return read_whole(posix_file_system(), options.output);
}

/// The image that a transfer's source has, by name or in itself.
WholeImage skin_of(const TransferOptions& options, const mesh::Mesh& source) {
  return options.material.textures.empty()
             ? read_whole_image(source.images.front())
             : read_whole_image(options.material.textures.front().path);
}

struct Compared {
  std::size_t texels = 0, wrong = 0, unsure = 0, empty = 0;
  double largest = 0;  ///< steps of 1/255
};

/// A transfer's texels, a thousand of them, against the definition in docs/paper.md.
Compared compare_with_definition(const TransferOptions& options) {
  const mesh::Mesh source = io::read_mesh(options.source);
  const mesh::Mesh target = io::read_mesh(options.targets.front());
  const WholeImage skin = skin_of(options, source);
  const auto gaussians = texels_as_gaussians(
      source, skin, options.mesh.sigma_texels.value_or(kDefaultSigma), kThickness);
  transfer(options);
  const WholeImage out = read_whole_image(options.output),
                   coverage = read_whole_image(options.image.coverage_output);
  const TargetRaster raster = raster_target(target, out.width, out.height);
  RayBlendLimits limits;
  const double diag = diagonal(target);
  limits.max_distance = options.search.max_distance.value_or(Length{5, true}).value / 100 * diag;
  limits.first_reach =
      diag / std::ceil(std::cbrt(static_cast<double>(out.width) * out.height) - 1e-9) / 2;
  limits.min_cosine = std::cos(options.search.max_angle_deg * std::numbers::pi / 180);
  Compared result;
  const std::size_t step = std::max<std::size_t>(raster.owner.size() / 1300, 1);
  for (std::size_t i = 0; i < raster.owner.size(); i += step) {
    const auto texel = reference_texel(target, raster, i);
    if (!texel || raster.on_edge[i] != 0) continue;
    const RayBlend expected = ray_blend(gaussians, *texel, limits);
    if (expected.unsure) {
      ++result.unsure;
      continue;
    }
    ++result.texels;
    const bool covered = coverage.at(i, 0) > 0.5;
    result.wrong += covered != expected.covered ? 1 : 0;
    result.empty += expected.covered ? 0 : 1;
    if (!covered || !expected.covered) continue;
    const std::array<double, 4> colour{expected.colour.x, expected.colour.y, expected.colour.z,
                                       expected.alpha};
    for (std::size_t c = 0; c < out.channels; ++c)
      result.largest = std::max(result.largest, 255 * std::abs(out.at(i, c) - colour[c]));
  }
  std::printf("FIGURE ray blend largest %.3f/255 compared %zu unsure %zu empty %zu\n",
              result.largest, result.texels, result.unsure, result.empty);
  return result;
}

}  // namespace

TEST_CASE("texels as Gaussians agree with the brute force", "[flow]") {
  const TempFolder folder;
  TransferOptions options = sheets(folder, GENERATE(3U, 4U));
  options.mesh.sigma_texels = GENERATE(0.3, 0.5, 1.5);
  const Compared c = compare_with_definition(options);
  CAPTURE(c.texels, c.unsure, c.empty, *options.mesh.sigma_texels);
  CHECK(c.texels > 1000);
  CHECK(c.unsure * 20 < c.texels);
  CHECK(c.wrong == 0);
  CHECK(c.largest <= 1);
}

TEST_CASE("texels as Gaussians reach as far as they may and turn as far as they may", "[flow]") {
  const TempFolder folder;
  TransferOptions options = sheets(folder, 3);
  write_glb(folder.file("target.glb"), sheet(7, 0.06F, true, 1));  // several cells away
  options.search.max_distance = Length{6, true};
  options.search.max_angle_deg = 20;
  const Compared c = compare_with_definition(options);
  CHECK(c.texels > 1000);
  CHECK(c.wrong == 0);
  CHECK(c.largest <= 1);
  options.search.max_distance = Length{2, true};
  const Compared none = compare_with_definition(options);
  CHECK(none.wrong == 0);
  CHECK(none.empty > 100);
}

TEST_CASE("a head's texels give the sums of the literal benchmark", "[flow]") {
  const TempFolder folder;
  const std::string in = folder.file("in");
  fixture::make_head({.folder = in, .triangles = 2000, .texture_size = 256, .target_size = 256});
  TransferOptions options = sheets(folder, 3);
  options.source = in + "/head_src.glb";
  options.material.textures.clear();
  // Itself, and the same surface with other triangles and UVs.
  options.targets = {in + (GENERATE(false, true) ? "/head_src.glb" : "/head_same.glb")};
  CAPTURE(options.targets.front());
  options.image.size = ImageSize{256, 256};
  const Compared c = compare_with_definition(options);
  CHECK(c.texels > 500);
  CHECK(c.wrong == 0);
  CHECK(c.largest <= 1);

  const mesh::Mesh target = io::read_mesh(options.targets.front());
  const WholeImage out = read_whole_image(options.output);
  const mesh::Mesh source = io::read_mesh(options.source);
  const auto gaussians = texels_as_gaussians(source, skin_of(options, source), 0.5, 2e-4);
  const TargetRaster raster = raster_target(target, out.width, out.height);
  std::vector<ReferenceTexel> texels;
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < raster.owner.size(); ++i) {
    const auto texel = reference_texel(target, raster, i);
    if (!texel || raster.on_edge[i] != 0) continue;
    texels.push_back(*texel);
    places.push_back(i);
  }
  const LiteralBlend literal(gaussians, texels);
  std::size_t compared = 0, beyond = 0;
  double largest = 0;
  for (std::size_t k = 0; k < texels.size(); k += std::max<std::size_t>(texels.size() / 1000, 1)) {
    const auto colour = literal.colour(texels[k]);
    REQUIRE(colour);
    ++compared;
    double difference = 0;
    for (std::size_t c3 = 0; c3 < 3; ++c3) {
      const double expected = c3 == 0 ? colour->x : c3 == 1 ? colour->y : colour->z;
      difference = std::max(difference, 255 * std::abs(out.at(places[k], c3) - expected));
    }
    beyond += difference > 1 ? 1 : 0;
    largest = std::max(largest, difference);
  }
  std::printf("FIGURE literal benchmark largest %.3f/255 beyond 1: %zu of %zu\n", largest, beyond,
              compared);
  CHECK(compared >= 1000);
  CHECK(beyond == 0);
}

TEST_CASE("texels as Gaussians give the same bytes however they are streamed", "[flow]") {
  const TempFolder folder;
  const std::string in = folder.file("in");
  fixture::make_head({.folder = in, .triangles = 3000, .texture_size = 512, .target_size = 64});
  TransferOptions options = sheets(folder, 3);
  options.source = in + "/head_src.glb";
  options.material.textures.clear();
  options.targets = {in + "/head_same.glb"};
  options.image.size = ImageSize{600, 500};
  options.mesh.densify = GENERATE(false, true);
  options.resources.threads = 1;
  options.resources.memory_bytes = 1024 * kMiB;
  const auto in_memory = test::make_memory_file_system();
  const auto expected = run(options, {.files = in_memory.get()});
  for (const unsigned threads : {1U, 8U}) {
    options.resources.threads = threads;
    options.resources.memory_bytes = 1024 * kMiB;
    const std::uint64_t least = pounce::plan(options).least_memory_bytes;
    CHECK(least < 64 * kMiB);
    for (const std::uint64_t memory : {least, 64 * kMiB, 1024 * kMiB}) {
      options.resources.memory_bytes = memory;
      CAPTURE(options.mesh.densify, threads, memory);
      options.resources.use_cache = false;
      CHECK(run(options) == expected);
      options.resources.use_cache = true;
      options.resources.cache_dir = folder.file("cache");
      std::filesystem::remove_all(options.resources.cache_dir);
      CHECK(run(options) == expected);  // cold
      CHECK(run(options) == expected);  // its results are known
      std::filesystem::remove_all(folder.file("cache/v3/results"));
      CHECK(run(options) == expected);  // its stores alone
    }
  }
  options.resources.use_cache = false;
  for (const char* isa : {"sse2", "avx2", "avx512"}) {
    CAPTURE(isa);
    try {
      const auto made = run(options, {.isa = isa});  // CHECK would keep what it throws
      CHECK(made == expected);
    } catch (const Error& e) {
      CHECK(e.kind() == ErrorKind::usage);  // this processor lacks it
    }
  }
}

TEST_CASE("a store of texels is found again only for what made it", "[flow]") {
  const TempFolder folder;
  TransferOptions options = sheets(folder, 4);
  options.resources.use_cache = true;
  options.resources.cache_dir = folder.file("cache");
  const auto is_cached = [&] {
    const Report report = transfer(options);
    for (const StageTime& stage : report.stages) {
      if (stage.name == "precondition") return stage.cached;
    }
    return false;
  };
  CHECK_FALSE(is_cached());
  CHECK(is_cached());
  const Report warm = transfer(options);
  CHECK(warm.images_decoded == 0);
  CHECK(warm.method == "gaussian");
  CHECK(warm.sigma_texels == 0.5);
  options.mesh.sigma_texels = 0.6;
  CHECK_FALSE(is_cached());
  options.mesh.densify = true;
  CHECK_FALSE(is_cached());
  CHECK(is_cached());
  options.source_use.axes = "x,z,-y";
  options.target_use.axes = "x,z,-y";
  CHECK_FALSE(is_cached());
  options.source_use.axes = options.target_use.axes = "";
  const auto before = run(options);
  write_whole_image(folder.file("skin.png"), random_image(160, 80, 4, 6));
  CHECK_FALSE(is_cached());
  CHECK(run(options) != before);
  options.mesh.method = Method::surface;
  options.mesh.sigma_texels.reset();
  options.mesh.densify = false;
  transfer(options);
}

TEST_CASE("splitting makes a stretched surface uniformly dense", "[flow]") {
  // The right half of the sheet is ten times as long as the left half, with as many texels.
  const TempFolder folder;
  TransferOptions options = sheets(folder, 3);
  mesh::Mesh stretched = sheet(8, 0, false, 1);
  for (Vec3f& p : stretched.positions) p = {p.x < 0.5F ? p.x : 0.5F + (p.x - 0.5F) * 10, p.y, 0};
  for (Vec3f& n : stretched.normals) n = {0, 0, 1};
  write_glb(folder.file("source.glb"), stretched);
  write_glb(folder.file("target.glb"), stretched);
  options.mesh.sigma_texels = 0.5;
  const Report plain = transfer(options);
  const double coverage = static_cast<double>(plain.target_covered);
  options.mesh.densify = true;
  const Report dense = transfer(options);
  CAPTURE(plain.source_gaussians, dense.source_gaussians);
  CHECK(dense.source_gaussians > plain.source_gaussians * 5 / 4);
  CHECK(dense.source_gaussians < plain.source_gaussians * 3);
  CHECK(static_cast<double>(dense.target_covered) >= coverage);
  CHECK(dense.densify);
}

TEST_CASE("what texels as Gaussians cannot do is refused", "[flow]") {
  const TempFolder folder;
  const TransferOptions usual = sheets(folder, 3);
  const auto kind = [](const TransferOptions& options) {
    try {
      transfer(options);
    } catch (const Error& e) {
      return e.kind();
    }
    return ErrorKind::internal;
  };
  TransferOptions options = usual;
  options.channels.transferred = {Channel::base_color, Channel::occlusion};
  CHECK(kind(options) == ErrorKind::usage);
  options = usual;
  options.channels.all = true;
  CHECK(kind(options) == ErrorKind::usage);
  options = usual;
  options.mesh.sigma_texels = 0;
  CHECK(kind(options) == ErrorKind::usage);
  options = usual;
  options.mesh.method = Method::surface;
  options.mesh.densify = true;
  CHECK(kind(options) == ErrorKind::usage);
  options = usual;
  options.resources.memory_bytes = 1 << 20;
  CHECK(kind(options) == ErrorKind::budget);
}

}  // namespace pounce::test
