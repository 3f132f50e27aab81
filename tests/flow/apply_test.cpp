// SPDX-License-Identifier: Apache-2.0
//
// What is painted through a hit map is what a transfer paints, sample for sample: on random
// scenes of several materials, wrap modes, transforms and layers, on UDIM tiles, fine and so coarse
// that texels are averaged.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cstring>
#include <filesystem>

#include "io/image/read.h"
#include "io/image/write.h"
#include "pounce/transfer.h"
#include "support/mesh_files.h"
#include "support/random.h"
#include "support/random_scene.h"
#include "support/sheet.h"
#include "support/test_data.h"
#include "support/whole_image.h"

namespace pounce::test {
namespace {

namespace fs = std::filesystem;

/// The samples of a file as they are stored: its header names the job that made it.
std::vector<std::byte> stored_samples(const std::string& path) {
  io::ImageReader reader(path);
  const io::ImageInfo info = reader.info();
  std::vector<std::byte> rows(reader.row_bytes() * info.height);
  reader.read_rows(info.height, rows.data());
  return rows;
}

/// Random samples, of which no two neighbours are alike.
void write_paint(const std::string& path, ImageSize size, Depth depth, std::uint32_t channels,
                 std::uint64_t seed) {
  Random random(seed);
  io::ImageWriter writer(
      path, {size.width, size.height, channels, depth, depth == Depth::float32, channels == 4});
  std::vector<std::byte> rows(std::size_t{size.width} * size.height * channels *
                              (depth == Depth::float32 ? 4
                               : depth == Depth::u16   ? 2
                                                       : 1));
  if (depth == Depth::float32) {
    std::vector<float> samples(rows.size() / 4);
    for (float& sample : samples) sample = random.between(0.01F, 3.0F);
    std::memcpy(rows.data(), samples.data(), rows.size());
  } else {
    for (std::byte& b : rows) b = static_cast<std::byte>(random.below(256));
  }
  writer.write_rows(size.height, rows.data());
  writer.commit();
}

struct Painting {
  TempFolder folder;
  TransferOptions transferred;  ///< with the meshes

  explicit Painting(std::uint32_t seed) {
    fs::create_directory(folder.file("scene"));
    transferred = make_random_scene(folder.file("scene"), seed);
    transferred.resources.use_cache = false;
    transferred.resources.threads = 2;
    transferred.resources.memory_bytes = 256 << 20;
    transferred.channels.transferred = {Channel::base_color};
  }

  std::string file(const std::string& name) const { return folder.file(name); }

  /// The same through a map that such a transfer wrote with other textures.
  TransferOptions applied(const std::string& map) const {
    TransferOptions options;
    options.source = map;
    options.channels = transferred.channels;
    options.material = transferred.material;
    options.mesh.filter = transferred.mesh.filter;
    options.image = transferred.image;
    options.image.size.reset();
    options.image.map_output.clear();
    options.resources = transferred.resources;
    return options;
  }
};

}  // namespace

TEST_CASE("twenty random repaints through a map are what a transfer gives", "[flow]") {
  const auto seed = GENERATE(range(1U, 21U));
  CAPTURE(seed);
  Random random(seed);
  Painting painting(seed);
  TransferOptions& job = painting.transferred;
  if (random.one_in(2))  // most texels are averaged
    job.image.size = ImageSize{static_cast<std::uint32_t>(random.whole(9, 40)),
                               static_cast<std::uint32_t>(random.whole(9, 40))};
  const Depth depth = std::array{Depth::u8, Depth::u16, Depth::float32}[random.below(3)];
  const std::string ending = depth == Depth::float32 ? ".exr" : random.one_in(2) ? ".png" : ".tif";
  job.mesh.filter = static_cast<Filter>(random.below(3));
  job.image.padding_px = static_cast<std::uint32_t>(random.below(12));
  job.material.apply_factors = !random.one_in(3);
  const ImageSize size{static_cast<std::uint32_t>(random.whole(30, 300)),
                       static_cast<std::uint32_t>(random.whole(30, 300))};
  const auto channels = static_cast<std::uint32_t>(random.whole(3, 4));
  const std::string paint = painting.file("paint" + ending);
  job.material.textures = {{Channel::base_color, paint}};

  write_paint(paint, size, depth, channels, seed + 1000);
  job.output = painting.file("first" + ending);
  job.image.map_output = painting.file("map.exr");
  transfer(job);
  write_paint(paint, size, depth, channels, seed + 2000);
  job.output = painting.file("transferred" + ending);
  job.image.map_output.clear();
  job.image.coverage_output = painting.file("covered.png");
  const Report wanted = transfer(job);

  TransferOptions apply = painting.applied(painting.file("map.exr"));
  apply.output = painting.file("applied" + ending);
  apply.image.coverage_output = painting.file("applied_covered.png");
  const Report report = transfer(apply);
  CHECK(report.command == "apply");
  CHECK((stored_samples(apply.output) == stored_samples(job.output)));
  CHECK((stored_samples(apply.output) != stored_samples(painting.file("first" + ending))));
  CHECK((stored_samples(painting.file("applied_covered.png")) ==
         stored_samples(painting.file("covered.png"))));
  CHECK(report.target_covered == wanted.target_covered);
  CHECK((report.targets[0].distances == wanted.targets[0].distances));
  CHECK(report.targets[0].max_distance == wanted.targets[0].max_distance);
}

TEST_CASE("materials with images of their own are repainted through a map", "[flow]") {
  // Only a texture of the size of the map's lattice gives what a transfer gives, so the materials
  // that a scene has of one size each are repainted by a third that no material has.
  Painting painting(3);
  TransferOptions& job = painting.transferred;
  job.material.textures = {{Channel::metallic_roughness, painting.file("paint.png")}};
  job.channels.transferred = {Channel::metallic_roughness};
  write_paint(painting.file("paint.png"), {64, 48}, Depth::u8, 3, 1);
  job.output = painting.file("a.png");
  job.image.map_output = painting.file("map.exr");
  transfer(job);
  TransferOptions apply = painting.applied(job.image.map_output);
  apply.output = painting.file("b.png");
  transfer(apply);
  CHECK((stored_samples(apply.output) == stored_samples(job.output)));
}

TEST_CASE("UDIM tiles are painted through the map of each", "[flow]") {
  Painting painting(1);
  TransferOptions& job = painting.transferred;
  write_glb(painting.file("source.glb"), wavy_sheet(6, 3));
  write_glb(painting.file("target.glb"), wavy_sheet(7, 2));
  job.source = painting.file("source.glb");
  job.targets = {painting.file("target.glb")};
  job.image.size = ImageSize{70, 90};
  job.material.textures = {{Channel::base_color, painting.file("skin.<UDIM>.png")}};
  // Tiles that differ in size, and one that is not there.
  write_paint(painting.file("skin.1001.png"), {64, 80}, Depth::u8, 3, 1);
  write_paint(painting.file("skin.1003.png"), {40, 30}, Depth::u8, 3, 2);
  job.output = painting.file("a.<UDIM>.png");
  job.image.map_output = painting.file("map.<UVTILE>.exr");
  CHECK_THROWS_AS(transfer(job), Error);  // one pattern for both
  job.image.map_output = painting.file("map.<UDIM>.exr");
  const Report wanted = transfer(job);
  TransferOptions apply = painting.applied(job.image.map_output);
  apply.output = painting.file("b.<UDIM>.png");
  const Report report = transfer(apply);
  CHECK(report.outputs ==
        std::vector<std::string>{painting.file("b.1001.png"), painting.file("b.1002.png")});
  for (const char* tile : {"1001", "1002"}) {
    CAPTURE(tile);
    CHECK((stored_samples(painting.file("b." + std::string(tile) + ".png")) ==
           stored_samples(painting.file("a." + std::string(tile) + ".png"))));
  }
  CHECK(report.target_covered == wanted.target_covered);
  const auto names_missing = [](const std::string& warning) {
    return warning.find("no image for UDIM 1002") != std::string::npos;
  };
  CHECK(std::count_if(report.warnings.begin(), report.warnings.end(), names_missing) == 1);
  CHECK(std::count_if(wanted.warnings.begin(), wanted.warnings.end(), names_missing) == 1);
  apply.image.tiles = {1002};
  apply.output = painting.file("c.<UDIM>.png");
  CHECK(transfer(apply).outputs == std::vector<std::string>{painting.file("c.1002.png")});
}

TEST_CASE("any threads, memory and cache paint the same bytes through a map", "[flow]") {
  Painting painting(5);
  TransferOptions& job = painting.transferred;
  job.image.size = ImageSize{300, 260};
  write_paint(painting.file("paint.png"), {90, 70}, Depth::u8, 3, 1);
  job.material.textures = {{Channel::base_color, painting.file("paint.png")}};
  job.output = painting.file("a.png");
  job.image.map_output = painting.file("map.exr");
  transfer(job);
  TransferOptions apply = painting.applied(job.image.map_output);
  fs::create_directory(painting.file("cache"));
  std::vector<std::byte> first;
  for (const bool cached : {false, true, true}) {
    for (const unsigned threads : {1U, 3U}) {
      for (const std::uint64_t mebibytes : {64, 512}) {
        CAPTURE(cached, threads, mebibytes);
        apply.resources.use_cache = cached;
        apply.resources.cache_dir = cached ? painting.file("cache") : "";
        apply.resources.threads = threads;
        apply.resources.memory_bytes = mebibytes << 20;
        apply.output = painting.file("b.png");
        transfer(apply);
        const auto bytes = stored_samples(apply.output);
        if (first.empty()) first = bytes;
        CHECK((bytes == first));
      }
    }
  }
  CHECK((first == stored_samples(job.output)));
}

}  // namespace pounce::test
