// SPDX-License-Identifier: Apache-2.0
//
// What was blended from Gaussians once is not blended again for another kind of file or another
// gutter, and gives the bytes that blending gives.
#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <random>

#include "core/file.h"
#include "io/read_mesh.h"
#include "pounce/transfer.h"
#include "support/bytes.h"
#include "support/many_threads.h"
#include "support/mesh_files.h"
#include "support/pack_tree.h"
#include "support/random.h"
#include "support/random_scene.h"
#include "support/reference_splats.h"
#include "support/sheet.h"
#include "support/test_data.h"

namespace pounce::test {
namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<std::byte>;

bool projected(const Report& report) {
  return std::any_of(report.nodes.begin(), report.nodes.end(),
                     [](const NodeReport& node) { return node.name == "blend" && node.runs > 0; });
}

/// A target, and a Gaussian on each of its triangles.
struct Job {
  TempFolder folder;
  std::string cache = folder.file("cache");
  TransferOptions options;
  std::string ending = ".png";

  explicit Job(std::uint32_t seed) {
    options = make_random_scene(folder.path().string(), seed);
    options.channels.transferred.clear();
    options.channels.all = false;
    options.material.textures.clear();
    options.source = folder.file("scene.ply");
    options.image.size = ImageSize{150, 130};
    options.splats.look = Look::normal;
    options.splats.min_confidence = 0;
    options.resources.threads = 2;
    options.resources.memory_bytes = 256 << 20;
    strew(seed, 0.9);
  }

  void strew(std::uint32_t seed, double alpha) const {
    const mesh::Mesh target = io::read_mesh(options.targets.front());
    Random random(seed);
    std::vector<ReferenceSplat> scene;
    for (const auto& triangle : target.triangles) {
      const Vec3d a(target.positions[triangle[0]]), b(target.positions[triangle[1]]),
          c(target.positions[triangle[2]]);
      ReferenceSplat s;
      s.mean = (a + b + c) * (1.0 / 3);
      const double size = length(b - a) / 2;
      s.sigma = {size, size, size / 4};
      s.rotation = {1, 0, 0, 0};
      s.alpha = alpha;
      s.colour = {random.unit(), random.unit(), random.unit()};
      scene.push_back(s);
    }
    write_reference_splats(options.source, scene);
  }

  Report run(bool use_cache, std::vector<Bytes>& images) const {
    TransferOptions job = options;
    job.resources.use_cache = use_cache;
    job.resources.cache_dir = use_cache ? cache : "";
    job.output = folder.file((use_cache ? "with" : "without") + ending);
    job.image.coverage_output = folder.file((use_cache ? "seen" : "unseen") + std::string(".png"));
    Report report = transfer(job);
    for (const std::string& path : report.outputs)
      images.push_back(read_whole(posix_file_system(), path));
    return report;
  }
  /// Through the cache; its bytes are those of a job without one.
  Report run(bool may_warn = false) const {
    std::vector<Bytes> with, without;
    const Report alone = run(false, without);
    Report report = run(true, with);
    CHECK(with.size() == 2);
    CHECK((with == without));
    CHECK(report.target_covered > 0);
    CHECK(report.target_covered == alone.target_covered);
    CHECK((report.targets[0].distances == alone.targets[0].distances));
    if (!may_warn) CHECK(report.warnings == alone.warnings);
    return report;
  }

  std::vector<std::string> packs() const {
    std::vector<std::string> paths;
    for (const auto& entry : fs::directory_iterator(cache + "/v3/results")) {
      if (entry.path().extension() == ".pack") paths.push_back(entry.path());
    }
    return paths;
  }
};

}  // namespace

TEST_CASE("another file or gutter of the same scene needs no second projection", "[flow]") {
  const auto seed = GENERATE(1U, 2U, 3U);
  CAPTURE(seed);
  Job job(seed);
  CHECK(projected(job.run()));
  CHECK(job.packs().size() == 1);
  CHECK_FALSE(projected(job.run()));
  job.options.image.padding_px = 3;
  CHECK_FALSE(projected(job.run()));
  job.ending = ".tif";
  CHECK_FALSE(projected(job.run()));
  for (const unsigned threads : {1U, 8U}) {
    for (const std::uint64_t mebibytes : {256, 1024}) {
      job.options.resources.threads = threads;
      job.options.resources.memory_bytes = mebibytes << 20;
      CAPTURE(threads, mebibytes);
      CHECK_FALSE(projected(job.run()));
    }
  }
  // A projection needs more than that for each thread; results do not.
  job.options.resources.threads = 1;
  job.options.resources.memory_bytes = 12 << 20;
  CHECK_FALSE(projected(job.run()));
  CHECK(job.packs().size() == 1);
}

TEST_CASE("results are kept in the least memory, too", "[flow]") {
  Job job(10);
  job.options.output = job.folder.file("plan.png");
  job.options.resources.cache_dir = job.cache;
  for (const unsigned threads : {1U, 3U}) {
    fs::remove_all(job.cache);
    job.options.resources.threads = threads;
    job.options.resources.memory_bytes = 256 << 20;  // what plans are made under
    job.options.resources.memory_bytes = plan(job.options).least_memory_bytes;
    CHECK(projected(job.run()));
    CHECK_FALSE(projected(job.run()));
  }
}

TEST_CASE("several channels of a scene are known together", "[flow]") {
  Job job(4);
  job.options.channels.transferred = {Channel::base_color, Channel::confidence, Channel::distance};
  std::vector<Bytes> images;
  job.ending = "_<CHANNEL>.exr";
  TransferOptions& options = job.options;
  options.resources.cache_dir = job.cache;
  options.output = job.folder.file("a_<CHANNEL>.exr");
  const Report first = transfer(options);
  CHECK(projected(first));
  options.output = job.folder.file("b_<CHANNEL>.exr");
  const Report second = transfer(options);
  CHECK_FALSE(projected(second));
  REQUIRE(first.outputs.size() == 3);
  REQUIRE(second.outputs.size() == 3);
  for (std::size_t i = 0; i < 3; ++i) {
    CAPTURE(first.outputs[i]);
    CHECK((read_whole(posix_file_system(), first.outputs[i]) ==
           read_whole(posix_file_system(), second.outputs[i])));
  }
}

TEST_CASE("what changes results is projected again", "[flow]") {
  Job job(5);
  job.run();
  SECTION("the scene") { job.strew(5, 0.8); }
  SECTION("distance") { job.options.search.max_distance = Length{0.5, false}; }
  SECTION("angle") { job.options.search.max_angle_deg = 61; }
  SECTION("confidence") { job.options.splats.min_confidence = 0.01; }
  SECTION("rays") { job.options.splats.rays = 4; }
  SECTION("harmonics") { job.options.splats.harmonics = SphericalHarmonics::dc; }
  SECTION("the depth") { job.options.image.depth = Depth::u16; }
  SECTION("the output's size") { job.options.image.size = ImageSize{151, 130}; }
  SECTION("alpha") { job.options.splats.alpha = true; }
  SECTION("another channel") { job.options.channels.transferred = {Channel::confidence}; }
  CHECK(projected(job.run()));
  CHECK(job.packs().size() == 2);
}

TEST_CASE("targets that are known stand beside others", "[flow]") {
  const bool first_is_known = GENERATE(true, false);
  Job job(11);
  TransferOptions& options = job.options;
  const std::vector<std::string> targets{job.folder.file("a.glb"), job.folder.file("b.glb"),
                                         job.folder.file("c.glb")};
  for (int i = 0; i < 3; ++i) write_glb(targets[static_cast<std::size_t>(i)], wavy_sheet(6 + i, 3));
  options.targets = targets;
  job.strew(11, 0.9);
  options.output = job.folder.file("<TARGET>.png");
  options.resources.use_cache = false;
  const auto made = [&] {
    std::vector<Bytes> images;
    for (const std::string& path : transfer(options).outputs)
      images.push_back(read_whole(posix_file_system(), path));
    return images;
  };
  const std::vector<Bytes> expected = made();
  options.resources.use_cache = true;
  options.resources.cache_dir = job.cache;
  options.targets = {first_is_known ? targets[0] : targets[1]};
  CHECK(made().size() == 1);
  options.targets = targets;
  CHECK((made() == expected));
  CHECK(job.packs().size() == 3);
  CHECK((made() == expected));
}

TEST_CASE("texels on rays are known, too", "[flow]") {
  const TempFolder folder;
  TransferOptions options = make_random_scene(folder.path().string(), 6);
  options.mesh.method = Method::gaussian;
  options.channels.transferred = {Channel::base_color};
  options.image.size = ImageSize{90, 70};
  options.output = folder.file("out.png");
  options.resources.memory_bytes = 256 << 20;
  options.resources.cache_dir = folder.file("cache");
  CHECK(projected(transfer(options)));
  const Bytes first = read_whole(posix_file_system(), options.output);
  CHECK_FALSE(projected(transfer(options)));
  CHECK((read_whole(posix_file_system(), options.output) == first));
  options.search.max_angle_deg = 50;
  CHECK(projected(transfer(options)));
}

TEST_CASE("results that the cache has no room for take none of the scratch files'", "[flow]") {
  Job job(8);
  job.options.image.size = ImageSize{512, 512};
  job.options.resources.cache_dir = job.cache;
  job.options.resources.cache_limit_bytes = 64 << 10;
  job.options.output = job.folder.file("<TARGET>.png");
  std::vector<std::string> targets;
  for (const char* name : {"a", "b", "c", "d"}) {
    targets.push_back(job.folder.file(std::string(name) + ".glb"));
    write_glb(targets.back(), wavy_sheet(6 + name[0] % 4, 3));
  }
  job.options.targets = targets;
  job.options.image.depth = Depth::u16;
  job.strew(8, 0.9);  // over the first, which the others are close to
  const Report four = transfer(job.options);
  job.options.targets = {targets.front()};
  job.options.resources.cache_dir = job.folder.file("other");
  const Report one = transfer(job.options);
  CHECK(one.target_covered > 50'000);
  CHECK(one.temp_peak_bytes > one.target_store_bytes + 300'000);  // the results of a target
  // Stores add up, results do not.
  CHECK(four.temp_peak_bytes - one.temp_peak_bytes <=
        four.target_store_bytes - one.target_store_bytes + 100'000);
  CHECK(job.packs().empty());
}

TEST_CASE("a second cache with results that cannot be stops no job", "[flow]") {
  Job job(9);
  job.run();
  const std::string second = job.folder.file("second");
  fs::rename(job.cache, second);
  const std::string pack = second + "/v3/results";
  for (const auto& entry : fs::directory_iterator(pack)) {
    if (entry.path().extension() != ".pack") continue;
    const PackTree tree(entry.path());
    tree.write(entry.path(), [](int, Bytes& directory) {
      store::put_u32(directory.data(), store::get_u32(directory.data()) + 1);
    });
  }
  job.options.resources.cache_readonly_dir = second;
  CHECK(projected(job.run(true)));
  CHECK(job.packs().size() == 1);  // made anew, in the first
  CHECK_FALSE(projected(job.run(true)));
}

TEST_CASE("damaged results are projected again and never change the picture", "[flow]") {
  const Job job(7);
  job.run();
  const std::string pack = job.packs().at(0);
  std::ifstream in(pack, std::ios::binary);
  const std::string sound{std::istreambuf_iterator<char>(in), {}};
  REQUIRE(sound.size() > 1000);
  std::vector<Bytes> expected;
  job.run(false, expected);
  std::mt19937 random(7);
  int rebuilt = 0;
  for (int i = 0; i < 40; ++i) {
    std::string damaged = sound;
    const std::size_t at = random() % damaged.size();
    damaged[at] = static_cast<char>(damaged[at] ^ (1 << random() % 8));
    std::ofstream(pack, std::ios::binary | std::ios::trunc) << damaged;
    CAPTURE(at);
    std::vector<Bytes> images;
    rebuilt += projected(job.run(true, images)) ? 1 : 0;
    CHECK((images == expected));
  }
  CHECK(rebuilt >= 35);  // zeros between chunks may go unread
  CHECK_FALSE(projected(job.run()));
}

}  // namespace pounce::test
