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
#include "flow/transfer.h"
#include "io/read_mesh.h"
#include "pounce/transfer.h"
#include "support/bytes.h"
#include "support/many_threads.h"
#include "support/memory_file_system.h"
#include "support/random_scene.h"
#include "support/reference_splats.h"
#include "support/splat_ply_builder.h"
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
  options.channels.transferred.clear();
  options.channels.all = false;
  options.material.textures.clear();
  Random random(seed);
  const mesh::Mesh target = io::read_mesh(options.targets.front());
  options.source = folder.file("scene.ply");
  write_reference_splats(options.source, strew(target, random, count, seed % 2 == 0));
  options.search.max_distance = Length{5.3, true};
  options.splats.look = Look::normal;
  options.splats.min_confidence =
      0;  // chaos around a surface: what is blended counts, not whether it fits
  options.output = folder.file("out.png");
  options.image.coverage_output = folder.file("coverage.png");
  options.resources.use_cache = false;
  options.resources.memory_bytes = 256 * kMiB;
  return options;
}

std::vector<std::byte> run(const TransferOptions& options, const job::TestKnobs& knobs = {}) {
  flow::transfer(options, knobs);
  return read_whole(posix_file_system(), options.output);
}

/// Transfers a scene of 3000 Gaussians and looks at every fifth texel, or so.
void compare_with_brute_force(const TransferOptions& options, bool antialiased,
                              std::size_t stride = 5) {
  const Report report = flow::transfer(options, {.keeps_isolated = true});
  CHECK(report.source_filtered.empty());
  CHECK(report.source_gaussians == 3000);

  const auto scene = read_reference_splats(options.source);
  const mesh::Mesh target = io::read_mesh(options.targets.front());
  const WholeImage out = read_whole_image(options.output),
                   coverage = read_whole_image(options.image.coverage_output);
  REQUIRE(out.channels == (options.splats.alpha ? 4 : 3));
  const TargetRaster raster = raster_target(target, out.width, out.height);
  ReferenceLimits limits;
  limits.reach = options.search.max_distance->value / 100 * diagonal(target);
  limits.min_cosine = std::cos(options.search.max_angle_deg * std::numbers::pi / 180);
  limits.window = report.depth_window;
  limits.discness = reference_discness(scene);
  limits.antialiased = antialiased;
  limits.fine_edge = reference_fine_edge(scene);
  look_where_found(report.targets.front(), limits);
  std::size_t compared = 0, unsure = 0, wrong = 0, empty = 0, beyond = 0;
  double largest = 0;
  for (std::size_t i = 0; i < raster.owner.size(); i += stride) {
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
    double error = 0;
    for (std::size_t c = 0; c < 3; ++c) error = std::max(error, std::abs(out.at(i, c) - colour[c]));
    if (options.splats.alpha) error = std::max(error, std::abs(out.at(i, 3) - expected.opacity));
    beyond += error > 1.0 / 255 ? 1 : 0;
    largest = std::max(largest, error);
  }
  CAPTURE(compared, unsure, wrong, empty, largest * 255);
  CHECK(compared > 300);
  CHECK(unsure * 10 < compared);
  CHECK(wrong == 0);
  // The store keeps 16 bits of a rotation: of a needle that ends at a texel, that is a few 255ths.
  CHECK(beyond * 500 <= compared);
  CHECK(largest <= 8.0 / 255);
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
  options.image.size =
      ImageSize{60, 60};  // texels as large as the Gaussians, or the mark means little
  const auto plain = run(options);
  write_reference_splats(options.source, read_reference_splats(options.source), "antialiased 1");
  CHECK(run(options) != plain);
  compare_with_brute_force(options, true);
}

TEST_CASE("a target coarser than its scene agrees with the brute force", "[flow]") {
  const TempFolder folder;
  TransferOptions options = splat_scene(folder, 2, 3000);
  options.image.size = ImageSize{28, 28};
  compare_with_brute_force(options, false, 1);
}

TEST_CASE("a texel's alpha is the opacity that its normal meets", "[flow]") {
  const TempFolder folder;
  TransferOptions options = splat_scene(folder, 3, 3000);
  options.splats.alpha = true;
  compare_with_brute_force(options, false);
}

TEST_CASE("splats give the same bytes however they are streamed", "[flow]") {
  const std::uint32_t seed = GENERATE(21U, 24U, 27U);
  const TempFolder folder;
  TransferOptions options =
      splat_scene(folder, seed, 20000);  // several blocks, one at a time below
  options.image.size = seed == 27 ? ImageSize{120, 100} : ImageSize{300, 260};
  options.splats.rays = seed == 27 ? 3 : 0;
  options.splats.look = seed == 21 ? Look::normal : Look::around;
  options.splats.views = seed == 24 ? 9 : 6;
  options.resources.threads = 1;
  const auto in_memory = test::make_memory_file_system();
  const auto expected = run(options, {.files = in_memory.get()});
  for (const unsigned threads : {1U, 5U}) {
    for (const std::uint64_t tile_cap : {std::uint64_t{1}, std::uint64_t{0}}) {
      options.resources.threads = threads;
      const job::TestKnobs knobs{.tile_cap_bytes = tile_cap,
                                 .most_ellipses = tile_cap == 1 ? 3000U : 0U};
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
        CHECK(run(options, knobs) == expected);  // its results are known
        std::filesystem::remove_all(folder.file("cache/v3/results"));
        CHECK(run(options, knobs) == expected);  // its stores alone
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
  other.channels.transferred = {Channel::base_color, Channel::emissive};
  refusal(other, ErrorKind::input, "no emissive");
  other = options;
  other.material.textures = {{Channel::base_color, "a.png"}};
  refusal(other, ErrorKind::usage, "--source-texture");
  other = options;
  other.source = folder.file("scene.spz");
  std::ofstream(other.source, std::ios::binary) << "NGSP" << std::string(28, '\4');
  refusal(other, ErrorKind::input, "versions 1 to 4 are supported");
  other = options;
  other.resources.memory_bytes = kMiB;
  refusal(other, ErrorKind::budget, "--memory");
}

namespace {

/// A square of opaque discs in the plane z = 0, all with the same harmonics, and a square target of
/// 16x16 texels in their middle, facing +z.
class Plane {
 public:
  Plane() {
    ply.columns = SplatPlyBuilder::usual_columns(45, false);
    for (int i = 0; i < 20 * 20; ++i) {
      auto row = SplatPlyBuilder::usual_row(0.1 * (i % 20) - 0.45);
      row["y"] = 0.1 * (i / 20) - 0.45;
      row["scale_0"] = row["scale_1"] = std::log(0.08);
      row["scale_2"] = -9;
      row["opacity"] = 6;
      ply.rows.push_back(row);
    }
    std::ofstream(folder.file("target.obj"))
        << "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
           "vn 0 0 1\nf 1/1/1 2/2/1 3/3/1 4/4/1\n";
    options.source = folder.file("scene.ply");
    options.targets = {folder.file("target.obj")};
    options.output = folder.file("out.png");
    options.image.size = ImageSize{16, 16};
    options.image.depth = Depth::u16;
    options.resources.threads = 1;
    options.resources.memory_bytes = 128 * kMiB;
    options.resources.use_cache = false;
  }

  /// The texel in the middle; `report` gets what was left out.
  std::array<double, 3> colour(Report* report = nullptr) {
    ply.write(options.source);
    const Report made = transfer(options);
    if (report != nullptr) *report = made;
    CHECK(made.target_empty == 0);
    const WholeImage out = read_whole_image(options.output);
    return {out.at(8 * 16 + 8, 0), out.at(8 * 16 + 8, 1), out.at(8 * 16 + 8, 2)};
  }

  TempFolder folder;
  SplatPlyBuilder ply;
  TransferOptions options;
};

}  // namespace

TEST_CASE("a plane of Gaussians shows the harmonics worked by hand", "[flow]") {
  // Seen from +z the direction is (0 0 -1). Of the functions that are not 0 there: degree 1 (the
  // second) is -0.4886025, degree 2 (the third) 0.6307831, degree 3 (the fourth) -0.7463527. Red
  // has the first with 0.25, green the second with 0.5, blue the third with -0.25, and each has
  // another that is 0 there. The file holds 15 of red, then of green, then of blue.
  Plane plane;
  for (auto& row : plane.ply.rows) {
    row["f_rest_1"] = 0.25;
    row["f_rest_0"] = 0.7;
    row["f_rest_20"] = 0.5;
    row["f_rest_18"] = 0.7;
    row["f_rest_41"] = -0.25;
    row["f_rest_39"] = 0.7;
  }
  const auto check = [&](SphericalHarmonics harmonics, std::array<double, 3> expected) {
    plane.options.splats.harmonics = harmonics;
    const auto found = plane.colour();
    CAPTURE(harmonics_name(harmonics));
    for (std::size_t c = 0; c < 3; ++c) CHECK(found[c] == Approx(expected[c]).margin(2e-5));
  };
  check(SphericalHarmonics::dc, {0.5, 0.5, 0.5});
  check(SphericalHarmonics::normal, {0.3778494, 0.8153916, 0.6865882});
  check(SphericalHarmonics::mean, {0.4185662, 0.5788479, 0.5});
  // Turned upside down the scene shows its other side: odd degrees change their sign.
  plane.options.source_use.axes = "x,-y,-z";
  for (auto& row : plane.ply.rows) row["y"] = -row["y"];
  check(SphericalHarmonics::normal, {0.6221506, 0.8153916, 0.3134118});
}

TEST_CASE("a transfer leaves out what the user does not want", "[flow]") {
  Plane plane;
  Report report;
  const std::size_t sheet = plane.ply.rows.size();
  const auto add = [&](double z, double sigma, double opacity) {
    auto row = SplatPlyBuilder::usual_row(0.5);
    row["y"] = 0.5;
    row["z"] = z;
    row["scale_0"] = row["scale_1"] = row["scale_2"] = std::log(sigma);
    row["opacity"] = opacity;
    row["f_dc_0"] = 1;
    plane.ply.rows.push_back(row);
  };
  add(0, 0.05, 0.0);   // alpha 0.5
  add(0, 0.05, 0.01);  // alpha 0.5025
  add(0, 3, 6);
  add(0, 3.1, 6);
  add(-9, 0.05, 6);
  plane.options.splats.filter.min_opacity = 0.501;
  plane.options.splats.filter.max_scale = 3.05;
  plane.options.splats.filter.box = AxisBox{{-2, -2, -2}, {2, 2, 2}};
  plane.colour(&report);
  CHECK(report.source_filtered ==
        std::map<std::string, std::uint64_t>{{"faint", 1}, {"outside_box", 1}, {"too_large", 1}});
  CHECK(report.source_gaussians == sheet + 2);
  plane.options.splats.filter.box.reset();
  plane.options.splats.near_target = Length{1, false};
  plane.colour(&report);
  CHECK(report.source_filtered.at("out_of_reach") == 1);  // the one at -9; the sheet ends near 1.45
}

TEST_CASE("where most of a scene is far from the target it is not sorted", "[flow]") {
  Plane plane;
  const std::size_t near = plane.ply.rows.size();
  for (std::size_t i = 0; i < 4 * near; ++i) {  // a landscape
    auto row = SplatPlyBuilder::usual_row(0.1 * static_cast<double>(i % 40) + 5);
    row["y"] = 0.1 * static_cast<double>(i / 40);
    plane.ply.rows.push_back(row);
  }
  Report report;
  // The landscape's balls make the scene a capture; the discs alone are a made one.
  plane.options.splats.look = Look::around;
  plane.options.resources.use_cache = true;
  plane.options.resources.cache_dir = plane.folder.file("cache");
  const auto colour = plane.colour(&report);
  CHECK(report.source_filtered.at("out_of_reach") >= 4 * near);
  const auto filtered = report.source_filtered;
  const std::uint64_t sorted = report.source_gaussians;
  plane.colour(&report);  // found again, and the same is said of it
  CHECK(report.source_filtered == filtered);
  CHECK(report.stages[1].cached);
  plane.options.splats.everywhere = true;
  CHECK(plane.colour(&report) == colour);
  CHECK(report.source_filtered.empty());
  CHECK(report.source_gaussians == 5 * near);
  // A third of the landscape: more than a quarter of the scene is near, and it is kept for others.
  plane.options.splats.everywhere = false;
  plane.ply.rows.resize(near + 4 * near / 3);
  plane.colour(&report);
  CHECK(report.source_filtered.empty());
  CHECK(sorted < near);
}

TEST_CASE("options of scenes are refused for meshes, and values that are none", "[flow]") {
  const TempFolder folder;
  TransferOptions mesh = make_random_scene(folder.path().string(), 5);
  mesh.output = folder.file("out.png");
  const auto refused = [&](TransferOptions asked, const std::string& part) {
    std::string message;
    CHECK(error_kind([&] { transfer(asked); }, &message) == exit_status(ErrorKind::usage));
    CAPTURE(message);
    CHECK(message.find(part) != std::string::npos);
  };
  TransferOptions asked = mesh;
  asked.splats.harmonics = SphericalHarmonics::dc;
  refused(asked, "--sh applies only to splat scenes");
  asked = mesh;
  asked.splats.near_target = Length{1, false};
  refused(asked, "--near-target applies only");
  asked = mesh;
  asked.splats.rays = 1;
  refused(asked, "--rays applies only");
  asked = mesh;
  asked.splats.alpha = true;
  refused(asked, "--alpha applies only");
  asked = splat_scene(folder, 3, 100);
  asked.splats.filter.box = AxisBox{{0, 0, 0}, {1, -1, 1}};
  refused(asked, "--box: got");
  asked.splats.filter.box.reset();
  asked.splats.filter.min_opacity = 0;
  refused(asked, "--min-opacity: got");
  asked.splats.filter.min_opacity.reset();
  asked.splats.filter.max_scale = -1.0;
  refused(asked, "--max-scale");
  asked.splats.filter.max_scale.reset();
  asked.splats.rays = 17;
  refused(asked, "expected a whole number from 0 to 16");
}

TEST_CASE("a splat scene without a size gives 1024 texels", "[flow]") {
  const TempFolder folder;
  TransferOptions options = splat_scene(folder, 3, 100);
  options.image.size.reset();
  options.channels.all = true;  // baseColor is all there is
  transfer(options);
  const WholeImage out = read_whole_image(options.output);
  CHECK(out.width == 1024);
  CHECK(out.height == 1024);
}

}  // namespace pounce::test
