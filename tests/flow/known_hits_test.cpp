// SPDX-License-Identifier: Apache-2.0
//
// What was searched once is not searched again for another texture, channel or filter, and gives
// the bytes that a search gives.
#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <random>

#include "core/file.h"
#include "pounce/cache.h"
#include "pounce/transfer.h"
#include "support/bytes.h"
#include "support/many_threads.h"
#include "support/mesh_files.h"
#include "support/random_scene.h"
#include "support/sheet.h"
#include "support/test_data.h"

namespace pounce::test {
namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<std::byte>;

std::uint64_t runs_of(const Report& report, const std::string& node) {
  std::uint64_t runs = 0;
  for (const NodeReport& one : report.nodes) runs += one.name == node ? one.runs : 0;
  return runs;
}
bool searched(const Report& report) { return runs_of(report, "hit") > 0; }

struct Scene {
  TempFolder folder;
  std::string cache = folder.file("cache");
  TransferOptions options;
  bool tiles = false;  ///< an image for each UDIM tile of the target

  explicit Scene(std::uint32_t seed) {
    fs::create_directory(folder.file("scene"));
    options = make_random_scene(folder.file("scene"), seed);
    options.image.size = ImageSize{150, 130};
    options.resources.threads = 2;
    options.resources.memory_bytes = 256 << 20;
    options.channels.transferred = {Channel::base_color};
  }

  std::string paint(std::uint32_t seed, ImageSize size) const {
    std::string path = folder.file("paint" + std::to_string(seed) + ".png");
    write_whole_image(path, noise(size, seed));
    return path;
  }

  Report run(bool use_cache, Bytes& image) {
    TransferOptions job = options;
    job.resources.use_cache = use_cache;
    job.resources.cache_dir = use_cache ? cache : "";
    job.output = folder.file(use_cache ? "with" : "without") + (tiles ? ".<UDIM>.png" : ".png");
    Report report = transfer(job);
    for (const std::string& path : report.outputs) {
      const Bytes one = read_whole(posix_file_system(), path);
      image.insert(image.end(), one.begin(), one.end());
    }
    return report;
  }
  /// Through the cache; its bytes are those of a job without one.
  Report run() {
    Bytes with, without;
    run(false, without);
    Report report = run(true, with);
    CHECK((with == without));
    return report;
  }

  std::vector<std::string> hit_packs() const {
    std::vector<std::string> paths;
    for (const auto& entry : fs::recursive_directory_iterator(cache)) {
      const bool is_hits = entry.path().parent_path().filename() == "hits";
      if (is_hits && entry.path().extension() == ".pack") paths.push_back(entry.path());
    }
    return paths;
  }
};

}  // namespace

TEST_CASE("repaints, channels and filters need no second search", "[flow]") {
  const auto seed = GENERATE(1U, 2U, 3U, 4U);
  // Fine, and so coarse that most texels are averaged.
  const ImageSize output = GENERATE(ImageSize{150, 130}, ImageSize{21, 17});
  CAPTURE(seed, output.width);
  Scene scene(seed);
  scene.options.image.size = output;
  const ImageSize size{90 + seed, 64};
  scene.options.material.textures = {{Channel::base_color, scene.paint(100, size)}};
  CHECK(searched(scene.run()));
  CHECK(scene.hit_packs().size() == 1);
  for (std::uint32_t paint = 0; paint < 3; ++paint) {
    scene.options.material.textures = {{Channel::base_color, scene.paint(seed * 10 + paint, size)}};
    const Report again = scene.run();
    CHECK_FALSE(searched(again));
    CHECK(runs_of(again, "blend") > 0);
    CHECK(again.target_covered > 0);
  }
  scene.options.mesh.filter = Filter::tent;
  CHECK_FALSE(searched(scene.run()));
  CHECK(scene.hit_packs().size() == 1);
}

TEST_CASE("another channel of UDIM tiles needs no second search", "[flow]") {
  Scene scene(1);
  write_glb(scene.folder.file("source.glb"), wavy_sheet(6, 3));
  write_glb(scene.folder.file("target.glb"), wavy_sheet(7, 2));
  scene.options.source = scene.folder.file("source.glb");
  scene.options.targets = {scene.folder.file("target.glb")};
  for (int tile = 0; tile < 3; ++tile) {
    for (const char* name : {"skin", "gloss"}) {
      const auto seed = static_cast<std::uint32_t>(tile + (name[0] == 's' ? 0 : 10));
      write_whole_image(scene.folder.file(name + ("." + std::to_string(1001 + tile)) + ".png"),
                        noise({64, 80}, seed));
    }
  }
  scene.tiles = true;
  scene.options.material.textures = {{Channel::base_color, scene.folder.file("skin.<UDIM>.png")}};
  CHECK(searched(scene.run()));
  CHECK(scene.hit_packs().size() == 2);
  scene.options.channels.transferred = {Channel::occlusion};
  scene.options.material.textures = {{Channel::occlusion, scene.folder.file("gloss.<UDIM>.png")}};
  CHECK_FALSE(searched(scene.run()));
  CHECK(scene.hit_packs().size() == 2);
}

TEST_CASE("images of the materials' own are shaded from known hits, too", "[flow]") {
  const auto seed = GENERATE(5U, 6U, 7U, 8U);
  CAPTURE(seed);
  Scene scene(seed);
  const Report first = scene.run(), second = scene.run();
  CHECK(searched(first));
  CHECK_FALSE(searched(second));
  CHECK(second.target_covered == first.target_covered);
  CHECK((second.targets[0].distances == first.targets[0].distances));
  CHECK(second.targets[0].mean_distance == first.targets[0].mean_distance);
}

TEST_CASE("known hits give the same bytes with any threads and memory", "[flow]") {
  Scene scene(9);
  scene.options.image.size = ImageSize{300, 260};
  scene.run();
  for (const unsigned threads : {1U, 8U}) {
    for (const std::uint64_t mebibytes : {256, 1024}) {
      scene.options.resources.threads = threads;
      scene.options.resources.memory_bytes = mebibytes << 20;
      CAPTURE(threads, mebibytes);
      CHECK_FALSE(searched(scene.run()));
    }
  }
  // No room to spare: the search keeps its memory, and nothing is looked for.
  scene.options.resources.threads = 8;
  scene.options.resources.memory_bytes = 64 << 20;
  CHECK(searched(scene.run()));
}

TEST_CASE("what changes hits is searched again", "[flow]") {
  Scene scene(10);
  scene.run();
  SECTION("distance") { scene.options.search.max_distance = Length{0.5, false}; }
  SECTION("angle") { scene.options.search.max_angle_deg = 61; }
  SECTION("the output's size") { scene.options.image.size = ImageSize{151, 130}; }
  SECTION("the target") {
    fs::create_directory(scene.folder.file("other"));
    scene.options.targets = make_random_scene(scene.folder.file("other"), 11).targets;
  }
  SECTION("the size of an image") {
    scene.options.material.textures = {{Channel::base_color, scene.paint(1, {77, 33})}};
  }
  CHECK(searched(scene.run()));
  CHECK(scene.hit_packs().size() == 2);
}

TEST_CASE("damaged hits are searched again and never change the picture", "[flow]") {
  Scene scene(12);
  scene.run();
  const std::string pack = scene.hit_packs().at(0);
  std::ifstream in(pack, std::ios::binary);
  const std::string sound{std::istreambuf_iterator<char>(in), {}};
  REQUIRE(sound.size() > 1000);
  std::mt19937 random(7);
  int rebuilt = 0;
  for (int i = 0; i < 25; ++i) {
    std::string damaged = sound;
    const std::size_t at = random() % damaged.size();
    damaged[at] = static_cast<char>(damaged[at] ^ (1 << random() % 8));
    std::ofstream(pack, std::ios::binary | std::ios::trunc) << damaged;
    CAPTURE(at);
    rebuilt += searched(scene.run()) ? 1 : 0;
  }
  CHECK(rebuilt >= 20);  // zeros between chunks may go unread
  CHECK_FALSE(searched(scene.run()));
}

}  // namespace pounce::test
