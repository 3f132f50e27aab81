// SPDX-License-Identifier: Apache-2.0
#include "pounce/gaussians.h"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "io/image/write.h"
#include "io/splats/scene.h"
#include "support/many_threads.h"
#include "support/random_scene.h"
#include "support/splat_encoders.h"
#include "support/test_data.h"

namespace pounce::test {
namespace {

constexpr std::uint64_t kMiB = 1 << 20;

std::string read_all(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

using Row = std::array<float, 17>;

std::vector<Row> rows_of(const std::string& path) {
  const std::string bytes = read_all(path);
  const std::size_t at = bytes.find("element vertex "), end = bytes.find("end_header\n");
  REQUIRE(end != std::string::npos);
  std::vector<Row> rows(std::stoull(bytes.substr(at + 15)));
  REQUIRE(bytes.size() - end - 11 == rows.size() * sizeof(Row));
  std::memcpy(rows.data(), bytes.data() + end + 11, rows.size() * sizeof(Row));
  return rows;
}

void write_png(const std::string& path, std::uint32_t width, std::uint32_t height,
               std::uint32_t channels, const std::vector<std::uint8_t>& samples) {
  io::ImageWriter writer(path, {width, height, channels, Depth::u8, false, channels == 4});
  writer.write_rows(height, reinterpret_cast<const std::byte*>(samples.data()));
  writer.commit();
}

void write_text(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

/// A square 8 wide and 4 high at z = 2, image row 0 on top, facing +z.
void write_quad(const TempFolder& folder, const std::string& uvs) {
  write_text(folder.file("quad.mtl"), "newmtl skin\nmap_Kd skin.png\n");
  write_text(folder.file("quad.obj"),
             "mtllib quad.mtl\nusemtl skin\nv 0 0 2\nv 8 0 2\nv 8 4 2\nv 0 4 2\n" + uvs +
                 "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n");
}
constexpr const char* kUnitUvs = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";

GaussiansOptions quad_options(const TempFolder& folder) {
  GaussiansOptions options;
  options.source = folder.file("quad.obj");
  options.output = folder.file("quad.ply");
  options.resources.use_cache = false;
  options.resources.memory_bytes = 64 * kMiB;
  return options;
}

ErrorKind kind_of(const GaussiansOptions& options) {
  try {
    gaussians(options);
  } catch (const Error& e) {
    return e.kind();
  }
  return ErrorKind::internal;
}

}  // namespace

TEST_CASE("a square of 4 x 4 texels becomes the rows worked out by hand", "[flow]") {
  const TempFolder folder;
  write_quad(folder, kUnitUvs);
  std::vector<std::uint8_t> samples;
  for (std::uint8_t t = 0; t < 16; ++t) {  // red counts texels, alpha is 0, 128 or 255
    samples.insert(samples.end(), {static_cast<std::uint8_t>(t * 17), 0, 255,
                                   t == 0   ? std::uint8_t{0}
                                   : t == 1 ? std::uint8_t{128}
                                            : std::uint8_t{255}});
  }
  write_png(folder.file("skin.png"), 4, 4, 4, samples);
  const Report report = gaussians(quad_options(folder));
  CHECK(report.source_gaussians == 16);
  CHECK(report.images_decoded == 1);
  CHECK(report.command == "gaussians");
  const std::vector<Row> rows = rows_of(folder.file("quad.ply"));
  REQUIRE(rows.size() == 16);
  std::array<int, 16> seen{};
  for (const Row& r : rows) {
    const int x = static_cast<int>(r[0] / 2), y = static_cast<int>(4 - r[1]);
    const int texel = 4 * y + x;
    ++seen.at(static_cast<std::size_t>(texel));
    CHECK(r[0] == Approx(1 + 2 * x));  // a texel is 2 x 1
    CHECK(r[1] == Approx(3.5 - y));
    CHECK(r[2] == 2);
    CHECK((r[3] == 0 && r[4] == 0 && r[5] == 1));
    const double c0 = 0.28209479177387814;
    CHECK(r[6] == Approx((texel / 15.0 - 0.5) / c0).epsilon(1e-6));
    CHECK(r[7] == Approx(-0.5 / c0));
    CHECK(r[8] == Approx(0.5 / c0));
    const double alpha = 128 / 255.0;
    CHECK(r[9] == Approx(texel == 0   ? -10
                         : texel == 1 ? std::log(alpha / (1 - alpha))
                                      : 10)
                      .margin(1e-6));
    CHECK(r[10] == Approx(std::log(0.5 * 2)).margin(1e-6));
    CHECK(r[11] == Approx(std::log(0.5 * 1)));
    CHECK(r[12] == Approx(std::log(0.5 * 1 * 0.01)));
    // The long axis is x already: no turn, or half a turn about z.
    CHECK(std::abs(r[13]) + std::abs(r[16]) == Approx(1));
    CHECK((r[14] == 0 && r[15] == 0));
  }
  for (const int n : seen) CHECK(n == 1);
}

TEST_CASE("a texture that repeats gives a Gaussian for each time", "[flow]") {
  const TempFolder folder;
  write_quad(folder, "vt -1 0\nvt 2 0\nvt 2 2\nvt -1 2\n");
  write_png(folder.file("skin.png"), 2, 2, 3, {10, 0, 0, 20, 0, 0, 30, 0, 0, 40, 0, 0});
  gaussians(quad_options(folder));
  const std::vector<Row> rows = rows_of(folder.file("quad.ply"));
  REQUIRE(rows.size() == 24);  // 6 x 4
  for (const Row& r : rows) {
    const int x = static_cast<int>(r[0] / (8.0F / 6)), y = static_cast<int>(4 - r[1]);
    const double red = 10 * (1 + x % 2 + 2 * (y % 2)) / 255.0;
    CHECK(r[6] == Approx((red - 0.5) / 0.28209479177387814).epsilon(1e-6));
    CHECK(r[9] == 10);  // no alpha: opaque
  }
}

TEST_CASE("a set of UDIM tiles gives the Gaussians of the tiles that are there", "[flow]") {
  const TempFolder folder;
  write_quad(folder, "vt 0 0\nvt 2 0\nvt 2 1\nvt 0 1\n");
  write_png(folder.file("skin.png"), 1, 1, 3, {0, 0, 0});
  write_png(folder.file("skin.1001.png"), 4, 4, 3, std::vector<std::uint8_t>(48, 255));
  GaussiansOptions options = quad_options(folder);
  options.source_textures = {{Channel::base_color, folder.file("skin.<UDIM>.png")}};
  const Report report = gaussians(options);
  const std::vector<Row> rows = rows_of(folder.file("quad.ply"));
  CHECK(rows.size() == 16);
  for (const Row& r : rows) CHECK(r[0] < 4);
  CHECK(report.source_filtered.at("in a UDIM tile without image") == 16);
  CHECK(report.warnings.size() == 1);
}

TEST_CASE("Gaussians are the same bytes at any threads, budget and cache state", "[flow]") {
  const std::uint32_t seed = GENERATE(1U, 2U, 3U, 4U);
  CAPTURE(seed);
  const TempFolder folder;
  const TransferOptions scene = make_random_scene(folder.path().string(), seed);
  GaussiansOptions options;
  options.source = scene.source;
  for (const SourceTexture& texture : scene.material.textures) {
    if (texture.channel == Channel::base_color) options.source_textures.push_back(texture);
  }
  options.output = folder.file("out.ply");
  options.resources.use_cache = false;
  options.resources.memory_bytes = 512 * kMiB;
  const Report report = gaussians(options);
  const std::string expected = read_all(options.output);
  CHECK(rows_of(options.output).size() == report.source_gaussians);
  const auto check_same = [&] {
    std::filesystem::remove(options.output);
    const Report again = gaussians(options);
    CHECK(again.leased_peak_bytes <= again.memory_budget_bytes);
    CHECK(read_all(options.output) == expected);
    return again;
  };
  for (const unsigned threads : {1U, 3U}) {
    options.resources.threads = threads;
    options.resources.memory_bytes = 512 * kMiB;
    options.resources.memory_bytes = check_same().least_memory_bytes;
    check_same();
    --options.resources.memory_bytes;
    CHECK(kind_of(options) == ErrorKind::budget);
  }
  options.resources.memory_bytes = 512 * kMiB;
  options.resources.use_cache = true;
  options.resources.cache_dir = folder.file("cache");
  CHECK(check_same().images_decoded > 0);
  CHECK(check_same().images_decoded == 0);
}

TEST_CASE("what cannot become Gaussians is refused and nothing is written", "[flow]") {
  const TempFolder folder;
  write_quad(folder, kUnitUvs);
  write_png(folder.file("skin.png"), 1, 1, 3, {0, 0, 0});
  GaussiansOptions options = quad_options(folder);
  options.output = folder.file("quad.stl");
  CHECK(kind_of(options) == ErrorKind::usage);
  write_text(folder.file("none"), "a file where a folder should be");
  options.output = folder.file("none/quad.ply");
  CHECK(kind_of(options) == ErrorKind::storage);
  options.output = folder.file("quad.ply");
  options.count = 5;  // of a mesh
  CHECK(kind_of(options) == ErrorKind::usage);
  options.count.reset();
  options.source = folder.file("flat.obj");
  write_text(folder.file("flat.obj"),
             "mtllib quad.mtl\nusemtl skin\nv 0 0 0\nv 1 1 1\nv 2 2 2\nvt 0 0\nvt 1 0\nvt 1 1\n"
             "f 1/1 2/2 3/3\n");
  CHECK(kind_of(options) == ErrorKind::input);
  options.source = folder.file("plain.obj");
  write_text(folder.file("plain.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  CHECK(kind_of(options) == ErrorKind::input);
  CHECK_FALSE(std::filesystem::exists(folder.file("quad.ply")));
}

TEST_CASE("sharpened colours are what the formula makes of texels of their chart", "[flow]") {
  const TempFolder folder;
  write_quad(folder, kUnitUvs);
  // 8 x 4 texels: a step from 100 to 140 between columns 3 and 4.
  std::vector<std::uint8_t> samples;
  for (int t = 0; t < 32; ++t) samples.insert(samples.end(), 3, t % 8 < 4 ? 100 : 140);
  write_png(folder.file("skin.png"), 8, 4, 3, samples);
  GaussiansOptions options = quad_options(folder);
  options.sigma_texels = 0.25;
  options.sharpen = 0.8;
  gaussians(options);
  for (const Row& r : rows_of(options.output)) {
    const int x = static_cast<int>(r[0]), y = static_cast<int>(4 - r[1]);
    double sum = 0, weights = 0;
    for (int j = std::max(0, y - 2); j <= std::min(3, y + 2); ++j) {
      for (int i = std::max(0, x - 2); i <= std::min(7, x + 2); ++i) {
        const double w = std::exp(-((i - x) * (i - x) + (j - y) * (j - y)) / (2 * 0.3625));
        sum += w * (i < 4 ? 100 : 140) / 255;
        weights += w;
      }
    }
    const double own = (x < 4 ? 100 : 140) / 255.0;
    const double expected = own + 0.8 * (own - sum / weights);
    CHECK(r[6] * 0.28209479177387814 + 0.5 == Approx(expected).margin(1e-6));
  }
  // The halves of the image belong to two squares that are far apart: each is even, and stays so.
  write_text(folder.file("quad.obj"),
             "mtllib quad.mtl\nusemtl skin\nv 0 0 2\nv 4 0 2\nv 4 4 2\nv 0 4 2\n"
             "v 0 0 20\nv 4 0 20\nv 4 4 20\nv 0 4 20\n"
             "vt 0 0\nvt 0.5 0\nvt 0.5 1\nvt 0 1\nvt 1 0\nvt 1 1\n"
             "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\nf 5/2 6/5 7/6\nf 5/2 7/6 8/3\n");
  gaussians(options);
  const std::vector<Row> rows = rows_of(options.output);
  CHECK(rows.size() == 32);
  for (const Row& r : rows) {
    const double own = (r[2] < 10 ? 100 : 140) / 255.0;
    CHECK(r[6] * 0.28209479177387814 + 0.5 == Approx(own).margin(1e-6));
  }
}

namespace {

/// A generated scene in a file, and what is to be made of it.
GaussiansOptions scene_options(const TempFolder& folder, std::size_t count) {
  GaussiansOptions options;
  options.source = folder.file("scene.ply");
  write_text(options.source, ply_bytes(random_scene(count, 7), false));
  options.output = folder.file("out.ply");
  options.resources.use_cache = false;
  options.resources.memory_bytes = 64 * kMiB;
  return options;
}

using SceneRow = std::array<float, 26>;
std::vector<SceneRow> scene_rows(const std::string& path) {
  const std::string bytes = read_all(path);
  const std::size_t at = bytes.find("element vertex "), end = bytes.find("end_header\n");
  REQUIRE(end != std::string::npos);
  std::vector<SceneRow> rows(std::stoull(bytes.substr(at + 15)));
  REQUIRE(bytes.size() - end - 11 == rows.size() * sizeof(SceneRow));
  std::memcpy(rows.data(), bytes.data() + end + 11, rows.size() * sizeof(SceneRow));
  return rows;
}

}  // namespace

TEST_CASE("a scene becomes a file with the same Gaussians and harmonics", "[flow]") {
  const TempFolder folder;
  GaussiansOptions options = scene_options(folder, 40000);
  const Scene scene = random_scene(40000, 7);
  const Report report = gaussians(options);
  CHECK(report.source_gaussians == 40000);
  const std::vector<SceneRow> rows = scene_rows(options.output);
  REQUIRE(rows.size() == scene.size());
  for (std::size_t i = 0; i < rows.size(); i += 97) {
    const SceneRow& r = rows[i];
    for (std::size_t k = 0; k < 3; ++k) {
      CHECK(r[k] == scene[i].mean[k]);
      CHECK(r[6 + k] == Approx(scene[i].dc[k]).margin(1e-6));
      CHECK(r[19 + k] == Approx(scene[i].log_sigma[k]).margin(1e-5));
      for (std::size_t c = 0; c < 3; ++c)
        CHECK(r[9 + 3 * c + k] == Approx(scene[i].rest[3 * k + c]).margin(5e-4));
    }
    CHECK(1 / (1 + std::exp(-r[18])) == Approx(scene[i].alpha).margin(1e-6));
  }
  // To glTF it is turned, and back again.
  options.output = folder.file("turned.glb");
  CHECK_THAT(gaussians(options).notes.front(), Catch::Contains("-x,-y,z"));
  options.source = options.output;
  options.output = folder.file("back.ply");
  gaussians(options);
  const std::vector<SceneRow> back = scene_rows(options.output);
  for (std::size_t i = 0; i < rows.size(); i += 97) {
    for (std::size_t k = 0; k < 3; ++k) CHECK(back[i][k] == rows[i][k]);
    for (std::size_t k = 9; k < 18; ++k) CHECK(back[i][k] == rows[i][k]);
  }
  options.axes = "x,y,z";
  gaussians(options);
  CHECK(scene_rows(options.output)[5][0] == -rows[5][0]);
}

TEST_CASE("--count keeps the most important, as a plain sort has them", "[flow]") {
  const TempFolder folder;
  const GaussiansOptions all = scene_options(folder, 40000);
  Scene scene = random_scene(40000, 7);
  // Many are equal: the first of them are kept.
  for (std::size_t i = 0; i < scene.size(); i += 3) {
    scene[i].log_sigma = {-3, -4, -5};
    scene[i].alpha = 0.5F;
  }
  write_text(all.source, ply_bytes(scene, false));
  store::SplatRows rows;
  store::SplatCounts ignored{};
  io::open_splat_scene(all.source, {})->read(0, 40000, rows, ignored);
  std::vector<std::pair<double, std::size_t>> order;
  for (std::size_t i = 0; i < rows.splats.size(); ++i) {
    const store::Splat& s = rows.splats[i];
    std::vector<double> sizes{s.sigma.x, s.sigma.y, s.sigma.z};
    std::sort(sizes.begin(), sizes.end());
    order.emplace_back(-static_cast<double>(s.alpha) * (sizes[1] * sizes[2]), i);
  }
  std::sort(order.begin(), order.end());
  std::size_t above = 0;  // those that are more important than the equal ones
  while (order[above].second % 3 != 0 || order[above + 1].first != order[above].first) ++above;
  for (const std::size_t count :
       {std::size_t{1}, above, above + 1, above + 7000, std::size_t{39999}}) {
    CAPTURE(count);
    std::vector<std::size_t> kept;
    for (std::size_t i = 0; i < count; ++i) kept.push_back(order[i].second);
    std::sort(kept.begin(), kept.end());
    GaussiansOptions options = all;
    options.count = count;
    std::string bytes;
    for (const unsigned threads : {1U, 3U}) {
      options.resources.threads = threads;
      const Report report = gaussians(options);
      CHECK(report.source_filtered.at("less_important") == 40000 - count);
      const std::vector<SceneRow> out = scene_rows(options.output);
      REQUIRE(out.size() == count);
      for (std::size_t i = 0; i < count; ++i) REQUIRE(out[i][0] == scene[kept[i]].mean[0]);
      if (threads > 1) CHECK(read_all(options.output) == bytes);
      bytes = read_all(options.output);
    }
  }
}

TEST_CASE("filters leave out what they say, and nothing at all is refused", "[flow]") {
  const TempFolder folder;
  GaussiansOptions options = scene_options(folder, 3000);
  Scene scene = random_scene(3000, 7);
  scene[5].mean[1] = std::nanf("");
  write_text(options.source, ply_bytes(scene, false));
  options.filter.box = AxisBox{{-3, -3, 0}, {0, 3, 3}};
  options.filter.min_opacity = 0.5;
  const auto wanted = [&](const SceneSplat& s) {
    return s.mean[0] <= 0 && s.mean[2] >= 0 && s.alpha >= 0.5F && !std::isnan(s.mean[1]);
  };
  const auto expected = static_cast<std::size_t>(std::count_if(scene.begin(), scene.end(), wanted));
  const Report report = gaussians(options);
  CHECK(report.source_filtered.at("not_finite") == 1);
  CHECK(scene_rows(options.output).size() == expected);
  // The box is meant in the scene's own axes, whatever the output's are.
  options.output = folder.file("out.glb");
  CHECK(gaussians(options).source_gaussians == expected);
  options.output = folder.file("out.ply");
  const std::string before = read_all(options.output);
  options.filter.box = AxisBox{{50, 50, 50}, {60, 60, 60}};
  CHECK(kind_of(options) == ErrorKind::input);
  CHECK(read_all(options.output) == before);
  options.sharpen = 1;
  CHECK(kind_of(options) == ErrorKind::usage);
}

TEST_CASE("memory does not grow with a scene, and no damaged scene replaces a file", "[flow]") {
  const std::string ending = GENERATE("ply", "spz", "glb");
  CAPTURE(ending);
  const TempFolder folder;
  std::uint64_t least = 0;
  for (const std::size_t count : {std::size_t{20000}, std::size_t{200000}}) {
    GaussiansOptions options = scene_options(folder, count);
    options.output = folder.file("out." + ending);
    options.count = count / 2;
    options.resources.threads = 1;
    options.resources.memory_bytes = gaussians(options).least_memory_bytes;
    if (least != 0) CHECK(options.resources.memory_bytes == least);
    least = options.resources.memory_bytes;
    const std::string expected = read_all(options.output);
    const Report report = gaussians(options);
    CHECK(report.leased_peak_bytes <= least);
    CHECK(read_all(options.output) == expected);
    --options.resources.memory_bytes;
    CHECK(kind_of(options) == ErrorKind::budget);
    ++options.resources.memory_bytes;
    std::filesystem::resize_file(options.source, std::filesystem::file_size(options.source) - 1);
    CHECK(kind_of(options) == ErrorKind::input);
    CHECK(read_all(options.output) == expected);
  }
}

}  // namespace pounce::test
