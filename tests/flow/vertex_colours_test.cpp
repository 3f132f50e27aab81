// SPDX-License-Identifier: Apache-2.0
//
// Colours of vertices, worked by hand. A square of two triangles has colours that are affine over
// it, so that every texel's is known: red is x, green is y, blue (1 + x) / 4.
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>

#include "pounce/error.h"
#include "pounce/gaussians.h"
#include "pounce/transfer.h"
#include "support/gltf_builder.h"
#include "support/test_data.h"
#include "support/transfer_job.h"
#include "support/whole_image.h"

namespace pounce::test {
namespace {

using Catch::Matchers::Contains;

constexpr std::uint32_t kSize = 8;

struct Square {
  std::vector<float> colours;  ///< of (0,0), (1,0), (1,1), (0,1); empty: none
  const char* type = "VEC3";
  bool has_uvs = true;
  std::string image;  ///< of its base colour
  std::vector<double> factor;
};

const std::vector<float> kAffine{0, 0, .25F, 1, 0, .5F, 1, 1, .5F, 0, 1, .25F};

/// y points up and v down, so texel row 0 is at y = 1.
std::string write_square(const std::string& path, const Square& square) {
  GltfBuilder file;
  nlohmann::json attributes{
      {"POSITION", file.add<float>({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}, "VEC3")},
      {"NORMAL", file.add<float>({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3")}};
  if (square.has_uvs) attributes["TEXCOORD_0"] = file.add<float>({0, 1, 1, 1, 1, 0, 0, 0}, "VEC2");
  if (!square.colours.empty()) attributes["COLOR_0"] = file.add(square.colours, square.type);
  nlohmann::json& primitive =
      file.primitive(attributes, file.add<std::uint16_t>({0, 1, 2, 0, 2, 3}, "SCALAR"));
  nlohmann::json look = nlohmann::json::object();
  if (!square.factor.empty()) look["baseColorFactor"] = square.factor;
  if (!square.image.empty()) {
    const int texture =
        file.push("textures", {{"source", file.push("images", {{"uri", square.image}})}});
    look["baseColorTexture"] = {{"index", texture}};
  }
  primitive["material"] = file.push("materials", {{"pbrMetallicRoughness", look}});
  return file.write_glb(path);
}

std::vector<float> everywhere(std::vector<float> colour) {
  std::vector<float> four;
  for (int corner = 0; corner < 4; ++corner) four.insert(four.end(), colour.begin(), colour.end());
  return four;
}

/// An image of one colour, of 255.
void write_plain(const std::string& path, double r, double g, double b) {
  WholeImage image{kSize, kSize, 3, false, {}};
  for (std::uint32_t t = 0; t < kSize * kSize; ++t) {
    for (const double v : {r, g, b}) image.samples.push_back(v / 255);
  }
  write_whole_image(path, image);
}

TransferOptions job(const std::string& source, const std::string& target,
                    const std::string& output) {
  TransferOptions options = transfer_job(source, target, output, 128);
  options.image.size = ImageSize{kSize, kSize};
  return options;
}

std::string notes_of(const Report& report) {
  std::string all;
  for (const std::string& note : report.notes) all += note + "\n";
  return all;
}

/// Are all texels this?
void check_all(const WholeImage& image, const std::vector<double>& wanted, double margin) {
  REQUIRE(image.channels == wanted.size());
  double worst = 0;
  for (std::size_t t = 0; t < std::size_t{image.width} * image.height; ++t) {
    for (std::size_t c = 0; c < wanted.size(); ++c)
      worst = std::max(worst, std::abs(image.at(t, c) - wanted[c]));
  }
  INFO("first texel " << image.at(0, 0) << " " << image.at(0, image.channels - 1));
  CHECK(worst <= margin);
}

void check_affine(const WholeImage& image) {
  REQUIRE(image.channels == 3);
  double worst = 0;
  for (std::size_t y = 0; y < kSize; ++y) {
    for (std::size_t x = 0; x < kSize; ++x) {
      const double px = (static_cast<double>(x) + .5) / kSize;
      const double py = 1 - (static_cast<double>(y) + .5) / kSize;
      const double wanted[3] = {px, py, (1 + px) / 4};
      for (std::size_t c = 0; c < 3; ++c)
        worst = std::max(worst, std::abs(image.at(y * kSize + x, c) - wanted[c]));
    }
  }
  CHECK(worst < 2e-7);
}

}  // namespace

TEST_CASE("the vertices' colours are a base colour of their own", "[flow]") {
  const bool has_uvs = GENERATE(true, false);
  const TempFolder folder;
  const std::string source = write_square(folder.file("s.glb"), {kAffine, "VEC3", has_uvs, "", {}});
  const std::string target = write_square(folder.file("t.glb"), {});
  TransferOptions options = job(source, target, folder.file("o.exr"));
  options.image.depth = Depth::float32;
  const Report report = transfer(options);
  CHECK_THAT(notes_of(report), Contains("its vertex colours are multiplied into baseColor"));
  check_affine(read_whole_image(options.output));

  options.image.size.reset();
  try {
    transfer(options);
    FAIL("no size, no error");
  } catch (const Error& error) {
    CHECK(error.kind() == ErrorKind::usage);
    CHECK_THAT(error.what(), Contains("s.glb has no texture that determines the image size") &&
                                 Contains("--size"));
  }
}

TEST_CASE("a texture and its factor are multiplied by the vertices' colours in linear light",
          "[flow]") {
  // sRGB 200, 100, 50 are 0.5776, 0.1274, 0.0319 in linear light; half of them 146, 71, 34.
  const TempFolder folder;
  write_plain(folder.file("skin.png"), 200, 100, 50);
  const std::string target = write_square(folder.file("t.glb"), {});
  const auto made = [&](const Square& square, const std::function<void(TransferOptions&)>& set) {
    const std::string source = write_square(folder.file("s.glb"), square);
    TransferOptions options = job(source, target, folder.file("o.png"));
    set(options);
    transfer(options);
    return read_whole_image(options.output);
  };
  const auto plain = [](TransferOptions&) {};
  const std::vector<double> half{146 / 255., 71 / 255., 34 / 255.};
  const std::vector<double> whole{200 / 255., 100 / 255., 50 / 255.};
  const std::vector<float> grey = everywhere({.5F, .5F, .5F});
  check_all(made({grey, "VEC3", true, "skin.png", {}}, plain), half, 1e-9);
  check_all(made({everywhere({1, 1, 1}), "VEC3", true, "skin.png", {.5, .5, .5, 1}}, plain), half,
            1e-9);
  const double root = std::sqrt(.5);
  check_all(made({everywhere({static_cast<float>(root), static_cast<float>(root),
                              static_cast<float>(root)}),
                  "VEC3",
                  true,
                  "skin.png",
                  {root, root, root, 1}},
                 plain),
            half, 1e-9);
  check_all(made({grey, "VEC3", true, "skin.png", {}},
                 [](TransferOptions& o) { o.material.apply_vertex_colours = false; }),
            whole, 1e-9);
  check_all(made({grey, "VEC3", true, "skin.png", {}},
                 [](TransferOptions& o) { o.mesh.method = Method::gaussian; }),
            half, 1e-9);
  // Given in place of what the material says, an image of the user's is what it is; in place of its
  // own texture it is that.
  const auto given = [&](TransferOptions& o) {
    o.material.textures = {{Channel::base_color, folder.file("skin.png")}};
  };
  check_all(made({grey, "VEC3", true, "", {}}, given), whole, 1e-9);
  check_all(made({grey, "VEC3", true, "skin.png", {}}, given), half, 1e-9);
}

TEST_CASE("a grey texture takes the vertices' colour", "[flow]") {
  const TempFolder folder;
  write_whole_image(folder.file("skin.png"),
                    {kSize, kSize, 1, false, std::vector<double>(kSize * kSize, 200 / 255.)});
  const std::string source =
      write_square(folder.file("s.glb"), {everywhere({.5F, 1, 0}), "VEC3", true, "skin.png", {}});
  TransferOptions options =
      job(source, write_square(folder.file("t.glb"), {}), folder.file("o.png"));
  transfer(options);
  check_all(read_whole_image(options.output), {146 / 255., 200 / 255., 0}, 1e-9);
}

TEST_CASE("a source whose colours changed is another one, at any budget", "[flow]") {
  const TempFolder folder;
  WholeImage image{64, 64, 3, false, {}};
  for (std::uint32_t i = 0; i < 64 * 64 * 3; ++i) image.samples.push_back(i % 251 / 250.0);
  write_whole_image(folder.file("skin.png"), image);
  const std::string target = write_square(folder.file("t.glb"), {});
  const auto made = [&](const std::vector<float>& colours, const char* cache, unsigned threads,
                        std::uint64_t megabytes) {
    const std::string source =
        write_square(folder.file("s.glb"), {colours, "VEC3", true, "skin.png", {}});
    TransferOptions options = job(source, target, folder.file("o.exr"));
    options.image.size = ImageSize{300, 200};
    options.resources.use_cache = true;
    options.resources.cache_dir = folder.file(cache);
    options.resources.memory_bytes = megabytes << 20;
    options.resources.threads = threads;
    transfer(options);
    return read_whole_image(options.output).samples;
  };
  const auto first = made(kAffine, "a", 2, 256);
  CHECK(made(kAffine, "a", 1, 64) == first);
  CHECK(made(kAffine, "b", 1, 64) == first);
  std::vector<float> others = kAffine;
  others[4] = .75F;
  const auto second = made(others, "a", 2, 256);
  CHECK(second != first);
  CHECK(made(others, "c", 2, 256) == second);
}

TEST_CASE("an opacity of the vertices becomes the image's alpha", "[flow]") {
  const TempFolder folder;
  write_plain(folder.file("skin.png"), 200, 100, 50);
  const std::string source = write_square(
      folder.file("s.glb"), {everywhere({1, 1, 1, .25F}), "VEC4", true, "skin.png", {}});
  const std::string target = write_square(folder.file("t.glb"), {});
  TransferOptions options = job(source, target, folder.file("o.png"));
  transfer(options);
  check_all(read_whole_image(options.output), {200 / 255., 100 / 255., 50 / 255., 64 / 255.}, 1e-9);
  options.output = folder.file("o.jpg");
  const Report report = transfer(options);
  REQUIRE(report.warnings.size() == 1);
  CHECK_THAT(report.warnings[0], Contains("baseColor: the vertices' opacity is left out"));
}

TEST_CASE("they are baked by themselves, whatever the texture", "[flow]") {
  const TempFolder folder;
  write_plain(folder.file("skin.png"), 200, 100, 50);
  const std::string source =
      write_square(folder.file("s.glb"), {kAffine, "VEC3", true, "skin.png", {}});
  const std::string target = write_square(folder.file("t.glb"), {});
  TransferOptions options = job(source, target, folder.file("<CHANNEL>.exr"));
  options.channels.baked = {Channel::vertex_color};
  options.material.apply_factors = options.material.apply_vertex_colours = false;
  options.image.depth = Depth::float32;
  const Report report = transfer(options);
  CHECK_THAT(notes_of(report), !Contains("vertex colours"));
  check_affine(read_whole_image(folder.file("vertexColor.exr")));
}

TEST_CASE("vertices' colours are converted to the output's primaries", "[flow]") {
  // Red of sRGB in ACEScg: 0.6131, 0.0702, 0.0206 (the matrix of the ACES project, 4 digits).
  const TempFolder folder;
  const std::string source =
      write_square(folder.file("s.glb"), {everywhere({1, 0, 0}), "VEC3", true, "", {1, .5, .5, 1}});
  const std::string target = write_square(folder.file("t.glb"), {});
  TransferOptions options = job(source, target, folder.file("<CHANNEL>.exr"));
  options.channels.transferred = {Channel::base_color};
  options.channels.baked = {Channel::vertex_color};
  options.image.depth = Depth::float32;
  options.image.colour_space = "acescg";
  options.mesh.method = GENERATE(Method::surface, Method::gaussian);
  if (options.mesh.method == Method::gaussian) options.channels.baked.clear();
  transfer(options);
  check_all(read_whole_image(folder.file("baseColor.exr")), {.6131, .0702, .0206}, 1e-4);
  if (options.mesh.method == Method::surface)
    check_all(read_whole_image(folder.file("vertexColor.exr")), {.6131, .0702, .0206}, 1e-4);
}

TEST_CASE("white vertices change nothing", "[flow]") {
  const TempFolder folder;
  WholeImage image{kSize, kSize, 3, false, {}};
  for (std::uint32_t i = 0; i < kSize * kSize * 3; ++i) image.samples.push_back(i % 97 / 96.0);
  write_whole_image(folder.file("skin.png"), image);
  const std::string target = write_square(folder.file("t.glb"), {});
  const auto made = [&](const std::vector<float>& colours) {
    const std::string source =
        write_square(folder.file("s.glb"), {colours, "VEC3", true, "skin.png", {}});
    TransferOptions options = job(source, target, folder.file("o.png"));
    const Report report = transfer(options);
    CHECK(report.notes.empty());
    return read_whole_image(options.output).samples;
  };
  const std::vector<double> none = made({});
  CHECK(made(everywhere({1, 1, 1})) == none);
  TransferOptions options = job(folder.file("s.glb"), target, folder.file("o.png"));
  options.channels.baked = {Channel::vertex_color};
  CHECK_THROWS_WITH(transfer(options), Contains("its vertices are all white"));
}

TEST_CASE("Gaussians of a mesh have its vertices' colours", "[flow]") {
  // One of 0.5 in linear light: 0.7354 coded, and (that - 0.5) / 0.28209 as the file holds it.
  const TempFolder folder;
  const std::string source =
      write_square(folder.file("s.glb"), {everywhere({.5F, 1, 0}), "VEC3", true, "", {}});
  GaussiansOptions options;
  options.source = source;
  options.output = folder.file("s.ply");
  options.resources.use_cache = false;
  CHECK(gaussians(options).source_gaussians == 2);
  const std::string target = write_square(folder.file("t.glb"), {});
  TransferOptions back = job(options.output, target, folder.file("o.png"));
  transfer(back);
  check_all(read_whole_image(back.output), {188 / 255., 1, 0}, 3 / 255.);
}

}  // namespace pounce::test
