// SPDX-License-Identifier: Apache-2.0
//
// What inspect says of an EXR's layers, which is what can be named behind its path.
#include <OpenImageIO/imageio.h>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "io/image/read.h"
#include "pounce/inspect.h"
#include "support/test_data.h"
#include "unit/io/image_files.h"

using namespace pounce;
using Catch::Matchers::Contains;
using Names = std::vector<std::string>;

namespace {

struct Part {
  std::string name;
  Names channels;
};

std::string write_exr(const test::TempFolder& folder, const std::vector<Part>& parts) {
  const std::string path = folder.file("several.exr");
  std::vector<OIIO::ImageSpec> specs;
  for (const Part& part : parts) {
    OIIO::ImageSpec spec(8, 6, static_cast<int>(part.channels.size()), OIIO::TypeDesc::HALF);
    spec.channelnames = part.channels;
    if (!part.name.empty()) spec.attribute("oiio:subimagename", part.name);
    specs.push_back(spec);
  }
  auto output = OIIO::ImageOutput::create(path);
  REQUIRE(output->open(path, static_cast<int>(specs.size()), specs.data()));
  for (std::size_t p = 0; p < specs.size(); ++p) {
    if (p > 0) REQUIRE(output->open(path, specs[p], OIIO::ImageOutput::AppendSubimage));
    const std::vector<float> samples(8UL * 6 * parts[p].channels.size(), .25F);
    REQUIRE(output->write_image(OIIO::TypeDesc::FLOAT, samples.data()));
  }
  REQUIRE(output->close());
  return path;
}

/// Can that be read of the file?
std::uint32_t channels_read(const std::string& path, const std::string& wanted) {
  mesh::ImageRef image = test::at_path(path);
  image.channels = wanted;
  return io::ImageReader(image).info().channels;
}

}  // namespace

TEST_CASE("inspect lists the layers of an EXR, each of which can be named", "[image][inspect]") {
  const test::TempFolder folder;
  const std::string path =
      write_exr(folder, {{"beauty", {"R", "G", "B", "A"}}, {"other", {"spec.Y", "id"}}});
  const auto json = nlohmann::json::parse(inspect_json(path));
  CHECK(json["channels"] == 4);
  REQUIRE(json["layers"].size() == 3);
  const std::vector<Part> wanted{
      {"beauty", {"R", "G", "B", "A"}}, {"other", {"id"}}, {"spec", {"Y"}}};
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    CHECK(json["layers"][i]["name"] == wanted[i].name);
    CHECK(json["layers"][i]["channels"].get<Names>() == wanted[i].channels);
    CHECK(channels_read(path, wanted[i].name) == wanted[i].channels.size());
  }
  const std::string text = inspect_text(path);
  CHECK_THAT(text, Contains("8 x 6, 4 channels with alpha, half"));
  CHECK_THAT(
      text,
      Contains("\nlayer      beauty: R, G, B, A\nlayer      other: id\nlayer      spec: Y\n"));
}

TEST_CASE("an EXR of layers alone is told, too", "[image][inspect]") {
  const test::TempFolder folder;
  const std::string path = write_exr(
      folder, {{"", {"diffuse.R", "diffuse.G", "diffuse.B", "gloss.R", "gloss.G", "gloss.B"}}});
  CHECK_THROWS_AS(io::ImageReader(path), Error);
  const auto json = nlohmann::json::parse(inspect_json(path));
  CHECK(json["channels"] == 0);
  CHECK(json["width"] == 8);
  CHECK(json["layers"].size() == 2);
  const std::string text = inspect_text(path);
  CHECK_THAT(text, Contains("8 x 6, channels in layers"));
  CHECK_THAT(text, Contains("layer      gloss: R, G, B"));
  CHECK(channels_read(path, "gloss") == 3);
}

TEST_CASE("an image of one layer has no list of them in its text", "[image][inspect]") {
  const test::TempFolder folder;
  const std::string path = write_exr(folder, {{"", {"R", "G", "B"}}});
  CHECK_THAT(inspect_text(path), !Contains("layer"));
  test::write_file(folder.file("a.png"),
                   test::make_png(4, 4, 8, 2, false, std::string(4 * 13, '\0')));
  CHECK_FALSE(nlohmann::json::parse(inspect_json(folder.file("a.png"))).contains("layers"));
}

TEST_CASE("what a decoder cannot do is no damage", "[image][inspect]") {
  const test::TempFolder folder;
  const std::string path = write_exr(folder, {{"", {"B", "G", "R"}}});
  std::string bytes = test::read_file(path);
  // In the list of channels: name, type, linear and 3 bytes, samplings of 4 bytes each.
  const std::string name("B\0\1\0\0\0", 6);
  const std::size_t at = bytes.find(name);
  REQUIRE(at != std::string::npos);
  bytes[at + 10] = bytes[at + 14] = 2;
  test::write_file(path, bytes);
  std::string error;
  try {
    io::ImageReader{path};
  } catch (const Error& e) {
    CHECK(e.kind() == ErrorKind::input);
    error = e.what();
  }
  CHECK_THAT(error, Contains("not supported") && Contains("convert it"));
  CHECK_THAT(error, !Contains("damaged"));
}
