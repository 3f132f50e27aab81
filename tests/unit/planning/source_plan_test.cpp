// SPDX-License-Identifier: Apache-2.0
//
// What is left out of a plan leaves nothing behind in it.
#include <algorithm>
#include <catch2/catch.hpp>

#include "planning/plan.h"
#include "support/gltf_builder.h"
#include "support/test_data.h"
#include "support/whole_image.h"

using namespace pounce;
using namespace pounce::planning;

namespace {

/// A triangle over two UDIM tiles, whose material has a colour and a normal map of tiles.
mesh::Mesh two_tiles(const std::string& path, const std::string& colour,
                     const std::string& normals) {
  mesh::Mesh made;
  made.path = path;
  made.positions = {{0, 0, 0}, {2, 0, 0}, {0, 1, 0}};
  made.normals.assign(3, {0, 0, 1});
  made.tangents.assign(3, {1, 0, 0, 1});
  made.uv_sets = {{{0.1F, 0.9F}, {1.9F, 0.9F}, {0.1F, 0.1F}}};
  made.uv_present.resize(1);
  made.triangles = {{0, 1, 2}};
  made.triangle_material = {0};
  mesh::Material& material = made.materials.emplace_back();
  for (const auto& [channel, pattern] :
       {std::pair{Channel::base_color, colour}, {Channel::normal, normals}}) {
    mesh::ImageRef& image = made.images.emplace_back();
    image.path = image.label = pattern;
    image.missing = true;  // no file has the pattern's name
    image.problem = "is not there";
    mesh::TextureBinding binding;
    binding.image = static_cast<std::uint32_t>(made.images.size() - 1);
    material.textures[static_cast<std::size_t>(channel)] = binding;
  }
  return made;
}

}  // namespace

TEST_CASE("a channel that is left out takes its tile set along", "[planning]") {
  const test::TempFolder folder;
  const auto grey = [&](const std::string& name, std::uint32_t channels) {
    test::write_whole_image(folder.file(name),
                            {4, 4, channels, false, std::vector<double>(16 * channels, 0.5)});
  };
  grey("c.1001.png", 3);
  grey("c.1002.png", 3);
  grey("n.1001.png", 1);  // no normal map has one channel, which is known once the set is
  grey("n.1002.png", 1);
  TransferOptions options;
  options.source = folder.file("s.obj");
  test::write_file(options.source, "");
  options.output = folder.file("o.<CHANNEL>.png");
  const mesh::Mesh source =
      two_tiles(options.source, folder.file("c.<UDIM>.png"), folder.file("n.<UDIM>.png"));
  const SourcePlan plan = plan_mesh(options, source, TexelsAs::surface, false);
  REQUIRE(plan.channels.size() == 1);
  CHECK(plan.channels[0].channel == Channel::base_color);
  CHECK(plan.columns.size() == 2);
  REQUIRE(plan.tile_sets.size() == 1);
  for (const auto& [tile, column] : plan.tile_sets[0].columns) CHECK(column < plan.columns.size());
  CHECK(std::any_of(plan.warnings.begin(), plan.warnings.end(), [](const std::string& warning) {
    return warning.find("normal is left out") != std::string::npos;
  }));
}
