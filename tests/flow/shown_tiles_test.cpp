// SPDX-License-Identifier: Apache-2.0
//
// Of an image only the tiles that the mesh shows are kept. Nobody sees that in the result: with the
// least memory all of it is kept, and the bytes are the same.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <random>
#include <string_view>

#include "io/image/write.h"
#include "pounce/transfer.h"
#include "support/bytes.h"
#include "support/mesh_files.h"
#include "support/test_data.h"
#include "support/whole_image.h"

namespace pounce::test {
namespace {

constexpr int kCells = 24;

/// A wavy sheet over the unit square; its UVs are `at` + `size` * plan, across to the power of
/// `bend`: of a high one, most of the sheet has little of the image.
mesh::Mesh sheet(Vec2f at, float size, float bend = 1) {
  mesh::Mesh mesh;
  mesh.uv_sets.emplace_back();
  mesh.uv_present.emplace_back();
  for (int j = 0; j <= kCells; ++j) {
    for (int i = 0; i <= kCells; ++i) {
      const float u = static_cast<float>(i) / kCells, v = static_cast<float>(j) / kCells;
      mesh.positions.push_back({u, v, 0.05F * std::sin(5 * u) * std::cos(4 * v)});
      mesh.normals.push_back({0, 0, 1});
      const float across = std::pow(u, bend);
      mesh.uv_sets[0].push_back({at.x + size * across, at.y + size * v});
    }
  }
  const auto point = [](int i, int j) { return static_cast<std::uint32_t>(j * (kCells + 1) + i); };
  for (int j = 0; j < kCells; ++j) {
    for (int i = 0; i < kCells; ++i) {
      mesh.triangles.push_back({point(i, j), point(i + 1, j), point(i + 1, j + 1)});
      mesh.triangles.push_back({point(i, j), point(i + 1, j + 1), point(i, j + 1)});
    }
  }
  return mesh;
}

struct Scene {
  TempFolder folder;
  TransferOptions options;

  Scene(const mesh::Mesh& source, const mesh::Mesh& target, std::uint32_t size, bool deep = false) {
    std::mt19937 random(3);
    io::ImageWriter writer(folder.file("skin.png"),
                           {900, 700, 3, deep ? Depth::u16 : Depth::u8, false, false});
    std::vector<std::byte> samples(std::size_t{900} * 700 * 3 * (deep ? 2 : 1));
    for (std::byte& byte : samples) byte = static_cast<std::byte>(random() % 256);
    writer.write_rows(700, samples.data());
    writer.commit();
    write_glb(folder.file("source.glb"), source);
    write_glb(folder.file("target.glb"), target);
    options.source = folder.file("source.glb");
    options.targets = {folder.file("target.glb")};
    options.material.textures = {{Channel::base_color, folder.file("skin.png")}};
    options.output = folder.file("out.png");
    options.image.size = ImageSize{size, size};
    options.resources.use_cache = false;
    options.resources.memory_bytes = 1ULL << 30;
  }

  struct Made {
    std::vector<std::byte> bytes;
    Report report;
  };
  Made run() const {
    const Report report = transfer(options);
    REQUIRE(report.target_covered > 1000);
    return {read_whole(posix_file_system(), options.output), report};
  }
  Made run_whole() {
    const auto had = options.resources.memory_bytes;
    options.resources.memory_bytes = plan(options).least_memory_bytes;
    const Made made = run();
    options.resources.memory_bytes = had;
    return made;
  }
};

}  // namespace

TEST_CASE("tiles that no triangle shows are not stored, and nothing changes") {
  const Vec2f at = GENERATE(Vec2f{0.4F, 0.3F}, Vec2f{0.02F, 0.01F},
                            Vec2f{-0.1F, 0.5F},  // over the left border, which repeats
                            Vec2f{0.5F, 1.9F});  // over the lower one, two images down
  const unsigned threads = GENERATE(1U, 2U);
  CAPTURE(at.x, at.y, threads);
  Scene scene(sheet(at, 0.2F), sheet({0.01F, 0.01F}, 0.98F), 200);
  scene.options.resources.threads = threads;
  const auto some = scene.run();
  CHECK(some.report.images_decoded == 1);
  const auto whole = scene.run_whole();
  CHECK((some.bytes == whole.bytes));
  CHECK(2 * some.report.source_store_bytes < whole.report.source_store_bytes);
}

TEST_CASE("an image is made whole where levels of it, or tiles beyond, are asked for") {
  const unsigned threads = GENERATE(1U, 3U);
  Scene scene(sheet({0.3F, 0.3F}, 0.25F), sheet({0.01F, 0.01F}, 0.98F, 4), 220);
  scene.options.resources.threads = threads;
  const auto some = scene.run();
  CHECK(some.report.images_decoded == 2);  // once for the tiles, once for all of it
  const auto whole = scene.run_whole();
  CHECK(whole.report.images_decoded == 1);
  CHECK((some.bytes == whole.bytes));
  // In the cache they are two packs; the second run reads no image.
  scene.options.resources.use_cache = true;
  scene.options.resources.cache_dir = scene.folder.file("cache");
  CHECK((scene.run().bytes == whole.bytes));
  const auto warm = scene.run();
  CHECK(warm.report.images_decoded == 0);
  CHECK((warm.bytes == whole.bytes));
}

TEST_CASE("targets that see the source from afar keep all of its images") {
  Scene scene(sheet({0.3F, 0.3F}, 0.3F), sheet({0.01F, 0.01F}, 0.98F), 40);
  scene.options.resources.threads = 1;
  CHECK(scene.run().report.images_decoded == 1);
}

TEST_CASE("of an image that is seen from afar a level is stored, and nothing changes") {
  const bool deep = GENERATE(false, true);
  const unsigned threads = GENERATE(1U, 3U);
  CAPTURE(deep, threads);
  const mesh::Mesh sheet_in_all = sheet({-0.2F, 0.03F}, 0.97F);  // over the left border
  Scene scene(sheet_in_all, sheet({0.01F, 0.01F}, 0.98F), 40, deep);
  scene.options.resources.threads = threads;
  const auto level = scene.run();
  CHECK(level.report.images_decoded == 1);
  const auto whole = scene.run_whole();
  CHECK(whole.report.images_decoded == 1);
  CHECK((level.bytes == whole.bytes));
  CHECK(2 * level.report.source_store_bytes < whole.report.source_store_bytes);
  // The level is in the cache, too.
  scene.options.resources.use_cache = true;
  scene.options.resources.cache_dir = scene.folder.file("cache");
  CHECK((scene.run().bytes == whole.bytes));
  scene.options.image.padding_px = 3;  // another image, or it would be there already
  const auto warm = scene.run();
  CHECK(warm.report.images_decoded == 0);
}

TEST_CASE("where a target sees an image closer than on average, all of it is made") {
  const unsigned threads = GENERATE(1U, 3U);
  // At its right border the target has seven times as many texels across as elsewhere.
  Scene scene(sheet({0.01F, 0.01F}, 0.98F), sheet({0.01F, 0.01F}, 0.98F, 8), 64);
  scene.options.resources.threads = threads;
  const auto level = scene.run();
  CHECK(level.report.images_decoded == 2);
  const auto whole = scene.run_whole();
  CHECK(whole.report.images_decoded == 1);
  CHECK((level.bytes == whole.bytes));
}

TEST_CASE("rows after the last that is shown are not decoded") {
  Scene scene(sheet({0.4F, 0.3F}, 0.2F), sheet({0.01F, 0.01F}, 0.98F), 200);
  const auto whole = scene.run();
  // Some of what the last rows are compressed to is overwritten.
  const std::string skin = scene.folder.file("skin.png");
  const auto bytes = read_whole(posix_file_system(), skin);
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const std::size_t data = text.rfind("IDAT", text.size() - 100000) + 4;
  REQUIRE(data < text.size());
  {
    std::fstream file(skin, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(data));
    file.write(std::string(20, 'x').data(), 20);
  }
  const auto damaged = scene.run();
  CHECK(whole.report.target_covered == damaged.report.target_covered);
  scene.options.resources.memory_bytes = plan(scene.options).least_memory_bytes;
  CHECK_THROWS_AS(transfer(scene.options), Error);
}

TEST_CASE("an image that changes after it was planned for is refused") {
  // Stored as a level, in part and whole.
  const auto [at, size, target] = GENERATE(table<Vec2f, float, std::uint32_t>(
      {{{0.01F, 0.01F}, 0.98F, 40}, {{0.4F, 0.3F}, 0.2F, 200}, {{0.01F, 0.01F}, 0.98F, 400}}));
  const std::uint32_t width = GENERATE(450, 1800);
  Scene scene(sheet(at, size), sheet({0.01F, 0.01F}, 0.98F), target);
  Progress progress;
  bool replaced = false;
  progress.on_event = [&](const ProgressEvent& event) {
    if (replaced || !event.stage.starts_with("source colours")) return;
    replaced = true;
    write_whole_image(
        scene.folder.file("skin.png"),
        {width, 700, 3, false, std::vector<double>(std::size_t{width} * 700 * 3, 0.5)});
  };
  std::string message;
  CHECK(error_kind([&] { transfer(scene.options, &progress); }, &message) ==
        exit_status(ErrorKind::input));
  CHECK(replaced);
  CHECK(message.find("skin.png") != std::string::npos);
}

TEST_CASE("an image that cannot be read ends those that are read beside it") {
  Scene scene(sheet({0.01F, 0.01F}, 0.98F), sheet({0.01F, 0.01F}, 0.98F), 100);
  const std::string rough = scene.folder.file("rough.png");
  WholeImage image{64, 64, 1, false, std::vector<double>(std::size_t{64} * 64, 0.5)};
  write_whole_image(rough, image);
  {
    std::fstream file(rough, std::ios::in | std::ios::out | std::ios::binary);
    const auto bytes = read_whole(posix_file_system(), rough);
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    file.seekp(static_cast<std::streamoff>(text.find("IDAT") + 4));
    file.write(std::string(4, 'x').data(), 4);
  }
  scene.options.material.textures.push_back({Channel::occlusion, rough});
  scene.options.output = scene.folder.file("out.<CHANNEL>.png");
  scene.options.resources.threads = 3;
  // The other image is stopped at another row each time, before its first one included.
  for (int run = 0; run < 60; ++run) {
    std::string message;
    CHECK(error_kind([&] { transfer(scene.options); }, &message) == exit_status(ErrorKind::input));
    CHECK(message.find("rough.png") != std::string::npos);
  }
}

}  // namespace pounce::test
