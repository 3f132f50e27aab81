// SPDX-License-Identifier: Apache-2.0
//
// Channels whose images differ in size share one search: it sees the source on the lattice of the
// largest, and a smaller image is looked up in proportion. Each must come out as it does alone.
#include <algorithm>
#include <array>
#include <bit>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "flow/transfer.h"
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

/// An image of noise of any depth and number of channels: colours times alpha where that is there.
void write_noise(const std::string& path, ImageSize size, std::uint32_t channels, Depth depth,
                 std::uint32_t seed) {
  std::mt19937 random(seed);
  const bool has_alpha = channels == 2 || channels == 4;
  std::vector<std::byte> bytes;
  for (std::size_t i = 0; i < std::size_t{size.width} * size.height; ++i) {
    std::array<float, 4> texel{};
    for (float& sample : texel) sample = static_cast<float>(random() % 4096) / 4095;
    for (std::uint32_t c = 0; c < channels; ++c) {
      if (depth == Depth::half) {
        const float alpha = has_alpha && c + 1 < channels ? texel[channels - 1] : 1;
        const std::uint16_t half = float_to_half(texel[c] * alpha);
        for (const auto byte : std::bit_cast<std::array<std::byte, 2>>(half)) bytes.push_back(byte);
      } else if (depth == Depth::u16) {
        const auto word = static_cast<std::uint16_t>(texel[c] * 65535);
        for (const auto byte : std::bit_cast<std::array<std::byte, 2>>(word)) bytes.push_back(byte);
      } else {
        bytes.push_back(static_cast<std::byte>(texel[c] * 255));
      }
    }
  }
  io::ImageWriter writer(
      path, {size.width, size.height, channels, depth, depth == Depth::half, has_alpha});
  writer.write_rows(size.height, bytes.data());
  writer.commit();
}

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

TEST_CASE("channels that are looked up together have the bytes that each has alone", "[flow]") {
  // Of one size, so that they share a lattice and weights; more than are looked up at once, and
  // some that cannot join the others: floats, and colours that are divided by their alpha.
  struct Map {
    std::string name, ending;
    std::uint32_t channels;
    Depth depth;
  };
  const std::vector<Map> maps{{"baseColor", "png", 4, Depth::u8}, {"grey", "png", 1, Depth::u8},
                              {"rgb", "png", 3, Depth::u8},       {"deep", "png", 3, Depth::u16},
                              {"pair", "png", 2, Depth::u8},      {"half", "exr", 3, Depth::half},
                              {"times", "exr", 4, Depth::half},   {"more", "png", 3, Depth::u8}};
  const int tiles = GENERATE(1, 2);
  const Filter filter = GENERATE(Filter::cubic, Filter::tent);
  const ImageSize image{96, 80};
  TempFolder folder;
  write_glb(folder.file("source.glb"), wavy_sheet(6, tiles));
  write_glb(folder.file("target.glb"), wavy_sheet(7, 1));
  TransferOptions options;
  options.source = folder.file("source.glb");
  options.targets = {folder.file("target.glb")};
  options.mesh.filter = filter;
  options.resources.use_cache = false;
  options.resources.memory_bytes = 256 << 20;
  std::vector<Channel> all;
  for (std::size_t m = 0; m < maps.size(); ++m) {
    const Map& map = maps[m];
    const std::string token = tiles > 1 ? ".<UDIM>" : "";
    for (int tile = 0; tile < tiles; ++tile) {
      const std::string number = tiles > 1 ? "." + std::to_string(1001 + tile) : "";
      write_noise(folder.file(map.name + number + "." + map.ending), image, map.channels, map.depth,
                  static_cast<std::uint32_t>(10 * m) + static_cast<std::uint32_t>(tile));
    }
    if (m > 0) options.channels.other_maps.push_back({map.name, {}});
    const Channel channel = m == 0 ? Channel::base_color : other_channel(m - 1);
    all.push_back(channel);
    options.material.textures.push_back(
        {channel, folder.file(map.name + token + "." + map.ending)});
  }
  const auto run = [&](const std::vector<Channel>& channels, const std::string& prefix,
                       const std::string& ending) {
    options.channels.transferred = channels;
    options.output = folder.file(prefix + ".<CHANNEL>." + ending);
    transfer(options);
  };
  // Finer than the images, as fine in part, and so coarse that levels are asked for.
  for (const ImageSize size : {ImageSize{260, 240}, ImageSize{90, 130}, ImageSize{33, 21}}) {
    options.image.size = size;
    for (const std::string ending : {"png", "exr"}) {
      // With the least budget each channel is looked up alone, and none needs more for the others.
      const std::uint64_t ample = options.resources.memory_bytes;
      if (size.width == 33) {
        options.channels.transferred = all;
        options.output = folder.file("all.<CHANNEL>." + ending);
        options.resources.memory_bytes = flow::plan(options, {}).least_memory_bytes;
      }
      run(all, "all", ending);
      options.resources.memory_bytes = ample;
      for (std::size_t m = 0; m < maps.size(); ++m) {
        run({all[m]}, "alone", ending);
        CAPTURE(tiles, static_cast<int>(filter), size.width, ending, maps[m].name);
        const std::string file = "." + maps[m].name + "." + ending;
        CHECK(read_whole(posix_file_system(), folder.file("all" + file)) ==
              read_whole(posix_file_system(), folder.file("alone" + file)));
      }
    }
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
