// SPDX-License-Identifier: Apache-2.0
#include <OpenImageIO/imageio.h>

#include <catch2/catch.hpp>
#include <thread>

#include "core/portable_math.h"
#include "io/files/asset_file.h"
#include "pounce/error.h"
#include "support/test_data.h"
#include "unit/io/image_files.h"

using namespace pounce;
using test::at_path;
using test::in_memory;
using test::make_png;
using test::read_all;
using Samples = std::vector<std::uint8_t>;
using Catch::Matchers::Contains;

namespace {

/// Writes with OpenImageIO itself, with any attributes: what other programs make.
void write_foreign(const std::string& path, OIIO::ImageSpec spec, const void* samples,
                   OIIO::TypeDesc type = OIIO::TypeDesc::UNKNOWN) {
  auto output = OIIO::ImageOutput::create(path);
  REQUIRE(output);
  REQUIRE(output->open(path, spec));
  if (type == OIIO::TypeDesc::UNKNOWN) type = spec.format;
  REQUIRE(output->write_image(type, samples));
  REQUIRE(output->close());
}

Samples noise(std::size_t count) {
  Samples samples(count);
  std::uint32_t state = 7;
  for (auto& sample : samples)
    sample = static_cast<std::uint8_t>((state = state * 1664525U + 1013904223U) >> 24);
  return samples;
}

std::string why_refused(const mesh::ImageRef& image, ErrorKind kind = ErrorKind::input) {
  try {
    read_all(image);
  } catch (const Error& error) {
    CHECK(error.kind() == kind);
    return error.what();
  }
  return "accepted";
}

}  // namespace

TEST_CASE("samples below 8 bits are scaled to 0..255", "[image]") {
  // One row each: 1 bit 1,0,1; 2 bits 0,1,2,3; 4 bits 0,7,15.
  CHECK(read_all(in_memory(make_png(3, 1, 1, 0, false, std::string("\0\xA0", 2)))) ==
        Samples{255, 0, 255});
  CHECK(read_all(in_memory(make_png(4, 1, 2, 0, false, std::string("\0\x1B", 2)))) ==
        Samples{0, 85, 170, 255});
  CHECK(read_all(in_memory(make_png(3, 1, 4, 0, false, std::string("\0\x07\xF0", 3)))) ==
        Samples{0, 119, 255});
}

TEST_CASE("16 bit samples are in the machine's byte order", "[image]") {
  io::ImageReader reader(
      in_memory(make_png(2, 1, 16, 0, false, std::string("\0\x12\x34\xFF\xFE", 5))));
  CHECK(reader.info().depth == Depth::u16);
  CHECK(reader.row_bytes() == 4);
  std::uint16_t samples[2] = {};
  reader.read_rows(1, reinterpret_cast<std::byte*>(samples));
  CHECK(samples[0] == 0x1234);
  CHECK(samples[1] == 0xFFFE);
}

TEST_CASE("palettes are expanded, with their transparency as straight alpha", "[image]") {
  const std::string palette("\x0A\x14\x1E\xC8\x64\x32", 6);
  const std::string row("\0\x40", 2);  // 1 bit: 0, 1
  CHECK(read_all(in_memory(make_png(2, 1, 1, 3, false, row, palette))) ==
        Samples{10, 20, 30, 200, 100, 50});
  const auto with_alpha =
      in_memory(make_png(2, 1, 1, 3, false, row, palette, std::string("\x40\x00", 2)));
  CHECK(read_all(with_alpha) == Samples{10, 20, 30, 64, 200, 100, 50, 0});
  CHECK(io::ImageReader(with_alpha).info().has_alpha);
}

TEST_CASE("an interlaced PNG reads like any other and says that it decodes whole", "[image]") {
  // 2 x 2: pass 1 holds (0,0), pass 6 (1,0), pass 7 row 1.
  const auto image =
      in_memory(make_png(2, 2, 8, 0, true, std::string("\0\x01\0\x02\0\x03\x04", 7)));
  CHECK(read_all(image, 1) == Samples{1, 2, 3, 4});
  CHECK(io::ImageReader(image).info().decoder_bytes >= 4);
}

TEST_CASE("an image inside a file is read from its byte range alone", "[image]") {
  test::TempFolder folder;
  const Samples samples = noise(40 * 30 * 3);
  for (const std::string ending : {"png", "tif", "exr", "ppm", "jpg"}) {
    CAPTURE(ending);
    const std::string path = folder.file("a." + ending);
    write_foreign(path, OIIO::ImageSpec(40, 30, 3, OIIO::TypeDesc::UINT8), samples.data());
    const std::string encoded = test::read_file(path);
    const Samples whole = read_all(at_path(path));
    if (ending == "png" || ending == "tif" || ending == "ppm") CHECK(whole == samples);
    CHECK(read_all(in_memory(encoded), 7) == whole);

    test::write_file(folder.file("pack"), std::string(1001, 'x') + encoded + std::string(500, 'y'));
    mesh::ImageRef range = at_path(folder.file("pack"));
    range.offset_bytes = 1001;
    range.size_bytes = encoded.size();
    CHECK(read_all(range, 7) == whole);
    CHECK(io::hash_image(range) == io::hash_image(in_memory(encoded)));
    range.size_bytes = encoded.size() - 30;  // what follows in the file must not help
    CHECK_THAT(why_refused(range), Contains("pack"));
    range.size_bytes = encoded.size() + 501;
    CHECK_THAT(why_refused(range), Contains("is truncated"));
  }
}

TEST_CASE("the content tells the format, whatever the ending says", "[image]") {
  test::TempFolder folder;
  test::write_file(folder.file("a.jpg"), make_png(1, 1, 8, 0, false, std::string("\0\x05", 2)));
  CHECK(io::ImageReader(folder.file("a.jpg")).info().format == "png");
  test::write_file(folder.file("b.png"), "not an image at all");
  CHECK_THAT(why_refused(at_path(folder.file("b.png"))),
             Contains("b.png") && Contains("not an image"));
}

TEST_CASE("tiled files read like the same image in scanlines", "[image]") {
  test::TempFolder folder;
  const std::string ending = GENERATE("tif", "exr");
  std::vector<float> samples(70 * 45 * 3);
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i] = static_cast<float>(i) / 64;
  OIIO::ImageSpec spec(70, 45, 3, OIIO::TypeDesc::FLOAT);
  spec.tile_width = spec.tile_height = 16;
  write_foreign(folder.file("tiled." + ending), spec, samples.data());
  const std::uint32_t strip = GENERATE(1U, 16U, 17U, 45U);
  const Samples read = read_all(at_path(folder.file("tiled." + ending)), strip);
  REQUIRE(read.size() == samples.size() * 4);
  CHECK(std::memcmp(read.data(), samples.data(), read.size()) == 0);
}

TEST_CASE("premultiplied colours of an EXR are handed out straight", "[image]") {
  test::TempFolder folder;
  const float samples[] = {0.25F, 0.5F, 0.125F, 0.5F, 3, 2, 1, 0};
  OIIO::ImageSpec spec(2, 1, 4, OIIO::TypeDesc::FLOAT);
  write_foreign(folder.file("a.exr"), spec, samples);
  io::ImageReader reader(folder.file("a.exr"));
  CHECK(reader.info().linear);
  CHECK(reader.info().has_alpha);
  float read[8] = {};
  reader.read_rows(1, reinterpret_cast<std::byte*>(read));
  CHECK(std::vector<float>(read, read + 8) == std::vector<float>{0.5F, 1, 0.25F, 0.5F, 3, 2, 1, 0});
}

TEST_CASE("associated alpha of a TIFF is divided out, unassociated is not", "[image]") {
  test::TempFolder folder;
  const std::uint8_t samples[] = {50, 100, 0, 100};
  OIIO::ImageSpec spec(1, 1, 4, OIIO::TypeDesc::UINT8);
  write_foreign(folder.file("associated.tif"), spec, samples);
  CHECK(read_all(at_path(folder.file("associated.tif"))) == Samples{128, 255, 0, 100});  // 127.5 up
  spec.attribute("oiio:UnassociatedAlpha", 1);
  write_foreign(folder.file("straight.tif"), spec, samples);
  CHECK(read_all(at_path(folder.file("straight.tif"))) == Samples{50, 100, 0, 100});
}

TEST_CASE("of an EXR with many channels R, G, B are read by name", "[image]") {
  test::TempFolder folder;
  OIIO::ImageSpec spec(1, 1, 6, OIIO::TypeDesc::FLOAT);
  spec.channelnames = {"depth.Z", "R", "G", "B", "normal.X", "normal.Y"};
  const float samples[] = {9, 1, 2, 3, 8, 7};
  write_foreign(folder.file("a.exr"), spec, samples);
  io::ImageReader reader(folder.file("a.exr"));
  REQUIRE(reader.info().channels == 3);
  float read[3] = {};
  reader.read_rows(1, reinterpret_cast<std::byte*>(read));
  CHECK(std::vector<float>(read, read + 3) == std::vector<float>{1, 2, 3});

  spec.channelnames = {"a", "b", "c", "d", "e", "f"};
  write_foreign(folder.file("b.exr"), spec, samples);
  CHECK_THAT(why_refused(at_path(folder.file("b.exr"))),
             Contains("b.exr") && Contains("6 channels (b, a, c, d, e, f)"));
}

TEST_CASE("channels are chosen by their names, alpha only where the file says so", "[image]") {
  using Names = std::vector<std::string>;
  struct Case {
    Names names;
    int alpha;
    Names chosen;
    bool has_alpha;
    Names left_out;
  };
  const std::vector<Case> cases{
      {{"R", "G", "B", "A"}, 3, {"R", "G", "B", "A"}, true, {}},
      {{"R", "G", "B", "disp"}, -1, {"R", "G", "B", "disp"}, false, {}},
      {{"R", "G", "B", "disp", "id"}, -1, {"R", "G", "B"}, false, {"disp", "id"}},
      {{"R", "G", "B", "A", "Z"}, 3, {"R", "G", "B", "A"}, true, {"Z"}},
      {{"Y"}, -1, {"Y"}, false, {}},
      {{"A"}, 0, {"A"}, false, {}},
      {{"Y", "A"}, 1, {"Y", "A"}, true, {}},
      {{"Y", "A", "Z"}, 1, {"Y", "A"}, true, {"Z"}},
      {{"Y", "Z"}, -1, {"Y", "Z"}, false, {}},
      {{"R", "G"}, -1, {"R", "G"}, false, {}},
      {{"R", "G", "A", "disp"}, 2, {"R", "G", "A", "disp"}, false, {}},
      {{"R", "G", "B", "channel3", "A"}, 4, {"R", "G", "B", "A"}, true, {"channel3"}},
      {{"r", "g", "b"}, -1, {"r", "g", "b"}, false, {}},
      {{"d.R", "d.G", "d.B", "d.A", "Z"}, 3, {"d.R", "d.G", "d.B", "d.A"}, true, {"Z"}},
      {{"R", "G", "B", "d.A"}, 3, {"R", "G", "B", "d.A"}, false, {}},
      {{"R", "G", "B", "d.R", "d.G", "d.B"}, -1, {"R", "G", "B"}, false, {"d.R", "d.G", "d.B"}},
      // Views of a stereo file: the default one, which has no name, else the left one.
      {{"Y", "right.Y"}, -1, {"Y"}, false, {"right.Y"}},
      {{"Y", "A", "right.Y", "right.A"}, 1, {"Y", "A"}, true, {"right.Y", "right.A"}},
      {{"right.Y", "Y"}, -1, {"Y"}, false, {"right.Y"}},
      {{"R", "G", "B", "right.R", "right.G", "right.B"},
       -1,
       {"R", "G", "B"},
       false,
       {"right.R", "right.G", "right.B"}},
      {{"left.Y", "right.Y"}, -1, {"left.Y"}, false, {"right.Y"}},
      {{"left.R", "left.G", "left.B", "right.R", "right.G", "right.B"},
       -1,
       {"left.R", "left.G", "left.B"},
       false,
       {"right.R", "right.G", "right.B"}},
      {{"Y", "depth.Z"}, -1, {"Y", "depth.Z"}, false, {}},
      {{"c.R", "c.G", "c.B", "d.R", "d.G", "d.B"}, -1, {}, false, {}},
  };
  for (const Case& c : cases) {
    const io::ChosenChannels chosen = io::choose_channels(c.names, c.alpha);
    CAPTURE(io::joined(c.names));
    CHECK(chosen.names == c.chosen);
    CHECK(chosen.has_alpha == c.has_alpha);
    CHECK(chosen.left_out == c.left_out);
  }
}

TEST_CASE("layers and channels are chosen as the user names them", "[image]") {
  using Names = std::vector<std::string>;
  const Names file{"A", "B",         "G",   "R",   "diffuse.A", "diffuse.B", "diffuse.G",
                   "Z", "diffuse.R", "N.X", "N.Y", "N.Z",       "B.R",       "a.b.Y"};
  struct Case {
    std::string wanted;
    Names chosen;
    bool has_alpha;
  };
  const std::vector<Case> cases{
      {"diffuse", {"diffuse.R", "diffuse.G", "diffuse.B", "diffuse.A"}, true},
      {"diffuse.R,G,B", {"diffuse.R", "diffuse.G", "diffuse.B"}, false},
      {"diffuse.R,diffuse.G", {"diffuse.R", "diffuse.G"}, false},
      {"diffuse.G,A", {"diffuse.G", "diffuse.A"}, true},
      {"diffuse.A,R", {"diffuse.A", "diffuse.R"}, false},
      {"diffuse.R,Z", {"diffuse.R", "Z"}, false},
      {"A", {"A"}, false},
      {"Z", {"Z"}, false},
      {"B", {"B"}, false},  // a channel before a layer
      {"N", {"N.X", "N.Y", "N.Z"}, false},
      {"a.b", {"a.b.Y"}, false},
      {"B,G,R,Z", {"B", "G", "R", "Z"}, false},
      {"R,R", {}, false},
      {"R,G,B,A,Z", {}, false},
      {"R,", {}, false},
      {"depth", {}, false},
      {"diffuse.Q", {}, false},
      {"DIFFUSE", {}, false},
  };
  for (const Case& c : cases) {
    CAPTURE(c.wanted);
    const io::ChosenChannels chosen = io::named_channels(file, c.wanted);
    CHECK(chosen.names == c.chosen);
    CHECK(chosen.has_alpha == c.has_alpha);
    REQUIRE(chosen.places.size() == c.chosen.size());
    for (std::size_t i = 0; i < c.chosen.size(); ++i)
      CHECK(file[static_cast<std::size_t>(chosen.places[i])] == c.chosen[i]);
  }
}

TEST_CASE("channels stand behind the path of an EXR", "[image]") {
  test::TempFolder folder;
  CHECK(io::split_channels("a.exr:N.X,Y").file == "a.exr");
  CHECK(io::split_channels("a.exr:N.X,Y").channels == "N.X,Y");
  CHECK(io::split_channels("b:c/a.<UDIM>.EXR:d").channels == "d");
  for (const char* path : {"a.exr", "a.png:R", "a.exr:", ".exr:R", "c:a.exr", ""}) {
    CAPTURE(path);
    CHECK(io::split_channels(path).file == path);
  }
  test::write_file(folder.file("a.exr:R"), "x");
  CHECK(io::split_channels(folder.file("a.exr:R")).channels.empty());

  OIIO::ImageSpec spec(1, 1, 6, OIIO::TypeDesc::FLOAT);
  spec.channelnames = {"depth.Z", "R", "G", "B", "normal.X", "normal.Y"};
  const float samples[] = {9, 1, 2, 3, 8, 7};
  write_foreign(folder.file("a.exr"), spec, samples);
  mesh::ImageRef image = at_path(folder.file("a.exr"));
  image.channels = "normal.Y,X";
  io::ImageReader reader(image);
  float read[2] = {};
  REQUIRE(reader.info().channels == 2);
  reader.read_rows(1, reinterpret_cast<std::byte*>(read));
  CHECK((read[0] == 7 && read[1] == 8));
  CHECK(reader.info().left_out.empty());
  image.channels = "normal.Z";
  CHECK_THAT(why_refused(image), Contains("\"normal.Z\" names neither a layer nor 1 to 4 different "
                                          "channels of this file; it has") &&
                                     Contains("normal.X"));
  image = in_memory(make_png(1, 1, 8, 0, false, std::string("\0a", 2)));
  image.channels = "R";
  CHECK_THAT(why_refused(image), Contains("which apply only to EXR files"));
}

TEST_CASE("channels are found in whichever part of an EXR has them", "[image]") {
  test::TempFolder folder;
  const std::string path = folder.file("parts.exr");
  struct Written {
    std::string name;
    std::vector<std::string> channels;
    int size;
  };
  // Each sample says its part, its row and its channel.
  const std::vector<Written> parts{{"beauty", {"R", "G", "B", "A"}, 4},
                                   {"diffuse", {"R", "G", "B"}, 4},
                                   {"other", {"spec.R", "spec.G", "spec.B", "id"}, 4}};
  std::vector<OIIO::ImageSpec> specs;
  for (const Written& part : parts) {
    OIIO::ImageSpec spec(part.size, part.size, static_cast<int>(part.channels.size()),
                         OIIO::TypeDesc::FLOAT);
    spec.channelnames = part.channels;
    spec.attribute("oiio:subimagename", part.name);
    specs.push_back(spec);
  }
  auto output = OIIO::ImageOutput::create(path);
  REQUIRE(output);
  const bool opened = output->open(path, 3, specs.data());
  INFO(output->geterror());
  REQUIRE(opened);
  for (std::size_t p = 0; p < parts.size(); ++p) {
    if (p > 0) REQUIRE(output->open(path, specs[p], OIIO::ImageOutput::AppendSubimage));
    std::vector<float> samples;
    for (int texel = 0; texel < parts[p].size * parts[p].size; ++texel) {
      for (std::size_t c = 0; c < parts[p].channels.size(); ++c)
        samples.push_back(static_cast<float>(p) + static_cast<float>(texel / parts[p].size) / 16 +
                          static_cast<float>(c) / 256);
    }
    REQUIRE(output->write_image(OIIO::TypeDesc::FLOAT, samples.data()));
  }
  REQUIRE(output->close());
  struct Case {
    std::string wanted;
    float part;
    std::vector<int> channels;  ///< of it
    std::uint32_t size;
    std::vector<std::string> names;
  };
  const std::vector<Case> cases{{"", 0, {0, 1, 2, 3}, 4, {"R", "G", "B", "A"}},
                                {"beauty", 0, {0, 1, 2, 3}, 4, {"R", "G", "B", "A"}},
                                {"R", 0, {0}, 4, {"R"}},
                                {"diffuse", 1, {0, 1, 2}, 4, {"R", "G", "B"}},
                                {"diffuse.B,G", 1, {2, 1}, 4, {"B", "G"}},
                                {"spec", 2, {0, 1, 2}, 4, {"spec.R", "spec.G", "spec.B"}},
                                {"other.id", 2, {3}, 4, {"id"}}};
  for (const Case& c : cases) {
    CAPTURE(c.wanted);
    mesh::ImageRef image = at_path(path);
    image.channels = c.wanted;
    io::ImageReader reader(image);
    reader.keep_premultiplied();
    REQUIRE(reader.info().width == c.size);
    CHECK(reader.info().names == c.names);
    REQUIRE(reader.info().channels == c.channels.size());
    std::vector<float> read(c.size * c.size * c.channels.size());
    reader.read_rows(c.size, reinterpret_cast<std::byte*>(read.data()));
    bool all = true;
    for (std::size_t i = 0; i < read.size(); ++i) {
      const std::size_t row = i / (c.size * c.channels.size());
      all = all && read[i] == c.part + static_cast<float>(row) / 16 +
                                  static_cast<float>(c.channels[i % c.channels.size()]) / 256;
    }
    CHECK(all);
    if (c.wanted.empty()) {
      CHECK(reader.info().left_out == std::vector<std::string>{"diffuse.R", "diffuse.G",
                                                               "diffuse.B", "other.id", "spec.R",
                                                               "spec.G", "spec.B"});
    }
  }
  mesh::ImageRef image = at_path(path);
  image.channels = "gloss";
  CHECK_THAT(why_refused(image), Contains("diffuse.B") && Contains("other.id"));
}

TEST_CASE("channels that are no neighbours are picked from their rows", "[image]") {
  test::TempFolder folder;
  OIIO::ImageSpec spec(3, 70, 5, OIIO::TypeDesc::HALF);
  spec.channelnames = {"B", "id", "G", "R", "z"};
  spec.channelformats = {OIIO::TypeDesc::HALF, OIIO::TypeDesc::UINT, OIIO::TypeDesc::HALF,
                         OIIO::TypeDesc::HALF, OIIO::TypeDesc::FLOAT};
  std::vector<float> samples(3 * 70 * 5);
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i] = static_cast<float>(i % 1000);
  write_foreign(folder.file("a.exr"), spec, samples.data(), OIIO::TypeDesc::FLOAT);
  io::ImageReader reader(folder.file("a.exr"));
  REQUIRE(reader.info().channels == 3);
  CHECK(reader.info().depth == Depth::half);  // of those taken, not of z
  CHECK(reader.info().left_out.size() == 2);
  std::vector<half> read(3 * 70 * 3);
  reader.read_rows(70, reinterpret_cast<std::byte*>(read.data()));
  for (std::size_t t = 0; t < 210; ++t) {
    const float* const texel = &samples[t * 5];
    if (read[3 * t] != texel[3] || read[3 * t + 1] != texel[2] || read[3 * t + 2] != texel[0])
      FAIL("texel " << t);
  }
}

TEST_CASE("the picture of an EXR is its display window, cropped or with overscan", "[image]") {
  test::TempFolder folder;
  // 4 x 3 texels of data at (2, -1), each its own number; the display is 5 x 4 at (0, 0).
  const auto spec_of = [](int tile) {
    OIIO::ImageSpec spec(4, 3, 1, OIIO::TypeDesc::FLOAT);
    spec.x = 2, spec.y = -1;
    spec.full_width = 5, spec.full_height = 4;
    if (tile > 0) spec.tile_width = spec.tile_height = tile;
    return spec;
  };
  std::vector<float> samples(12);
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i] = static_cast<float>(i + 1);
  const int tile = GENERATE(0, 16);
  const std::uint32_t strip = GENERATE(1U, 3U, 4U);
  write_foreign(folder.file("a.exr"), spec_of(tile), samples.data());
  io::ImageReader reader(folder.file("a.exr"));
  CHECK(reader.info().width == 5);
  CHECK(reader.info().height == 4);
  const Samples bytes = read_all(at_path(folder.file("a.exr")), strip);
  std::vector<float> read(20);
  REQUIRE(bytes.size() == read.size() * 4);
  std::memcpy(read.data(), bytes.data(), bytes.size());
  CHECK(read == std::vector<float>{0, 0, 5, 6, 7, 0, 0, 9, 10, 11, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0});
}

TEST_CASE("a progressive JPEG announces the memory of its whole image before it decodes",
          "[image]") {
  test::TempFolder folder;
  const Samples samples = noise(300 * 200 * 3);
  OIIO::ImageSpec spec(300, 200, 3, OIIO::TypeDesc::UINT8);
  write_foreign(folder.file("base.jpg"), spec, samples.data());
  spec.attribute("jpeg:progressive", 1);
  write_foreign(folder.file("progressive.jpg"), spec, samples.data());
  io::ImageReader base(folder.file("base.jpg")), progressive(folder.file("progressive.jpg"));
  // 4:2:0 units of 16 x 16: 19 x 13 of them, 6 blocks of 128 bytes each.
  const std::uint64_t more = progressive.info().decoder_bytes - base.info().decoder_bytes;
  CHECK(more == 19 * 13 * 6 * 128);
  CHECK(progressive.info().width == 300);
  CHECK(progressive.info().channels == 3);
  CHECK(read_all(at_path(folder.file("base.jpg"))) ==
        read_all(at_path(folder.file("progressive.jpg")), 9));
}

TEST_CASE("sizes that no texture has are refused", "[image]") {
  CHECK_THAT(
      why_refused(in_memory(make_png(70000, 1, 8, 0, false, std::string("\0\x01", 2)), "wide.png")),
      Contains("wide.png") && Contains("70000 x 1"));
  CHECK(why_refused(in_memory(make_png(0, 1, 8, 0, false, std::string("\0", 1)))) != "accepted");
}

TEST_CASE("a missing image and one with a known problem say so", "[image]") {
  CHECK_THAT(why_refused(at_path("/no/such/skin.png"), ErrorKind::storage),
             Contains("skin.png") && Contains("No such file"));
  CHECK_THAT(why_refused(at_path("/"), ErrorKind::storage), Contains("not a file"));
  CHECK_THAT(why_refused(in_memory("")), Contains("empty"));
  mesh::ImageRef image = in_memory("x", "head.glb image 2");
  image.problem = "needs KHR_texture_basisu";
  CHECK(why_refused(image) == "head.glb image 2: needs KHR_texture_basisu");
  image.problem = "the file is not there";
  image.missing = true;
  CHECK(why_refused(image, ErrorKind::storage) == "head.glb image 2: the file is not there");
}

TEST_CASE("several readers work at once", "[image]") {
  test::TempFolder folder;
  const Samples samples = noise(200 * 150 * 3);
  write_foreign(folder.file("a.png"), OIIO::ImageSpec(200, 150, 3, OIIO::TypeDesc::UINT8),
                samples.data());
  std::vector<Samples> read(8);
  std::vector<std::thread> threads;
  for (auto& result : read) {
    threads.emplace_back([&] { result = read_all(at_path(folder.file("a.png")), 11); });
  }
  for (auto& thread : threads) thread.join();
  for (const auto& result : read) CHECK(result == samples);
}
