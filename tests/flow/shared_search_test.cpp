// SPDX-License-Identifier: Apache-2.0
//
// Channels whose images differ in size share one search: it sees the source on the lattice of the
// largest, and a smaller image is looked up in proportion. Each must come out as it does alone.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "pounce/transfer.h"
#include "support/bytes.h"
#include "support/mesh_files.h"
#include "support/test_data.h"
#include "support/whole_image.h"

namespace pounce::test {
namespace {

/// A wavy sheet of `cells` squares each way over the unit square, whose UVs run over `tiles` UDIM
/// tiles to the right.
mesh::Mesh sheet(int cells, int tiles) {
  mesh::Mesh mesh;
  mesh.uv_sets.emplace_back();
  mesh.uv_present.emplace_back();
  for (int j = 0; j <= cells; ++j) {
    for (int i = 0; i <= cells; ++i) {
      const double u = 1.0 * i / cells, v = 1.0 * j / cells;
      mesh.positions.push_back({static_cast<float>(u), static_cast<float>(v),
                                static_cast<float>(0.02 * std::sin(5 * u) * std::cos(4 * v))});
      mesh.normals.push_back({0, 0, 1});
      mesh.uv_sets[0].push_back({static_cast<float>(u * tiles), static_cast<float>(1 - v)});
    }
  }
  const auto at = [&](int i, int j) { return static_cast<std::uint32_t>(j * (cells + 1) + i); };
  for (int j = 0; j < cells; ++j) {
    for (int i = 0; i < cells; ++i) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  return mesh;
}

WholeImage noise(ImageSize size, std::uint32_t seed) {
  std::mt19937 random(seed);
  WholeImage image{size.width, size.height, 3, false, {}};
  for (std::size_t i = 0; i < std::size_t{size.width} * size.height * 3; ++i)
    image.samples.push_back(static_cast<double>(random() % 256) / 255);
  return image;
}

std::uint64_t searches(const Report& report) {
  for (const NodeReport& node : report.nodes) {
    if (node.name == "hit") return node.runs;
  }
  return 0;
}

/// The largest difference of two images' samples, in steps of 8 bits.
double farthest(const WholeImage& a, const WholeImage& b) {
  REQUIRE(a.samples.size() == b.samples.size());
  double most = 0;
  for (std::size_t i = 0; i < a.samples.size(); ++i)
    most = std::max(most, std::abs(a.samples[i] - b.samples[i]) * 255);
  return most;
}

const std::vector<Channel> kChannels{Channel::base_color, Channel::metallic_roughness,
                                     Channel::occlusion};
const std::vector<std::string> kNames{"baseColor", "metallicRoughness", "occlusion"};
const std::vector<ImageSize> kSizes{{128, 96}, {256, 192}, {100, 200}};

/// Three channels with images of three sizes, one or two UDIM tiles each.
struct Scene {
  TempFolder folder;
  TransferOptions options;

  explicit Scene(int tiles, ImageSize size) {
    write_glb(folder.file("source.glb"), sheet(6, tiles));
    write_glb(folder.file("target.glb"), sheet(7, 1));
    const std::string token = tiles > 1 ? ".<UDIM>" : "";
    for (std::size_t c = 0; c < kChannels.size(); ++c) {
      for (int tile = 0; tile < tiles; ++tile) {
        const std::string number = tiles > 1 ? "." + std::to_string(1001 + tile) : "";
        write_whole_image(folder.file(kNames[c] + number + ".png"),
                          noise(kSizes[c], static_cast<std::uint32_t>(10 * c) + tile));
      }
      options.material.textures.push_back({kChannels[c], folder.file(kNames[c] + token + ".png")});
    }
    options.source = folder.file("source.glb");
    options.targets = {folder.file("target.glb")};
    options.image.size = size;
    options.resources.use_cache = false;
    options.resources.memory_bytes = 256 << 20;
  }

  Report run(const std::vector<Channel>& channels, const std::string& prefix) {
    options.channels.transferred = channels;
    options.output = folder.file(prefix + ".<CHANNEL>.png");
    return transfer(options);
  }
  std::string file(const std::string& prefix, std::size_t channel) const {
    return folder.file(prefix + "." + kNames[channel] + ".png");
  }
};

}  // namespace

TEST_CASE("channels whose images differ in size share one search", "[flow]") {
  const int tiles = GENERATE(1, 2);
  // Finer than every image, and so coarse that all are averaged.
  const ImageSize size = GENERATE(ImageSize{300, 260}, ImageSize{40, 30});
  CAPTURE(tiles, size.width);
  Scene scene(tiles, size);
  const Report all = scene.run(kChannels, "all");
  for (std::size_t c = 0; c < kChannels.size(); ++c) {
    const Report alone = scene.run({kChannels[c]}, "alone");
    CHECK(searches(alone) > 0);
    CHECK(searches(all) == searches(alone));
    CHECK(all.target_covered == alone.target_covered);
    const WholeImage shared = read_whole_image(scene.file("all", c));
    // Rounded on another lattice: a step of 8 bits, where a value is near the middle of two.
    CHECK(farthest(shared, read_whole_image(scene.file("alone", c))) <= 1.001);
  }
}

TEST_CASE("the order in which channels are named changes no byte", "[flow]") {
  Scene scene(1, {200, 180});
  scene.run(kChannels, "one");
  scene.run({kChannels[2], kChannels[0], kChannels[1]}, "other");
  for (std::size_t c = 0; c < kChannels.size(); ++c)
    CHECK(read_whole(posix_file_system(), scene.file("one", c)) ==
          read_whole(posix_file_system(), scene.file("other", c)));
}

}  // namespace pounce::test
