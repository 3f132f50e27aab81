// SPDX-License-Identifier: Apache-2.0
#include <OpenImageIO/imageio.h>

#include <catch2/catch.hpp>
#include <filesystem>

#include "pounce/error.h"
#include "support/test_data.h"
#include "unit/io/image_files.h"

using namespace pounce;
using Catch::Contains;
using test::at_path;
using test::in_memory;

namespace {

using Samples = std::vector<std::uint8_t>;
using namespace std::string_literals;

const std::vector<ImageFormat> kAll{ImageFormat::bmp, ImageFormat::tga};
/// 2 x 1 texels: from below to above, BGR, rows of 4 bytes.
const std::string kBmp = "BM\x3E\0\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0\2\0\0\0\1\0\0\0\1\0\x18\0"s +
                         std::string(24, '\0') + "\1\2\3\4\5\6\0\0"s;
const std::string kTarga = "\0\0\2\0\0\0\0\0\0\0\0\0\2\0\1\0\x18\x20\1\2\3\4\5\6"s;
const Samples kTexels{3, 2, 1, 6, 5, 4};

std::string refusal(const mesh::ImageRef& image, const std::vector<ImageFormat>& allowed = {}) {
  try {
    test::read_all(image, 1000, allowed);
  } catch (const Error& e) {
    CHECK(e.kind() == ErrorKind::input);
    return e.what();
  }
  return "accepted";
}

}  // namespace

TEST_CASE("BMP and Targa are read where they are allowed, whatever they are called", "[image]") {
  const auto [file, name, other, people] =
      GENERATE(table<std::string, ImageFormat, ImageFormat, std::string>(
          {{kBmp, ImageFormat::bmp, ImageFormat::tga, "BMP"},
           {kTarga, ImageFormat::tga, ImageFormat::bmp, "Targa"}}));
  CAPTURE(people);
  const std::string option = "--allow-format "s + image_format_name(name);
  test::TempFolder folder;
  for (const std::string called : {"a.png", "a.tga", "a.bmp", "a"}) {
    const std::string path = folder.file(called);
    test::write_file(path, file);
    CHECK(test::read_all(at_path(path), 1, {name}) == kTexels);
    const std::string recipe = "oiiotool " + path + " -o " + folder.file("a.png");
    for (const std::string& said : {refusal(at_path(path)), refusal(at_path(path), {other})})
      CHECK_THAT(said, Contains(people + " images are read only with") && Contains(option) &&
                           Contains(recipe));
  }
  // Within another file there is nothing that a tool could be given.
  mesh::ImageRef inside = at_path(folder.file("a.png"));
  inside.size_bytes = file.size();
  inside.label = "head.glb image 2";
  inside.mime_type = "image/png";
  CHECK_THAT(refusal(inside), Contains("head.glb image 2: " + people + " images") &&
                                  Contains(option) && Contains("convert it to PNG") &&
                                  !Contains("oiiotool"));
  // A shell must not take it for more than a name.
  mesh::ImageRef hostile = in_memory(file, "$(x).tga");
  hostile.path = hostile.label;
  CHECK_THAT(refusal(hostile), Contains("convert it to PNG") && !Contains("oiiotool"));
}

TEST_CASE("what OpenImageIO writes beyond the list is not read", "[image]") {
  test::TempFolder folder;
  std::size_t written = 0;
  for (const std::string ending :
       {"gif", "dpx", "sgi", "iff", "ico", "jp2", "rla", "fits", "zfile", "null", "psd"}) {
    CAPTURE(ending);
    const std::string path = folder.file("a." + ending);
    const auto out = OIIO::ImageOutput::create(path);
    const bool wide = ending == "ico";
    const OIIO::ImageSpec spec(wide ? 16 : 24, 16, ending == "zfile" ? 1 : 3,
                               ending == "zfile" ? OIIO::TypeDesc::FLOAT : OIIO::TypeDesc::UINT8);
    const std::vector<float> texels(24 * 16 * 3, 0.5F);
    if (!out || !out->open(path, spec) || !out->write_image(OIIO::TypeDesc::FLOAT, texels.data()) ||
        !out->close() || !std::filesystem::exists(path)) {
      continue;
    }
    ++written;
    CHECK_THAT(refusal(at_path(path), kAll),
               Contains(" images are not supported; convert it: oiiotool " + path) ||
                   Contains("not an image in a supported format"));
    if (ending == "gif")
      CHECK(refusal(at_path(path)) == path +
                                          ": GIF images are not supported; convert it: oiiotool " +
                                          path + " -o " + folder.file("a.png"));
  }
  CHECK(written >= 6);
}

TEST_CASE("binary PNM is read row by row without a foreign decoder", "[image]") {
  CHECK(test::read_all(in_memory("P6\n# of\n 2#x\n1 255\n\1\2\3\xFF\0\5rest"s)) ==
        Samples{1, 2, 3, 255, 0, 5});
  // Scaled to the whole range, to the nearest; what is above the largest value is the largest.
  CHECK(test::read_all(in_memory("P5 5 1 100\n\0\1\x32\x64\xFF"s), 1) ==
        Samples{0, 3, 128, 255, 255});
  const mesh::ImageRef wide = in_memory("P5 2 2 1000\n\0\0\1\xF4\3\xE8\xFF\xFF"s);
  const io::ImageReader reader(wide);
  CHECK((reader.info().depth == Depth::u16 && reader.info().channels == 1));
  const Samples samples = test::read_all(wide, 1);
  std::array<std::uint16_t, 4> numbers{};
  std::memcpy(numbers.data(), samples.data(), 8);
  CHECK(numbers == std::array<std::uint16_t, 4>{0, 32768, 65535, 65535});  // 32767.5 rounds up
  CHECK_THAT(refusal(in_memory("P6 2 1 255\n\1\2\3\4\5"s)),
             Contains("image data end at byte 17, the file ends at byte 16"));
  for (const char* header :
       {"P6 0 1 255\n", "P6 2 1 65536\n", "P6 2 1 0\n", "P6 2 -1 255\n", "P6 2 1 255x", "P6 2"}) {
    CAPTURE(header);
    CHECK_THAT(refusal(in_memory(header + std::string(64, 'x'))),
               Contains("header cannot be read"));
  }
  CHECK_THAT(refusal(in_memory("P6 99999999 1 255\n" + std::string(64, 'x'))),
             Contains("truncated: its image data end at byte 300000015, the file ends at byte 82"));
  CHECK_THAT(refusal(in_memory("P5 70000 1 255\n" + std::string(70000, 'x'))),
             Contains("70000 x 1 texels, but each side must be 1 to 65536"));
  CHECK_THAT(refusal(in_memory("P3 1 1 255\n1 2 3\n")), Contains("text PNM"));
}
