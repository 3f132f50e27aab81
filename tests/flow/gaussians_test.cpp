// SPDX-License-Identifier: Apache-2.0
#include "pounce/gaussians.h"

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
#include "support/many_threads.h"
#include "support/random_scene.h"
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
  for (const SourceTexture& texture : scene.source_textures) {
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
  options.output = folder.file("quad.glb");
  CHECK(kind_of(options) == ErrorKind::usage);
  write_text(folder.file("none"), "a file where a folder should be");
  options.output = folder.file("none/quad.ply");
  CHECK(kind_of(options) == ErrorKind::storage);
  options.output = folder.file("quad.ply");
  options.source = folder.file("scene.ply");
  CHECK(kind_of(options) == ErrorKind::usage);
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

}  // namespace pounce::test
