// SPDX-License-Identifier: Apache-2.0
//
// Which job made an image: what changes its bytes changes the hash, and nothing else does. A hash
// that changes too little keeps an outdated output; one that changes too much makes everything
// again.
#include "planning/job_hash.h"

#include <catch2/catch.hpp>
#include <fstream>
#include <functional>

#include "support/bytes.h"
#include "support/test_data.h"

using namespace pounce;
using namespace pounce::planning;

namespace {

/// A job of two channels on two pages, of files that hold their own names.
struct Setup {
  test::TempFolder folder;
  TransferOptions options;
  SourcePlan plan;
  TargetPlan target;
  std::vector<std::string> source_files, target_files;
  std::size_t channel = 0, page = 0;

  Setup() {
    source_files = {file("s.obj", "source")};
    target_files = {file("t.obj", "target")};
    options.source = source_files[0];
    options.targets = target_files;
    options.output = "o.png";
    plan.columns.resize(1);
    plan.columns[0].image.path = file("skin.png", "skin");
    plan.channels.resize(2);
    for (ChannelPlan& each : plan.channels) {
      each.size = {64, 64};
      each.pages.resize(1);
      each.pages[0].column = 0;
    }
    plan.channels[0].name = "baseColor";
    plan.channels[1].name = "occlusion";
    plan.channels[1].channel = Channel::occlusion;
    target.pages = {{"default", std::nullopt, 1001}, {"default", std::nullopt, 1002}};
    target.by_tile = true;
    target.images.assign(2, std::vector<ImageOutput>(2));
    for (auto& images : target.images) {
      for (ImageOutput& image : images) image.path = "o.png", image.lattice = {64, 64, 0, {}};
    }
  }
  std::string file(const std::string& name, const std::string& content) const {
    std::ofstream(folder.file(name)) << content;
    return folder.file(name);
  }
  std::string hash() const {
    job::JobRun run(nullptr);
    job::JobContext job(64 << 20, run);
    job.files = &posix_file_system();
    return JobHash(job, options).of_image(source_files, plan, target_files, target, channel, page);
  }
};

/// Does this change the hash?
bool matters(const std::function<void(Setup&)>& change) {
  Setup setup;
  const std::string before = setup.hash();
  CHECK(before.size() == 32);
  CHECK(before == setup.hash());
  change(setup);
  return setup.hash() != before;
}

TEST_CASE("contents of inputs are of the job, their names and places are not") {
  CHECK(matters([](Setup& s) { s.file("s.obj", "Source"); }));
  CHECK(matters([](Setup& s) { s.file("t.obj", "Target"); }));
  CHECK(matters([](Setup& s) { s.file("skin.png", "Skin"); }));
  CHECK(matters([](Setup& s) { s.source_files.push_back(s.file("s.mtl", "")); }));
  CHECK(matters([](Setup& s) { std::filesystem::remove(s.source_files[0]); }));
  CHECK(matters([](Setup& s) { s.plan.columns[0].image.offset_bytes = 4; }));
  CHECK_FALSE(matters([](Setup& s) { s.source_files[0] = s.file("elsewhere.obj", "source"); }));
  CHECK_FALSE(matters([](Setup& s) { s.plan.columns[0].image.path = s.file("b.png", "skin"); }));
  CHECK_FALSE(matters([](Setup& s) { s.options.output = "another/place.png"; }));
}

TEST_CASE("options that pixels depend on are of the job, those of how it runs are not") {
  CHECK(matters([](Setup& s) { s.options.mesh.filter = Filter::tent; }));
  CHECK(matters([](Setup& s) { s.options.search.max_distance = Length{3, true}; }));
  CHECK_FALSE(matters([](Setup& s) { s.options.resources.threads = 7; }));
  CHECK_FALSE(matters([](Setup& s) { s.options.resources.memory_bytes = 99 << 20; }));
  CHECK_FALSE(matters([](Setup& s) { s.options.resources.use_cache = false; }));
  CHECK_FALSE(matters([](Setup& s) { s.options.skip_existing = true; }));
}

TEST_CASE("an option that states what holds without it is as if it were not given") {
  CHECK_FALSE(matters([](Setup& s) {
    s.options.search.max_distance = Length{5, true};
    s.target.usual_distance = true;
  }));
}

TEST_CASE("each image of a job has its own hash, whatever others there are") {
  CHECK(matters([](Setup& s) { s.page = 1; }));
  CHECK(matters([](Setup& s) { s.channel = 1; }));
  CHECK(matters([](Setup& s) { s.target.images[0][0].lattice.width = 32; }));
  CHECK(matters([](Setup& s) { s.plan.channels[0].format.depth = Depth::u16; }));
  CHECK(matters([](Setup& s) { s.target.images[0][0].padding = 4; }));
  CHECK(matters([](Setup& s) { s.target.images[0][0].path = "o.exr"; }));  // another format
  CHECK_FALSE(matters([](Setup& s) { s.target.images[0][0].path = "p.png"; }));
  CHECK_FALSE(matters([](Setup& s) { s.target.images[0][1].padding = 4; }));
  CHECK_FALSE(matters([](Setup& s) { s.target.images[1][0].path = "o.exr"; }));
  CHECK_FALSE(matters([](Setup& s) {
    s.plan.channels.pop_back();
    s.target.images.pop_back();
  }));
}

TEST_CASE("a model's hash is of its images, its own files and its kind") {
  const Setup setup;
  job::JobRun run(nullptr);
  job::JobContext job(64 << 20, run);
  job.files = &posix_file_system();
  const auto hash = [&](const std::string& path, const std::string& image,
                        const std::string& input) {
    TargetPlan target = setup.target;
    target.images[0][0].job = image;
    target.inputs = {setup.folder.file(input)};
    return JobHash(job, setup.options).of_model(path, target);
  };
  const std::string model = hash("a.glb", "1", "t.obj");
  CHECK(hash("elsewhere/b.glb", "1", "t.obj") == model);
  CHECK(hash("a.gltf", "1", "t.obj") != model);
  CHECK(hash("a.glb", "2", "t.obj") != model);
  CHECK(hash("a.glb", "1", "s.obj") != model);
}

}  // namespace
