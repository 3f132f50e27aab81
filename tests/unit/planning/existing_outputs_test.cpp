// SPDX-License-Identifier: Apache-2.0
//
// The rules of --skip-existing, on files whose times are set by hand.
#include "planning/existing_outputs.h"

#include <catch2/catch.hpp>
#include <chrono>

#include "io/image/write.h"
#include "support/bytes.h"
#include "support/test_data.h"

using namespace pounce;
using namespace pounce::planning;

namespace {

const std::string kJob(32, 'a'), kOther(32, 'b');
const FileTime kInputs = std::filesystem::file_time_type::clock::now();
constexpr auto kHour = std::chrono::hours(1);

struct Files {
  test::TempFolder folder;

  /// An image that this job made ("": it does not say so), changed `after` the inputs.
  std::string image(const std::string& name, const std::string& job,
                    std::chrono::hours after) const {
    const std::string path = folder.file(name);
    io::ImageWriteSpec spec{2, 2, 3, Depth::u8};
    spec.job = job;
    io::ImageWriter writer(path, spec);
    writer.write_rows(2, std::vector<std::byte>(12).data());
    writer.commit();
    std::filesystem::last_write_time(path, kInputs + after);
    return path;
  }
};

TEST_CASE("what a file says of its job counts, whatever its time; else its time does") {
  const Files files;
  const auto standing = [&](const std::string& job, std::chrono::hours after) {
    return standing_of(files.image("a.png", job, after), kJob, kInputs);
  };
  CHECK(standing(kJob, kHour) == Standing::same_job);
  CHECK(standing(kJob, -kHour) == Standing::same_job);
  CHECK(standing(kOther, kHour) == Standing::outdated);
  CHECK(standing("", kHour) == Standing::younger);
  CHECK(standing("", -kHour) == Standing::outdated);
  CHECK(standing("", std::chrono::hours(0)) == Standing::outdated);  // equal times do not tell
}

TEST_CASE("what is missing, empty, cut off or a folder is outdated, however young") {
  const Files files;
  const auto standing = [&](const std::string& path) {
    return standing_of(path, kJob, FileTime::min());
  };
  CHECK(standing(files.folder.file("none.png")) == Standing::outdated);
  const std::string path = files.image("a.png", kJob, kHour);
  REQUIRE(standing(path) == Standing::same_job);
  std::filesystem::resize_file(path, std::filesystem::file_size(path) - 1);
  CHECK(standing(path) == Standing::outdated);
  std::filesystem::resize_file(path, 0);
  CHECK(standing(path) == Standing::outdated);
  CHECK_FALSE(has_content(path));
  std::filesystem::create_directory(files.folder.file("folder.png"));
  CHECK(standing(files.folder.file("folder.png")) == Standing::outdated);
  CHECK_FALSE(has_content(files.folder.file("folder.png")));
  CHECK_FALSE(has_content(files.folder.file("none.png")));
}

TEST_CASE("a set is kept whole or not at all") {
  const Files files;
  const std::string ours = files.image("a.png", kJob, -kHour),
                    young = files.image("b.png", "", kHour),
                    other = files.image("c.png", kOther, kHour);
  std::vector<std::string> by_time;
  CHECK(keeps_all({ours, young}, kJob, kInputs, by_time));
  CHECK(by_time == std::vector<std::string>{young});
  by_time.clear();
  CHECK_FALSE(keeps_all({young, other}, kJob, kInputs, by_time));
  CHECK(by_time.empty());  // nobody is told of a file that is made again
}

TEST_CASE("the newest of files is that of those that exist") {
  const Files files;
  const std::string old = files.image("a.png", "", -kHour), young = files.image("b.png", "", kHour);
  CHECK(newest({old, young, files.folder.file("none.png")}) == kInputs + kHour);
  CHECK(newest({files.folder.file("none.png")}) == FileTime::min());
}

TEST_CASE("an image is made once its mask is, too") {
  const Files files;
  ImageOutput image;
  image.job = kJob;
  image.path = files.image("a.png", kJob, -kHour);
  CHECK(is_made(image));
  image.coverage_path = files.folder.file("mask.png");
  CHECK_FALSE(is_made(image));
  files.image("mask.png", kOther, kHour);
  CHECK_FALSE(is_made(image));
  files.image("mask.png", kJob, kHour);
  CHECK(is_made(image));
  files.image("a.png", "", kHour);  // another process's work says so itself: time does not count
  CHECK_FALSE(is_made(image));
}

/// A source of one channel that samples `texture`, and a target of one image.
struct Plans {
  SourcePlan source;
  TargetPlan target;

  Plans(const std::string& texture, const std::string& output) {
    source.columns.resize(1);
    source.columns[0].image.path = texture;
    source.channels.resize(1);
    source.channels[0].pages.resize(1);
    source.channels[0].pages[0].column = 0;
    target.images = {{ImageOutput{}}};
    image().path = output;
    image().job = kJob;
    target.outputs = {output};
  }
  ImageOutput& image() { return target.images[0][0]; }
  bool keep(const std::set<std::string>& made = {}) {
    keep_existing(source, kInputs, made, target);
    return image().keep;
  }
};

TEST_CASE("an image that is kept leaves the outputs, with its mask") {
  const Files files;
  Plans plans(files.folder.file("none.png"), files.image("a.png", kJob, -kHour));
  plans.image().coverage_path = files.image("mask.png", "", kHour);
  plans.target.outputs = {plans.image().path, plans.image().coverage_path, "another.png"};
  CHECK(plans.keep());
  CHECK(plans.target.outputs == std::vector<std::string>{"another.png"});
  CHECK(plans.target.kept ==
        std::vector<std::string>{plans.image().path, plans.image().coverage_path});
  CHECK(plans.target.kept_by_time == std::vector<std::string>{plans.image().coverage_path});
}

TEST_CASE("an image without a record is kept if it is younger than all it is made from") {
  const Files files;
  const std::string output = files.image("a.png", "", kHour);
  const std::string texture = files.image("skin.png", "", -kHour);
  CHECK(Plans(texture, output).keep());
  files.image("skin.png", "", 2 * kHour);
  Plans later(texture, output);
  CHECK_FALSE(later.keep());  // the texture changed since
  CHECK(later.target.outputs == std::vector<std::string>{output});
  CHECK(later.target.kept.empty());

  files.image("skin.png", "", -kHour);
  Plans painted(texture, output);
  painted.image().onto = OntoImage{};
  painted.image().onto->path = files.image("old.png", "", 2 * kHour);
  CHECK_FALSE(painted.keep());  // so did the image that is painted over
  files.image("old.png", "", -kHour);
  painted.image().onto->mask_path = files.image("onto_mask.png", "", 2 * kHour);
  CHECK_FALSE(painted.keep());
  files.image("onto_mask.png", "", -kHour);
  CHECK(painted.keep());
}

TEST_CASE("a tile of a UDIM set counts among what an image is made from") {
  const Files files;
  Plans plans(files.image("1001.png", "", 2 * kHour), files.image("a.png", "", kHour));
  plans.source.channels[0].pages[0].column = -1;
  plans.source.channels[0].pages[0].tile_set = 0;
  plans.source.tile_sets.resize(1);
  CHECK(plans.keep());
  plans.source.tile_sets[0].columns = {{{}, 0}};
  CHECK_FALSE(plans.keep());
}

TEST_CASE("what this very run has made is no older work") {
  const Files files;
  const std::string output = files.image("a.png", kJob, kHour);
  CHECK_FALSE(Plans("none.png", output).keep({output}));
  CHECK(Plans("none.png", output).keep({"another.png"}));
}

}  // namespace
