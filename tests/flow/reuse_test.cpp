// SPDX-License-Identifier: Apache-2.0
//
// What the second transfer need not do again, and that its bytes are those of a first one.
#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <set>

#include "core/file.h"
#include "pounce/cache.h"
#include "pounce/transfer.h"
#include "support/bytes.h"
#include "support/random_scene.h"
#include "support/test_data.h"

namespace pounce::test {
namespace {

namespace fs = std::filesystem;

struct Scene {
  TempFolder folder;
  std::string cache = folder.file("cache");

  TransferOptions make(const std::string& name, std::uint32_t seed) {
    fs::create_directory(folder.file(name));
    TransferOptions options = make_random_scene(folder.file(name), seed);
    options.image.size = ImageSize{100, 70};
    options.channels.transferred = {Channel::base_color, Channel::metallic_roughness};
    options.resources.threads = 2;
    options.resources.memory_bytes = 256 << 20;
    return options;
  }

  /// Runs with and without the cache, checks that both give the same bytes, and hands out what the
  /// run with the cache did.
  Report run(TransferOptions options) {
    std::vector<std::vector<std::byte>> images[2];
    Report cached;
    for (const bool use_cache : {false, true}) {
      options.resources.use_cache = use_cache;
      options.resources.cache_dir = use_cache ? cache : "";
      const std::string out = folder.file(use_cache ? "with" : "without");
      fs::create_directory(out);
      options.output = out + "/<CHANNEL>.png";
      const Report report = transfer(options);
      REQUIRE(report.outputs.size() == 2);
      for (const std::string& path : report.outputs) {
        images[use_cache].push_back(read_whole(posix_file_system(), path));
      }
      if (use_cache) cached = report;
    }
    CHECK((images[0] == images[1]));
    return cached;
  }

  /// Keys of the objects whose label has this in it.
  std::set<std::string> objects(const std::string& made_from) const {
    std::set<std::string> keys;
    for (const CacheObject& object : cache_list(cache)) {
      if (object.label.find(made_from) != std::string::npos) keys.insert(object.key);
    }
    return keys;
  }
};

constexpr const char *kColour = " x u", *kSource = " as a source", *kTarget = " as a target";

bool stage_cached(const Report& report, const std::string& name) {
  const auto stage = std::find_if(report.stages.begin(), report.stages.end(),
                                  [&](const StageTime& s) { return s.name == name; });
  return stage != report.stages.end() && stage->cached;
}

TEST_CASE("a second target decodes no image and leaves the source alone", "[flow]") {
  Scene scene;
  TransferOptions options = scene.make("a", 3);
  const Report cold = scene.run(options);
  CHECK(cold.images_decoded >= 2);
  CHECK_FALSE(stage_cached(cold, "precondition"));
  CHECK_FALSE(stage_cached(cold, "decode"));
  const auto colours = scene.objects(kColour), sources = scene.objects(kSource),
             targets = scene.objects(kTarget);
  options.targets = scene.make("b", 4).targets;
  const Report warm = scene.run(options);
  CHECK(warm.images_decoded == 0);
  CHECK(stage_cached(warm, "precondition"));
  CHECK(stage_cached(warm, "decode"));
  CHECK_FALSE(stage_cached(warm, "vectorize"));
  CHECK((scene.objects(kColour) == colours));
  CHECK((scene.objects(kSource) == sources));
  CHECK(scene.objects(kTarget).size() == 2 * targets.size());
}

TEST_CASE("a second source onto the same target makes no maps anew", "[flow]") {
  Scene scene;
  TransferOptions options = scene.make("a", 3);
  scene.run(options);
  const auto colours = scene.objects(kColour), targets = scene.objects(kTarget);
  options.source = scene.make("b", 4).source;
  const Report second = scene.run(options);
  CHECK(stage_cached(second, "vectorize"));
  CHECK_FALSE(stage_cached(second, "precondition"));
  CHECK(second.images_decoded >= 2);
  CHECK(scene.objects(kColour).size() > colours.size());
  CHECK((scene.objects(kTarget) == targets));
}

TEST_CASE("repainting baseColor rebuilds its columns and nothing else", "[flow]") {
  Scene scene;
  TransferOptions options = scene.make("a", 5);
  scene.run(options);
  const auto without_skin = scene.objects(kColour).size();
  const std::string first = scene.folder.file("first.png"), skin = scene.folder.file("skin.png");
  fs::copy_file(scene.folder.file("with/baseColor.png"), first);
  fs::copy_file(scene.folder.file("with/metallicRoughness.png"), skin);
  REQUIRE((read_whole(posix_file_system(), first) != read_whole(posix_file_system(), skin)));
  options.material.textures = {{Channel::base_color, skin}};
  scene.run(options);
  const auto with_skin = scene.objects(kColour).size();
  const auto columns = with_skin - without_skin;  // one per wrap mode in use
  REQUIRE(columns >= 1);
  const auto sources = scene.objects(kSource), targets = scene.objects(kTarget);
  // The skin is repainted: another picture of the same size.
  fs::copy_file(first, skin, fs::copy_options::overwrite_existing);
  const Report repainted = scene.run(options);
  CHECK(repainted.images_decoded == columns);
  CHECK(scene.objects(kColour).size() == with_skin + columns);
  CHECK((scene.objects(kSource) == sources));
  CHECK((scene.objects(kTarget) == targets));
  CHECK(stage_cached(repainted, "vectorize"));
}

TEST_CASE("a limit that holds less than the job costs work, not the result", "[flow]") {
  Scene scene;
  TransferOptions options = scene.make("a", 6);
  scene.run(options);
  const std::uint64_t whole = cache_info(scene.cache).taken_bytes;
  cache_clear(scene.cache);
  options.resources.cache_limit_bytes = whole / 2;
  const Report half = scene.run(options);
  CHECK(cache_info(scene.cache).taken_bytes <= whole / 2);
  CHECK(std::count_if(half.warnings.begin(), half.warnings.end(), [](const std::string& w) {
          return w.find("--cache-limit") != std::string::npos;
        }) == 1);
  scene.run(options);
  CHECK(cache_info(scene.cache).taken_bytes <= whole / 2);
}

}  // namespace
}  // namespace pounce::test
