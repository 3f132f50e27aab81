// SPDX-License-Identifier: Apache-2.0
//
// The hit map against what the same transfer shows: a texture that holds its own UVs.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>

#include "core/file.h"
#include "io/image/write.h"
#include "pounce/transfer.h"
#include "support/bytes.h"
#include "support/mesh_files.h"
#include "support/sheet.h"
#include "support/test_data.h"
#include "support/whole_image.h"

namespace pounce::test {
namespace {

/// A float EXR whose texels hold u, v (up) and the number of their tile.
void write_uvs(const std::string& path, ImageSize size, float tile) {
  std::vector<float> samples;
  for (std::uint32_t y = 0; y < size.height; ++y) {
    for (std::uint32_t x = 0; x < size.width; ++x) {
      samples.push_back((static_cast<float>(x) + 0.5F) / static_cast<float>(size.width));
      samples.push_back(1 - (static_cast<float>(y) + 0.5F) / static_cast<float>(size.height));
      samples.push_back(tile);
    }
  }
  io::ImageWriter writer(path, {size.width, size.height, 3, Depth::float32, true});
  writer.write_rows(size.height, reinterpret_cast<const std::byte*>(samples.data()));
  writer.commit();
}

std::vector<std::byte> bytes(const std::string& path) {
  return read_whole(posix_file_system(), path);
}

WholeImage channels(const std::string& path, const std::string& names) {
  mesh::ImageRef image;
  image.path = image.label = path;
  image.channels = names;
  return read_whole_image(image);
}

struct Scene {
  TempFolder folder;
  TransferOptions options;

  explicit Scene(int tiles) {
    write_glb(folder.file("source.glb"), wavy_sheet(6, tiles));
    write_glb(folder.file("target.glb"), wavy_sheet(7, 1));
    for (int tile = 0; tile < tiles; ++tile) {
      const int number = 1001 + tile;
      write_uvs(folder.file("uv." + std::to_string(number) + ".exr"), {96, 64},
                static_cast<float>(number));
    }
    options.source = folder.file("source.glb");
    options.targets = {folder.file("target.glb")};
    options.material.textures = {
        {Channel::base_color, folder.file(tiles > 1 ? "uv.<UDIM>.exr" : "uv.1001.exr")}};
    options.output = folder.file("shown.exr");
    options.image.map_output = folder.file("map.exr");
    options.image.size = ImageSize{150, 130};
    options.image.padding_px = 0;
    options.resources.use_cache = false;
    options.resources.memory_bytes = 256 << 20;
    options.resources.threads = 2;
  }
};

}  // namespace

TEST_CASE("a map names the places that a transfer shows", "[flow]") {
  const int tiles = GENERATE(1, 2);
  CAPTURE(tiles);
  Scene scene(tiles);
  const Report report = transfer(scene.options);
  CHECK(report.outputs ==
        std::vector<std::string>{scene.folder.file("shown.exr"), scene.folder.file("map.exr")});
  const WholeImage shown = read_whole_image(scene.folder.file("shown.exr"));
  const WholeImage map = channels(scene.folder.file("map.exr"), "R,G,udim");
  const WholeImage found = channels(scene.folder.file("map.exr"), "distance,angle");
  REQUIRE(map.samples.size() == shown.samples.size());
  std::size_t compared = 0, covered = 0;
  double worst = 0, farthest = 0, steepest = 0;
  for (std::size_t i = 0; i < map.samples.size() / 3; ++i) {
    const double u = map.samples[3 * i], v = map.samples[3 * i + 1], udim = map.samples[3 * i + 2];
    if (udim == 0) continue;
    ++covered;
    farthest = std::max(farthest, std::abs(found.samples[2 * i]));
    steepest = std::max(steepest, found.samples[2 * i + 1]);
    CHECK(shown.samples[3 * i + 2] == udim);
    // Near the border of an image a filter meets what lies beyond: its outer texels again.
    const double rim_u = 3.0 / 96, rim_v = 3.0 / 64;
    if (u < rim_u || u > 1 - rim_u || v < rim_v || v > 1 - rim_v) continue;
    ++compared;
    worst = std::max(
        {worst, std::abs(u - shown.samples[3 * i]), std::abs(v - shown.samples[3 * i + 1])});
  }
  CHECK(covered == report.target_covered);
  CHECK(compared > covered * 8 / 10);
  CHECK(worst < 1e-5);
  // Both sheets follow one wave by chords: near each other, and nearly parallel.
  CHECK(farthest > 1e-5);
  CHECK(farthest < 4e-3);
  CHECK(steepest < 1e-3);  // all normals are those of the plane
}

TEST_CASE("a map knows how far away the source is, on which side, and how it leans", "[flow]") {
  Scene scene(1);
  const double lean = 0.3, height = GENERATE(0.04, -0.04);
  mesh::Mesh source = wavy_sheet(1, 1), target = wavy_sheet(1, 1);
  for (Vec3f& p : target.positions) p.z = 0;
  for (std::size_t i = 0; i < source.positions.size(); ++i) {
    Vec3f& p = source.positions[i];
    p.z = static_cast<float>(height + lean * (p.x - 0.5));
    const double size = std::sqrt(1 + lean * lean);
    source.normals[i] = {static_cast<float>(-lean / size), 0, static_cast<float>(1 / size)};
  }
  write_glb(scene.folder.file("source.glb"), source);
  write_glb(scene.folder.file("target.glb"), target);
  scene.options.search.max_distance = Length{1, false};
  transfer(scene.options);
  const WholeImage found = channels(scene.folder.file("map.exr"), "distance,angle");
  const WholeImage map = channels(scene.folder.file("map.exr"), "R,G");
  for (std::uint32_t x = 1; x + 1 < 150; ++x) {
    const std::size_t i = std::size_t{65} * 150 + x;
    const double at = (x + 0.5) / 150;
    CAPTURE(x);
    CHECK(found.samples[2 * i] == Approx(height + lean * (at - 0.5)).margin(1e-6));
    CHECK(found.samples[2 * i + 1] ==
          Approx(std::atan(lean) * 180 / 3.14159265358979).epsilon(1e-5));
    CHECK(map.samples[2 * i] == Approx(at).margin(1e-5));
  }
}

TEST_CASE("a map changes no image, and is the same whatever the job has", "[flow]") {
  Scene scene(2);
  transfer(scene.options);
  const auto picture = bytes(scene.folder.file("shown.exr"));
  const auto map = bytes(scene.folder.file("map.exr"));
  const std::string cache = scene.folder.file("cache");
  std::filesystem::create_directory(cache);
  for (const bool first : {true, false}) {  // with hits that are not known yet, and that are
    CAPTURE(first);
    scene.options.resources.use_cache = true;
    scene.options.resources.cache_dir = cache;
    scene.options.resources.threads = first ? 1 : 3;
    transfer(scene.options);
    CHECK(bytes(scene.folder.file("shown.exr")) == picture);
    CHECK(bytes(scene.folder.file("map.exr")) == map);
  }
  scene.options.image.map_output.clear();
  const Report known = transfer(scene.options);
  CHECK(bytes(scene.folder.file("shown.exr")) == picture);
  const auto hit = std::find_if(known.nodes.begin(), known.nodes.end(),
                                [](const NodeReport& node) { return node.name == "hit"; });
  REQUIRE(hit != known.nodes.end());
  CHECK(hit->runs == 0);  // what a run with a map found is kept, too
}

}  // namespace pounce::test
