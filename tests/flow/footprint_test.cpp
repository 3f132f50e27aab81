// SPDX-License-Identifier: Apache-2.0
//
// Targets whose texels cover several of the source's: they show the mean.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>

#include "pounce/error.h"
#include "shading/mip_levels.h"
#include "support/bytes.h"
#include "support/flat_scene.h"
#include "support/many_threads.h"

namespace pounce::test {
namespace {

/// Rings that grow finer outwards: down to 4 texels, so that point samples of them are moire, or as
/// `pace` says.
WholeImage rings(std::uint32_t width, std::uint32_t height, double pace = 1.05) {
  WholeImage image{width, height, 3, false, {}};
  for (std::uint32_t y = 0; y < height; ++y) {
    for (std::uint32_t x = 0; x < width; ++x) {
      const double dx = x + 0.5 - 0.5 * width, dy = y + 0.5 - 0.5 * height;
      const double phase = (dx * dx + dy * dy) * pace / width;
      for (const double shift : {0.0, 2.0, 4.0})
        image.samples.push_back(std::round(255 * (0.5 + 0.5 * std::cos(phase + shift))) / 255);
    }
  }
  return image;
}

double psnr(const TransferOptions& options, const WholeImage& truth) {
  const WholeImage out = read_whole_image(options.output);
  return score(out, truth, std::vector<std::uint8_t>(std::size_t{out.width} * out.height, 1))
      .psnr_db;
}

struct Scene : FlatScene {
  WholeImage skin;

  explicit Scene(const WholeImage& image, float repeats = 1)
      : FlatScene("skin.png", Channel::base_color, flat_sheet(repeats, repeats)), skin(image) {
    write_whole_image(texture(), skin);
  }
};

}  // namespace

TEST_CASE("a coarse target shows the mean of what its texels cover", "[flow]") {
  struct Case {
    ImageSize source, target;
    double least_db;
  };
  const Case c = GENERATE(Case{{1024, 768}, {128, 96}, 55},   // whole texels of a level
                          Case{{1024, 768}, {255, 191}, 38},  // a little more than four
                          Case{{1021, 767}, {128, 96}, 43},   // levels of odd sizes
                          Case{{1024, 768}, {64, 768}, 54},   // along one side alone
                          Case{{600, 600}, {437, 437}, 32});  // between one and two
  Scene scene(rings(c.source.width, c.source.height));
  scene.options.image.size = c.target;
  transfer(scene.options);
  const WholeImage truth = box_means(scene.skin, c.target.width, c.target.height);
  const double db = psnr(scene.options, truth);
  CAPTURE(c.source.width, c.source.height, c.target.width, c.target.height, db);
  std::printf("FIGURE footprint %u x %u onto %u x %u %.2f\n", c.source.width, c.source.height,
              c.target.width, c.target.height, db);
  CHECK(db >= c.least_db);
}

TEST_CASE("a fine target comes closer to what the source's texels are means of", "[flow]") {
  struct Case {
    ImageSize source, target;
    double least_db;  // above a bilinear lookup
  };
  // A cubic that is not sharpened is 4.3, 4.1 and 4.4 above; when written: 7.0, 6.3 and 6.7.
  const Case c = GENERATE(Case{{256, 256}, {1024, 1024}, 6.5},   // both ways
                          Case{{256, 512}, {1024, 512}, 5.8},    // along one side alone
                          Case{{256, 1024}, {1024, 256}, 6.2});  // while the other is coarse
  const WholeImage picture = rings(1024, 1024, 0.4);
  Scene scene(box_means(picture, c.source.width, c.source.height));
  scene.options.image.size = c.target;
  const WholeImage truth = box_means(picture, c.target.width, c.target.height);
  transfer(scene.options);
  const double db = psnr(scene.options, truth);
  scene.options.mesh.filter = Filter::tent;
  transfer(scene.options);
  const double tent_db = psnr(scene.options, truth);
  CAPTURE(c.source.width, c.source.height, c.target.width, c.target.height, db, tent_db);
  std::printf("FIGURE fine target %u x %u onto %u x %u %.2f, tent %.2f\n", c.source.width,
              c.source.height, c.target.width, c.target.height, db, tent_db);
  CHECK(db >= tent_db + c.least_db);
}

TEST_CASE("a straight gradient is as straight on a finer target", "[flow]") {
  FlatScene scene("height.tif");
  WholeImage heights{64, 64, 1, true, {}};
  for (int i = 0; i < 64 * 64; ++i) heights.samples.push_back(3 * (i % 64) - 5 * (i / 64) + 0.5);
  write_floats(scene.texture(), heights, Depth::float32);
  scene.options.output = scene.folder.file("out.tif");
  scene.options.image.depth = Depth::float32;
  scene.options.image.size = ImageSize{512, 512};
  transfer(scene.options);
  const WholeImage out = read_whole_image(scene.options.output);
  double worst = 0;
  for (int y = 16; y < 496; ++y) {  // not where the image begins anew
    for (int x = 16; x < 496; ++x) {
      const double right = 3 * ((x + 0.5) / 8 - 0.5) - 5 * ((y + 0.5) / 8 - 0.5) + 0.5;
      worst = std::max(worst, std::abs(out.at(static_cast<std::size_t>(y * 512 + x), 0) - right));
    }
  }
  CHECK(worst < 2e-4);
}

TEST_CASE("levels wrap as their image does", "[flow]") {
  Scene scene(waves(251, 333), 4);
  scene.options.image.size = ImageSize{130, 110};
  transfer(scene.options);
  const double db = psnr(scene.options, box_means(scene.skin, 130, 110, 4));
  CAPTURE(db);
  CHECK(db >= 38);
}

TEST_CASE("levels change no byte with threads, budgets and caches", "[flow]") {
  Scene scene(rings(1000, 700));
  TransferOptions& options = scene.options;
  options.image.size = ImageSize{170, 110};  // texels of 5.9 x 6.4: levels 1 and 2, mixed
  transfer(options);
  const auto expected = read_whole(posix_file_system(), options.output);
  options.resources.cache_dir = scene.folder.file("cache");
  for (const unsigned threads : {1U, 2U, 8U}) {
    options.resources.threads = threads;
    options.resources.use_cache = false;
    options.resources.memory_bytes = std::uint64_t{1} << 30;
    const std::uint64_t least = plan(options).least_memory_bytes;
    for (const std::uint64_t memory : {least, std::uint64_t{64} << 20, std::uint64_t{1} << 30}) {
      options.resources.memory_bytes = memory;
      std::filesystem::remove_all(options.resources.cache_dir);
      for (const bool use_cache : {false, true, true}) {  // the last finds what the one before made
        options.resources.use_cache = use_cache;
        const Report report = transfer(options);
        CAPTURE(threads, memory, use_cache);
        CHECK(report.leased_peak_bytes <= memory);
        CHECK(report.warnings.empty());
        CHECK((read_whole(posix_file_system(), options.output) == expected));
      }
    }
  }
}

TEST_CASE("a level is made once, kept with its image, and made anew when it is damaged", "[flow]") {
  Scene scene(rings(1024, 1024));
  TransferOptions& options = scene.options;
  options.image.size = ImageSize{256, 256};  // level 1
  options.resources.use_cache = true;
  options.resources.cache_dir = scene.folder.file("cache");
  const Report first = transfer(options);
  const auto expected = read_whole(posix_file_system(), options.output);
  std::vector<std::filesystem::path> images;
  std::uint64_t packs_bytes = 0;
  for (const auto& entry :
       std::filesystem::recursive_directory_iterator(options.resources.cache_dir)) {
    if (entry.path().extension() != ".pack") continue;
    packs_bytes += entry.file_size();
    if (entry.path().parent_path().filename() == "colour") images.push_back(entry.path());
  }
  REQUIRE(images.size() == 2);  // nobody asked for level 2
  CHECK(first.bytes_written - transfer(options).bytes_written == packs_bytes);
  const auto level =
      *std::min_element(images.begin(), images.end(), [](const auto& a, const auto& b) {
        return std::filesystem::file_size(a) < std::filesystem::file_size(b);
      });
  auto bytes = read_whole(posix_file_system(), level.string());
  bytes[100] ^= std::byte{1};  // in its first tile
  write_whole(posix_file_system(), level.string(), bytes);
  const Report report = transfer(options);
  CHECK((read_whole(posix_file_system(), options.output) == expected));
  CHECK(std::any_of(report.warnings.begin(), report.warnings.end(), [](const std::string& w) {
    return w.find("rebuilding it") != std::string::npos;
  }));
}

TEST_CASE("a job that is stopped where a level is made leaves nothing that is not whole",
          "[flow]") {
  Scene scene(rings(1024, 1024));
  TransferOptions& options = scene.options;
  options.image.size = ImageSize{256, 256};
  transfer(options);
  const auto expected = read_whole(posix_file_system(), options.output);
  std::filesystem::remove(options.output);
  options.resources.use_cache = true;
  options.resources.cache_dir = scene.folder.file("cache");
  Progress progress;
  progress.on_event = [&](const ProgressEvent& event) {
    if (event.stage.starts_with("project")) progress.cancel();
  };
  CHECK_THROWS_AS(transfer(options, &progress), Error);
  CHECK_FALSE(std::filesystem::exists(options.output));
  for (const auto& entry :
       std::filesystem::recursive_directory_iterator(options.resources.cache_dir)) {
    if (entry.path().extension() == ".part") FAIL(entry.path().string() << " is left over");
  }
  CHECK(transfer(options).warnings.empty());
  CHECK((read_whole(posix_file_system(), options.output) == expected));
}

TEST_CASE("a level's texels share the image out between them") {
  for (const std::uint32_t size : {2U, 3U, 5U, 8U, 64U, 1023U, 65535U}) {
    const std::uint32_t level_size = (size + 1) / 2;
    std::vector<std::uint64_t> given(size, 0);
    for (std::uint32_t i = 0; i < level_size; ++i) {
      const shading::LevelSpan span = shading::level_span(i, size);
      std::uint32_t sum = 0;
      for (std::uint32_t k = 0; k < span.count; ++k) {
        sum += span.weights[k];
        given.at(span.first + k) += span.weights[k];
      }
      if (sum != shading::level_total(size)) FAIL("texel " << i << " of " << size);
    }
    const std::uint64_t each = size % 2 == 0 ? 1 : level_size;
    CHECK(std::all_of(given.begin(), given.end(), [&](std::uint64_t g) { return g == each; }));
  }
}

}  // namespace pounce::test
