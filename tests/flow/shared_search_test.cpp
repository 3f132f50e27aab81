// SPDX-License-Identifier: Apache-2.0
//
// Channels whose images differ in size share one search: it sees the source on the lattice of the
// largest, and a smaller image is looked up in proportion. Each must come out as it does alone.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "pounce/transfer.h"
#include "support/bytes.h"
#include "support/mesh_files.h"
#include "support/sheet.h"
#include "support/test_data.h"
#include "support/whole_image.h"

namespace pounce::test {
namespace {

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
    write_glb(folder.file("source.glb"), wavy_sheet(6, tiles));
    write_glb(folder.file("target.glb"), wavy_sheet(7, 1));
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
