// SPDX-License-Identifier: Apache-2.0
//
// Texture sets: each tile of the target is what a transfer of that tile alone gives, and each tile
// of the source is sampled as its own clamped image.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <random>

#include "mesh/uv_tiles.h"
#include "pounce/transfer.h"
#include "support/bytes.h"
#include "support/many_threads.h"
#include "support/mesh_files.h"
#include "support/test_data.h"
#include "support/whole_image.h"

namespace pounce::test {
namespace {

constexpr std::int32_t kColumns = 3, kRows = 2;  // of tiles: 1001-1003 and 1011-1013

/// A wavy sheet over [0, 3] x [0, 2] whose UVs are its plan, so that it fills six tiles. `step`
/// cells per tile: 0 = two triangles over all tiles.
mesh::Mesh sheet(int step, double height = 0) {
  mesh::Mesh mesh;
  const int across = step == 0 ? 1 : kColumns * step, up = step == 0 ? 1 : kRows * step;
  mesh.uv_sets.emplace_back();
  for (int j = 0; j <= up; ++j) {
    for (int i = 0; i <= across; ++i) {
      const double u = kColumns * static_cast<double>(i) / across;
      const double v = kRows * static_cast<double>(j) / up;
      const double z = step == 0 ? height : height + 0.01 * std::sin(3 * u) * std::cos(2 * v);
      mesh.positions.push_back(
          {static_cast<float>(u), static_cast<float>(v), static_cast<float>(z)});
      mesh.normals.push_back({0, 0, 1});
      mesh.uv_sets[0].push_back({static_cast<float>(u), static_cast<float>(1 - v)});
    }
  }
  mesh.uv_present.emplace_back();
  const auto at = [&](int i, int j) { return static_cast<std::uint32_t>(j * (across + 1) + i); };
  for (int j = 0; j < up; ++j) {
    for (int i = 0; i < across; ++i) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  return mesh;
}

/// Only the triangles of one tile, moved into the unit square.
mesh::Mesh only(mesh::Mesh mesh, mesh::UvTile tile) {
  std::vector<std::array<std::uint32_t, 3>> kept;
  for (const auto& t : mesh.triangles) {
    double u = 0, v = 0;
    for (const std::uint32_t corner : t) {
      u += static_cast<double>(mesh.uv_sets[0][corner].x) / 3;
      v += static_cast<double>(mesh.uv_sets[0][corner].y) / 3;
    }
    if (std::floor(u) == tile.column && std::floor(v) == mesh::period_y(tile)) kept.push_back(t);
  }
  mesh.triangles = kept;
  for (Vec2f& uv : mesh.uv_sets[0]) {
    uv.x -= static_cast<float>(tile.column);
    uv.y -= static_cast<float>(mesh::period_y(tile));
  }
  return mesh;
}

WholeImage noise(std::uint32_t width, std::uint32_t height, std::uint32_t seed) {
  std::mt19937 random(seed);
  WholeImage image{width, height, 3, false, {}};
  for (std::size_t i = 0; i < std::size_t{width} * height * 3; ++i)
    image.samples.push_back(static_cast<double>(random() % 256) / 255);
  return image;
}

std::vector<mesh::UvTile> all_tiles() {
  std::vector<mesh::UvTile> tiles;
  for (std::int32_t row = 0; row < kRows; ++row) {
    for (std::int32_t column = 0; column < kColumns; ++column) tiles.push_back({column, row});
  }
  return tiles;
}

std::string number(mesh::UvTile tile) { return std::to_string(*mesh::udim_number(tile)); }

using Bytes = std::vector<std::byte>;

Bytes content(const std::string& path) { return read_whole(posix_file_system(), path); }

/// One image over the source's unit square, projected on a sheet of six tiles.
struct Scene {
  TempFolder folder;
  TransferOptions options;

  explicit Scene(const mesh::Mesh& target) {
    write_whole_image(folder.file("skin.png"), noise(300, 200, 5));
    mesh::Mesh source = sheet(7, 0.02);
    for (Vec2f& uv : source.uv_sets[0]) uv = {uv.x / kColumns, 1 - (1 - uv.y) / kRows};
    write_glb(folder.file("source.glb"), source);
    write_glb(folder.file("target.glb"), target);
    options.source = folder.file("source.glb");
    options.targets = {folder.file("target.glb")};
    options.material.textures = {{Channel::base_color, folder.file("skin.png")}};
    options.output = folder.file("out.<UDIM>.png");
    options.image.size = ImageSize{100, 70};
    options.search.max_distance = Length{0.2, false};
    options.resources.use_cache = false;
    options.resources.memory_bytes = 256 << 20;
  }
};

}  // namespace

TEST_CASE("a tile holds what a mesh of that tile alone would get", "[flow]") {
  const mesh::Mesh target = sheet(4);  // quarters: moving them rounds nothing
  Scene scene(target);
  const Report report = transfer(scene.options);
  CHECK(report.udims == std::vector<int>{1001, 1002, 1003, 1011, 1012, 1013});
  CHECK(report.outputs.size() == 6);
  CHECK(report.target_texels == 6 * 100 * 70);
  CHECK(report.target_covered == report.target_texels);
  CHECK(report.target_overlapping == 0);
  for (const mesh::UvTile tile : all_tiles()) {
    write_glb(scene.folder.file("alone.glb"), only(target, tile));
    TransferOptions alone = scene.options;
    alone.targets = {scene.folder.file("alone.glb")};
    alone.output = scene.folder.file("alone.png");
    transfer(alone);
    CAPTURE(number(tile));
    // Not the files: each names the job that made it.
    const WholeImage cut = read_whole_image(scene.folder.file("out." + number(tile) + ".png"));
    CHECK((read_whole_image(alone.output).samples == cut.samples));
  }
}

TEST_CASE("two triangles over six tiles are one picture cut in six", "[flow]") {
  Scene scene(sheet(0));
  transfer(scene.options);
  TransferOptions one = scene.options;
  mesh::Mesh small = sheet(0);
  for (Vec2f& uv : small.uv_sets[0]) uv = {uv.x / kColumns, 1 - (1 - uv.y) / kRows};
  write_glb(scene.folder.file("small.glb"), small);
  one.targets = {scene.folder.file("small.glb")};
  one.output = scene.folder.file("one.png");
  one.image.size = ImageSize{kColumns * 100, kRows * 70};
  transfer(one);
  const WholeImage whole = read_whole_image(one.output);
  for (const mesh::UvTile tile : all_tiles()) {
    const WholeImage part = read_whole_image(scene.folder.file("out." + number(tile) + ".png"));
    double largest = 0;
    for (std::uint32_t y = 0; y < 70; ++y) {
      for (std::uint32_t x = 0; x < 100; ++x) {
        const std::size_t there =
            (static_cast<std::size_t>(kRows - 1 - tile.row) * 70 + y) * whole.width +
            static_cast<std::size_t>(tile.column) * 100 + x;
        for (std::size_t c = 0; c < 3; ++c)
          largest = std::max(largest, std::abs(part.at(y * 100 + x, c) - whole.at(there, c)));
      }
    }
    CAPTURE(number(tile));
    CHECK(largest <= 1.01 / 255);
  }
}

TEST_CASE("a choice of tiles, threads and budgets changes no byte of a tile", "[flow]") {
  Scene scene(sheet(0));
  transfer(scene.options);
  std::map<std::string, Bytes> expected;
  for (const mesh::UvTile tile : all_tiles())
    expected[number(tile)] = content(scene.folder.file("out." + number(tile) + ".png"));
  TransferOptions some = scene.options;
  some.output = scene.folder.file("some.<UVTILE>.png");
  some.image.tiles = {1003, 1012, 1999};
  for (const unsigned threads : {1U, 3U}) {
    some.resources.threads = threads;
    some.resources.memory_bytes = std::uint64_t{1} << 30;
    const std::uint64_t least = plan(some).least_memory_bytes;
    for (const std::uint64_t memory : {least, std::uint64_t{1} << 30}) {
      some.resources.memory_bytes = memory;
      const Report report = transfer(some);
      CHECK(report.udims == std::vector<int>{1003, 1012});
      REQUIRE(report.warnings.size() == 1);
      CHECK(report.warnings[0].find("1999") != std::string::npos);
      CHECK((content(scene.folder.file("some.u3_v1.png")) == expected.at("1003")));
      CHECK((content(scene.folder.file("some.u2_v2.png")) == expected.at("1012")));
      CHECK_FALSE(std::filesystem::exists(scene.folder.file("some.u1_v1.png")));
    }
  }
  some.image.tiles = {1004, 1005};
  std::string message;
  CHECK(error_kind([&] { transfer(some); }, &message) == exit_status(ErrorKind::input));
  CHECK(message.find("1001-1003, 1011-1013") != std::string::npos);
  some.output = scene.folder.file("one.png");
  CHECK(error_kind([&] { transfer(some); }, &message) == exit_status(ErrorKind::usage));
}

TEST_CASE("tiles of a source may differ in size; each is clamped at its border", "[flow]") {
  Scene scene(sheet(0));
  write_glb(scene.folder.file("source.glb"), sheet(4));
  std::map<mesh::UvTile, WholeImage> images;
  const ImageSize sizes[] = {{64, 64}, {17, 40}, {64, 32}, {100, 70}, {33, 64}, {1, 1}};
  for (std::size_t i = 0; i < all_tiles().size(); ++i) {
    const mesh::UvTile tile = all_tiles()[i];
    images[tile] = noise(sizes[i].width, sizes[i].height, static_cast<std::uint32_t>(i + 1));
    write_whole_image(scene.folder.file("skin." + mesh::uvtile_name(tile) + ".png"), images[tile]);
  }
  scene.options.material.textures = {{Channel::base_color, scene.folder.file("skin.<UVTILE>.png")}};
  scene.options.mesh.filter = Filter::tent;  // what is looked up below
  const Report report = transfer(scene.options);
  CHECK(report.target_covered == report.target_texels);
  for (const auto& [tile, image] : images) {
    const WholeImage out = read_whole_image(scene.folder.file("out." + number(tile) + ".png"));
    double largest = 0;
    for (std::uint32_t y = 0; y < 70; ++y) {
      for (std::uint32_t x = 0; x < 100; ++x) {
        // The sheets are the same plan: the texel's place in the tile is its place in the image.
        const double tx = (x + 0.5) / 100 * image.width - 0.5;
        const double ty = (y + 0.5) / 70 * image.height - 0.5;
        const double left = std::floor(tx), top = std::floor(ty);
        for (std::size_t c = 0; c < 3; ++c) {
          const auto fetch = [&, width = image.width, height = image.height](double i, double j) {
            const auto px = static_cast<std::size_t>(std::clamp(i, 0.0, width - 1.0));
            const auto py = static_cast<std::size_t>(std::clamp(j, 0.0, height - 1.0));
            return images.at(tile).at(py * width + px, c);
          };
          const double u = tx - left, v = ty - top;
          const double expected =
              (1 - v) * ((1 - u) * fetch(left, top) + u * fetch(left + 1, top)) +
              v * ((1 - u) * fetch(left, top + 1) + u * fetch(left + 1, top + 1));
          largest = std::max(largest, std::abs(out.at(y * 100 + x, c) - expected));
        }
      }
    }
    CAPTURE(number(tile));
    CHECK(largest <= 0.6 / 255);
  }
}

TEST_CASE("a tile without an image is named and stays empty", "[flow]") {
  Scene scene(sheet(0));
  write_glb(scene.folder.file("source.glb"), sheet(4));
  scene.options.material.textures = {{Channel::base_color, scene.folder.file("skin.<UDIM>.png")}};
  scene.options.image.coverage_output = scene.folder.file("mask.<UDIM>.png");
  std::string message;
  CHECK(error_kind([&] { transfer(scene.options); }, &message) == exit_status(ErrorKind::storage));
  CHECK(message.find("1001-1003, 1011-1013") != std::string::npos);
  for (const char* udim : {"1002", "1011"})
    write_whole_image(scene.folder.file(std::string("skin.") + udim + ".png"), noise(50, 50, 1));
  const Report report = transfer(scene.options);
  CHECK(report.udims == std::vector<int>{1002, 1011});
  CHECK(report.target_empty == 4 * 100 * 70);
  REQUIRE(report.warnings.size() == 3);
  CHECK(report.warnings[2].find("only 33.33 % of its texels") != std::string::npos);
  CHECK(report.warnings[0].find("no image for UDIM 1001, 1003, 1012, 1013") != std::string::npos);
  CHECK(report.warnings[1].find("UDIM 1001, 1003, 1012, 1013") != std::string::npos);
  CHECK_FALSE(std::filesystem::exists(scene.folder.file("out.1001.png")));
  CHECK(std::filesystem::exists(scene.folder.file("mask.1011.png")));
}

TEST_CASE("UVs that leave the grid of UDIMs are counted and not written", "[flow]") {
  mesh::Mesh target = sheet(5);
  for (Vec2f& uv : target.uv_sets[0]) uv.x -= 1;  // the first column has no number now
  Scene scene(target);
  const Report report = transfer(scene.options);
  CHECK(report.udims == std::vector<int>{1001, 1002, 1011, 1012});
  REQUIRE(report.warnings.size() == 1);
  CHECK(report.warnings[0].find("100 triangles") != std::string::npos);
}

TEST_CASE("several targets share one source and get the bytes of a run of their own", "[flow]") {
  Scene scene(sheet(5));
  write_glb(scene.folder.file("other.glb"), sheet(0));
  scene.options.targets.push_back(scene.folder.file("other.glb"));
  std::string message;
  CHECK(error_kind([&] { transfer(scene.options); }, &message) == exit_status(ErrorKind::usage));
  CHECK(message.find("<TARGET>") != std::string::npos);
  scene.options.output = scene.folder.file("<TARGET>.<UDIM>.png");
  const Report both = transfer(scene.options);
  CHECK(both.images_decoded == 1);
  CHECK(both.outputs.size() == 12);
  CHECK(both.target_texels == 2 * 6 * 100 * 70);
  for (const char* name : {"target", "other"}) {
    TransferOptions one = scene.options;
    one.targets = {scene.folder.file(std::string(name) + ".glb")};
    one.output = scene.folder.file("one.<UDIM>.png");
    transfer(one);
    for (const mesh::UvTile tile : all_tiles()) {
      CHECK((content(scene.folder.file("one." + number(tile) + ".png")) ==
             content(scene.folder.file(std::string(name) + "." + number(tile) + ".png"))));
    }
  }
}

}  // namespace pounce::test
