// SPDX-License-Identifier: Apache-2.0
#include "planning/seen_images.h"

#include <catch2/catch.hpp>

#include "support/gltf_builder.h"
#include "support/test_data.h"
#include "support/whole_image.h"

using namespace pounce;
using namespace pounce::planning;

namespace {

/// Unit squares side by side, each with all of an image of its own size.
class Squares {
 public:
  explicit Squares(const std::vector<ImageSize>& images) {
    options_.source = folder_.file("s.obj");
    options_.output = folder_.file("o.png");
    test::write_file(options_.source, "");
    mesh_.path = options_.source;
    mesh_.uv_sets.emplace_back();
    mesh_.uv_present.emplace_back();
    for (std::uint32_t i = 0; i < images.size(); ++i) add(i, images[i]);
    plan_ = plan_mesh(options_, mesh_, TexelsAs::surface, false);
  }
  const SourcePlan& plan() const { return plan_; }
  std::vector<std::uint32_t> levels(double finest) const {
    return seen_levels(plan_, {1, {finest}});
  }

 private:
  void add(std::uint32_t i, ImageSize size) {
    const std::string path = folder_.file("c" + std::to_string(i) + ".png");
    test::write_whole_image(
        path, {size.width, size.height, 1, false,
               std::vector<double>(std::size_t{size.width} * size.height, 0.1 * (i + 1))});
    const auto left = static_cast<float>(i);
    const auto first = static_cast<std::uint32_t>(mesh_.positions.size());
    for (const Vec2f corner : {Vec2f{0, 0}, {1, 0}, {1, 1}, {0, 1}}) {
      mesh_.positions.push_back({left + corner.x, corner.y, 0});
      mesh_.normals.push_back({0, 0, 1});
      mesh_.uv_sets[0].push_back(corner);
    }
    mesh_.triangles.push_back({first, first + 1, first + 2});
    mesh_.triangles.push_back({first, first + 2, first + 3});
    mesh_.triangle_material.insert(mesh_.triangle_material.end(), 2, i);
    mesh::ImageRef& image = mesh_.images.emplace_back();
    image.path = image.label = path;
    mesh::TextureBinding binding;
    binding.image = i;
    mesh_.materials.emplace_back().textures[static_cast<std::size_t>(Channel::base_color)] =
        binding;
  }

  test::TempFolder folder_;
  TransferOptions options_;
  mesh::Mesh mesh_;
  SourcePlan plan_;
};

}  // namespace

TEST_CASE("an image's level follows from how many texels lie under one of the finest target",
          "[planning]") {
  const Squares one({{512, 256}});
  const double density = 512 * 256;
  // Of a footprint of 12 texels, lookups that are four times as fine are in the image itself and
  // in level 1 where they are twice 1.5 across: from here on, and not below.
  CHECK(one.levels(density / (11.9 * 11.9)) == std::vector<std::uint32_t>{0});
  CHECK(one.levels(density / (12.1 * 12.1)) == std::vector<std::uint32_t>{1});
  CHECK(one.levels(density / (47.9 * 47.9)) == std::vector<std::uint32_t>{2});
  CHECK(one.levels(density / (48.1 * 48.1)) == std::vector<std::uint32_t>{3});
  CHECK(one.levels(1e-9) == std::vector<std::uint32_t>{6});
  CHECK(one.levels(1e9) == std::vector<std::uint32_t>{0});
  CHECK(one.levels(0) == std::vector<std::uint32_t>{0});  // a target without area
}

TEST_CASE("each image is seen by itself, and only even sides are halved", "[planning]") {
  const Squares three({{512, 256}, {64, 64}, {512, 250}});
  CHECK(three.levels(40) == std::vector<std::uint32_t>{3, 0, 1});
}

TEST_CASE("a target's detail is that of its finest page", "[planning]") {
  const Squares source({{64, 64}});
  surface::GeometryRequest coarse = source.plan().passes[0].source, fine = coarse;
  coarse.pages[0].width = coarse.pages[0].height = 32;
  fine.pages[0].width = 128;
  fine.pages[0].height = 16;
  TargetPlan target;
  target.pages.resize(2);
  target.requests = {{coarse, fine}};
  TargetDetail detail;
  detail.add(source.plan(), target);
  const ImageSize size = source.plan().passes[0].size;
  CHECK(detail.least_texels == 2 * std::uint64_t{size.width} * size.height);
  REQUIRE(detail.finest.size() == 1);
  CHECK(detail.finest[0] == Approx(128 * 16));
}
