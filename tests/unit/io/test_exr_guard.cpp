// SPDX-License-Identifier: Apache-2.0
//
// EXRs made by hand, with blocks that hold less than they should.
#include <OpenImageIO/imageio.h>
#include <zlib.h>

#include <catch2/catch.hpp>
#include <vector>

#include "pounce/error.h"
#include "support/test_data.h"
#include "unit/io/image_files.h"

using namespace pounce;
using Catch::Contains;
using test::in_memory;

namespace {

std::string number(std::uint64_t n, int bytes) {
  std::string out;
  for (; bytes-- > 0; n >>= 8) out += static_cast<char>(n);
  return out;
}

std::string attribute(const std::string& name, const std::string& type, const std::string& value) {
  return name + '\0' + type + '\0' + number(value.size(), 4) + value;
}

/// 4 x 2 texels of one half.
struct Made {
  std::uint8_t coding = 0;
  std::uint32_t sampling = 1;
  std::string tiles = "";
  std::vector<std::string> blocks{};  ///< one after another, rows from the top
  std::uint32_t block_rows = 1;
  std::uint32_t flags_of_tiles = 0x200;
  std::string type = "";

  std::string file() const {
    const std::string box = number(0, 8) + number(3, 4) + number(1, 4);
    const std::string channel = std::string("Y") + '\0' + number(1, 4) + number(0, 4) +
                                number(sampling, 4) + number(sampling, 4) + '\0';
    std::string out = "\x76\x2f\x31\x01" + number(tiles.empty() ? 2 : 2 + flags_of_tiles, 4) +
                      attribute("channels", "chlist", channel) +
                      attribute("compression", "compression", number(coding, 1)) +
                      attribute("dataWindow", "box2i", box) +
                      attribute("displayWindow", "box2i", box) +
                      attribute("lineOrder", "lineOrder", number(0, 1)) +
                      attribute("pixelAspectRatio", "float", number(0x3F800000, 4)) +
                      attribute("screenWindowCenter", "v2f", number(0, 8)) +
                      attribute("screenWindowWidth", "float", number(0x3F800000, 4));
    if (!tiles.empty()) out += attribute("tiles", "tiledesc", tiles);
    if (!type.empty()) {
      out += attribute("chunkCount", "int", number(blocks.size(), 4)) +
             attribute("type", "string", type) + attribute("version", "int", number(1, 4));
    }
    out += '\0';
    std::uint64_t place = out.size() + 8 * blocks.size();
    std::string chunks;
    std::uint32_t row = 0;
    for (const std::string& block : blocks) {
      out += number(place + chunks.size(), 8);
      chunks += tiles.empty() ? number(row, 4) : number(0, 16);
      chunks += number(block.size(), 4) + block;
      row += block_rows;
    }
    return out + chunks;
  }
};

std::string zip(const std::string& plain) {
  uLongf size = ::compressBound(plain.size());
  std::string out(size, '\0');
  ::compress(reinterpret_cast<Bytef*>(out.data()), &size,
             reinterpret_cast<const Bytef*>(plain.data()), plain.size());
  out.resize(size);
  return out;
}

std::string refusal(const std::string& file) {
  try {
    test::read_all(in_memory(file, "a.exr"));
  } catch (const Error& e) {
    CHECK(e.kind() == ErrorKind::input);
    return e.what();
  }
  return "nothing";
}

}  // namespace

TEST_CASE("an EXR that describes tiles and says that it is something else is refused",
          "[image][exr]") {
  // With levels: OpenEXR is asked how many there are, and throws.
  const std::string mipmap = number(4, 4) + number(2, 4) + '\1';
  Made made{.coding = 3, .tiles = mipmap, .blocks = std::vector(4, std::string(10, '\x11'))};
  made.flags_of_tiles = 0x800;  // not an image of the usual kind
  made.type = "deep";           // which no type is called
  // In this process: in the decoder's any exception is a refusal.
  try {
    const io::ImageReader reader(in_memory(made.file(), "a.exr"), {{}, Sandbox::off});
    FAIL("it was opened");
  } catch (const Error& e) {
    CHECK(e.kind() == ErrorKind::input);
    CHECK_THAT(e.what(), Contains("the header of one of its parts cannot be read"));
  }
}

TEST_CASE("an EXR must say itself how large it is and how it is packed", "[image][exr]") {
  const std::string row(8, '\x11');
  const std::string whole = Made{.blocks = {row, row}}.file();
  CHECK(refusal(whole) == "nothing");
  for (const std::string name : {"compression", "dataWindow", "displayWindow"}) {
    std::string without = whole;
    without[without.find(name)] = 'X';
    CHECK_THAT(refusal(without), Contains("has no attribute \"" + name + "\""));
  }
}

TEST_CASE("an EXR that does not list all its chunks is refused", "[image][exr]") {
  const std::string row(8, '\x11');
  Made made{.blocks = {row, row}};
  std::string file = made.file();
  const std::size_t made_without_type = file.size();
  const std::size_t second = file.size() - 2 * (8 + row.size()) - 8;
  file.replace(second, 8, std::string(8, '\0'));
  CHECK_THAT(refusal(file), Contains("no place for chunk 2 of 2"));

  // Whatever the header says of their number.
  made.type = "scanlineimage";
  file = made.file();
  CHECK(refusal(file) == "nothing");
  file.replace(second + (file.size() - made_without_type), 8, std::string(8, '\0'));
  const std::string counted = "chunkCount" + std::string("\0int\0", 5);
  file.replace(file.find(counted) + counted.size() + 4, 4, number(1, 4));
  CHECK_THAT(refusal(file), Contains("no place for chunk 2 of 2"));
}

TEST_CASE("of an EXR's first block each texel must be there", "[image][exr]") {
  const std::string row(8, '\x11'), short_row(6, '\x11'), large(256, '\0');
  const auto rows = [](std::uint8_t coding, const std::string& first, const std::string& second) {
    return Made{.coding = coding, .blocks = {first, second}}.file();
  };
  CHECK(test::read_all(in_memory(rows(0, row, row))) == std::vector<std::uint8_t>(16, 0x11));
  CHECK_THAT(refusal(rows(0, short_row, row)),
             Contains("a.exr: the first chunk of the EXR decodes to 6 bytes instead of 8"));
  CHECK_THAT(refusal(rows(1, std::string(9, '\0'), row)),
             Contains("the first chunk of the EXR has 9 bytes, more than the 8 that it can hold"));
  // Seven more of the same, five more of it.
  CHECK(refusal(rows(1, std::string("\7a"), row)) == "nothing");
  CHECK_THAT(refusal(rows(1, std::string("\5a"), row)),
             Contains("decodes to 6 bytes instead of 8"));
  CHECK_THAT(refusal(rows(1,
                          std::string("\xFE"
                                      "ab\3c"),
                          row)),
             Contains("decodes to 6 bytes instead of 8"));

  // Sixteen rows together, of which there are two; and a tile, of which the image fills a part.
  const auto block = [](const std::string& plain) {
    return Made{.coding = 3, .blocks = {plain}, .block_rows = 16}.file();
  };
  CHECK(refusal(block(zip(std::string(16, '\0')))) == "nothing");
  CHECK_THAT(refusal(block(zip(std::string(10, '\0')))),
             Contains("decodes to 10 bytes instead of 16"));
  CHECK_THAT(refusal(block(zip(std::string(40, '\0')))),
             Contains("decodes to 40 bytes instead of 16"));
  CHECK_THAT(refusal(block("nothing")), Contains("decodes to 0 bytes instead of 16"));
  const std::string tiles = number(16, 4) + number(16, 4) + '\0';
  CHECK(refusal(Made{.tiles = tiles, .blocks = {std::string(16, '\1')}}.file()) == "nothing");
  CHECK_THAT(refusal(Made{.tiles = tiles, .blocks = {std::string(15, '\1')}}.file()),
             Contains("decodes to 15 bytes instead of 16"));

  // By the flags of its version it is a plain image, which is what OpenEXR decodes.
  for (const char* type : {"deeptile", "deeptiled"}) {
    CHECK_THAT(
        refusal(Made{.tiles = tiles, .blocks = {std::string(15, '\1')}, .type = type}.file()),
        Contains("decodes to 15 bytes instead of 16"));
  }
  CHECK_THAT(refusal(Made{.blocks = {short_row, row}, .type = "deepscanline"}.file()),
             Contains("decodes to 6 bytes instead of 8"));
}

TEST_CASE("a block of DWA must hold all channels", "[image][exr]") {
  const test::TempFolder folder;
  const std::string path = folder.file("a.exr");
  constexpr int kWidth = 64, kHeight = 40;
  const std::string coding = GENERATE("dwaa", "dwab");
  {
    OIIO::ImageSpec spec(kWidth, kHeight, 5, OIIO::TypeDesc::HALF);
    spec.channelnames = {"R", "G", "B", "A", "Z"};
    spec.attribute("compression", coding);
    std::vector<float> samples(kWidth * kHeight * 5);
    for (std::size_t i = 0; i < samples.size(); ++i)
      samples[i] = static_cast<float>(i % 997) / 1000;
    const auto out = OIIO::ImageOutput::create(path);
    REQUIRE(out);
    REQUIRE(out->open(path, spec));
    REQUIRE(out->write_image(OIIO::TypeDesc::FLOAT, samples.data()));
    REQUIRE(out->close());
  }
  const std::string whole = test::read_file(path);
  CHECK(refusal(whole) == "nothing");

  // The first block is behind the list of blocks, whose first number is its place.
  std::size_t block = 0;
  for (std::size_t at = 300; block == 0; ++at) {
    REQUIRE(at + 8 < whole.size());
    const std::size_t blocks = coding == "dwaa" ? 2 : 1;
    if (whole.compare(at, 8, number(at + 8 * blocks, 8)) == 0) block = at + 8 * blocks;
  }
  const std::size_t counts = block + 8;
  REQUIRE(whole.compare(counts, 8, number(2, 8)) == 0);
  const auto changed = [&](std::size_t index, int by) {
    std::string file = whole;
    file[counts + 8 * index] = static_cast<char>(file[counts + 8 * index] + by);
    return refusal(file);
  };
  CHECK_THAT(changed(1, -2), Contains("a.exr: the first chunk of the EXR does not contain the "));
  CHECK_THAT(changed(7, -2), Contains("bytes of run-length encoded channels instead of "));
  CHECK_THAT(changed(9, -1), Contains("blocks of 8 x 8 texels"));
  // Once its name is another, a channel is looked for where nothing is.
  std::string renamed = whole;
  renamed[renamed.find(std::string("\0G\0\1", 4)) + 1] = 'H';
  CHECK_THAT(refusal(renamed), Contains("does not contain the "));
  // Deflated samples that end early, though the count is right: another stream in their place.
  std::string early = whole;
  const std::size_t rules = static_cast<unsigned char>(whole[counts + 88]);
  const std::string few = zip("few");
  early.replace(counts + 88 + rules, few.size(), few);
  CHECK_THAT(refusal(early), Contains("does not contain the "));
}

TEST_CASE("an EXR's list of blocks must lead to one", "[image][exr]") {
  std::string file = Made{.blocks = {std::string(8, '\1'), std::string(8, '\1')}}.file();
  const std::size_t list = file.size() - 2 * (8 + 16);
  for (const std::uint64_t place :
       {std::uint64_t{0}, std::uint64_t{file.size()}, ~std::uint64_t{0}}) {
    file.replace(list, 8, number(place, 8));
    CHECK_THAT(refusal(file), Contains("the first chunk of the EXR has 0 bytes at offset"));
  }
}

TEST_CASE("an EXR in blocks of more than 256 MiB is refused unread", "[image][exr]") {
  const std::string block(16, '\1');
  const auto tiles = [&](std::uint32_t across, std::uint32_t down) {
    return refusal(
        Made{.tiles = number(across, 4) + number(down, 4) + '\0', .blocks = {block}}.file());
  };
  // Of two bytes: 2^27 texels are as many as there may be.
  CHECK(tiles(8192, 16384) == "nothing");
  CHECK_THAT(tiles(8193, 16384),
             Contains("tiles of 8193 x 16384 texels with 2 bytes per texel, but at most 256 MiB"));
  CHECK_THAT(tiles(1, 65537), Contains("tiles of 1 x 65537"));
  CHECK_THAT(tiles(0xFFFFFFFF, 0xFFFFFFFF), Contains("save it with smaller tiles"));
}

TEST_CASE("an EXR of luminance and chroma is refused with what to do", "[image][exr]") {
  CHECK_THAT(
      refusal(Made{.sampling = 2, .blocks = {std::string(8, '\1'), std::string(8, '\1')}}.file()),
      Contains("subsampled channels") && Contains("convert it to RGB"));
}

TEST_CASE("an EXR whose values have not their types' lengths is refused", "[image][exr]") {
  // The decoder would go on at another byte than the check.
  const std::vector<std::string> blocks(2, std::string(8, '\1'));
  std::string file = Made{.blocks = blocks}.file();
  const std::size_t at = file.find("v2f") + 4;
  CHECK(file.substr(at, 4) == number(8, 4));
  CHECK_THAT(
      refusal(file.substr(0, at) + number(12, 4) + number(0, 4) + file.substr(at + 4)),
      Contains("\"screenWindowCenter\" of the EXR header has 12 bytes, but its type v2f needs 8"));
  const std::size_t list = file.find("chlist") + 7;
  CHECK(file.substr(list, 4) == number(19, 4));
  CHECK_THAT(refusal(file.substr(0, list) + number(20, 4) + file.substr(list + 4, 19) + '\0' +
                     file.substr(list + 23)),
             Contains("channel list is empty or not terminated"));
  CHECK_THAT(refusal(file.substr(0, list) + number(1, 4) + '\0' + file.substr(list + 23)),
             Contains("channel list is empty or not terminated"));
}

TEST_CASE("an EXR with a channel of no known type is refused", "[image][exr]") {
  // OpenImageIO 2.4 ends the process (signal 6).
  std::string file = Made{.blocks = std::vector<std::string>(2, std::string(8, '\1'))}.file();
  const std::size_t type = file.find("chlist") + 7 + 4 + 2;
  CHECK(file.substr(type, 4) == number(1, 4));
  for (const std::uint32_t unknown : {3U, 0x86000002U}) {
    CHECK_THAT(refusal(file.replace(type, 4, number(unknown, 4))),
               Contains("the unknown sample type " + std::to_string(unknown) + ";"));
  }
}

TEST_CASE("an EXR in parts announces a block of each, read or not", "[image][exr]") {
  const test::TempFolder folder;
  OIIO::ImageSpec small(2048, 16, 1, OIIO::TypeDesc::HALF),
      large(2048, 16, 4, OIIO::TypeDesc::FLOAT);
  small.attribute("compression", "zip");
  small.attribute("oiio:subimagename", "small");
  large.attribute("compression", "zip");
  large.attribute("oiio:subimagename", "large");
  const std::vector<float> samples(2048 * 16 * 4, 0.5F);
  const auto announced = [&](const std::string& name, std::vector<OIIO::ImageSpec> parts) {
    const std::string path = folder.file(name);
    const auto out = OIIO::ImageOutput::create(path);
    REQUIRE(out);
    if (parts.size() == 1) REQUIRE(out->open(path, parts.front()));
    if (parts.size() > 1) REQUIRE(out->open(path, static_cast<int>(parts.size()), parts.data()));
    for (std::size_t i = 0; i < parts.size(); ++i) {
      INFO(name << ' ' << i << ' ' << out->geterror());
      if (i > 0) REQUIRE(out->open(path, parts[i], OIIO::ImageOutput::AppendSubimage));
      REQUIRE(out->write_image(OIIO::TypeDesc::FLOAT, samples.data()));
    }
    REQUIRE(out->close());
    mesh::ImageRef image;
    image.label = image.path = path;
    const io::ImageReader reader(image);
    CHECK(reader.info().width == 2048);
    return reader.info().decoder_bytes;
  };
  constexpr std::uint64_t kSmall = 2048 * 16 * 2, kLarge = 2048 * 16 * 16;
  const std::uint64_t announced_two = announced("two.exr", {small, large});
  CHECK(announced_two == announced("one.exr", {small}) + kSmall + kLarge);

  // A type that the decoder would quote: "bad_alloc" was taken for its own word, and status 4.
  const std::string two = test::read_file(folder.file("two.exr")), usual = "scanlineimage";
  for (const std::string type : {"scanbad_alloc", "no memory now", "SCANLINEIMAGE"}) {
    std::string odd = two;
    odd.replace(odd.rfind(usual), usual.size(), type);
    CHECK_THAT(refusal(odd), Contains("a part of the EXR has an unknown type"));
  }
}

TEST_CASE("lists in an EXR's header end where they say", "[image][exr]") {
  // The decoder reads them to their own end, and takes what follows for the next attribute: it made
  // room for 726 MB.
  const std::vector<std::string> blocks(2, std::string(8, '\1'));
  const std::string plain = Made{.blocks = blocks}.file();
  const auto with = [&](const std::string& added) {
    std::string file = plain.substr(0, 8) + added + plain.substr(8);
    const std::size_t list = file.size() - 2 * (8 + 16);
    for (std::size_t i = 0; i < 2; ++i)  // the blocks moved
      file.replace(list + 8 * i, 8, number(list + 16 + 16 * i, 8));
    return refusal(file);
  };
  const std::string channel =
      std::string("Z") + '\0' + number(1, 4) + number(0, 4) + number(1, 4) + number(1, 4);
  CHECK(with("") == "nothing");
  CHECK(with(attribute("others", "chlist", channel + '\0')) == "nothing");
  CHECK_THAT(with(attribute("others", "chlist", channel)),
             Contains("channel list is empty or not terminated"));
  CHECK_THAT(with(attribute("others", "chlist", channel + '\0' + '\0')),
             Contains("channel list is empty or not terminated"));
  CHECK_THAT(with(attribute("channels", "string", channel + '\0')),
             Contains("\"channels\" of the EXR header is not a channel list"));
  const std::string left = number(4, 4) + "left";
  CHECK(with(attribute("multiView", "stringvector", left + number(0, 4))) == "nothing");
  CHECK_THAT(with(attribute("multiView", "stringvector", left + number(1 << 30, 4) + "right")),
             Contains("a string in the EXR header extends past the end of its list"));
  CHECK_THAT(with(attribute("multiView", "stringvector", left + "abc")),
             Contains("a string in the EXR header extends past the end of its list"));
}
