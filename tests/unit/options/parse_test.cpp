// SPDX-License-Identifier: Apache-2.0
#include "options/parse.h"

#include <catch2/catch.hpp>

#include "pounce/error.h"
#include "pounce/option_table.h"

using namespace pounce;
using namespace pounce::options;

TEST_CASE("amounts of memory count in the unit that is given", "[options]") {
  const std::pair<const char*, std::uint64_t> cases[] = {{"1", 1},
                                                         {"4096", 4096},
                                                         {"64b", 64},
                                                         {"1K", 1024},
                                                         {"1KiB", 1024},
                                                         {"1kB", 1000},
                                                         {"512MiB", 536870912},
                                                         {"512mib", 536870912},
                                                         {"512MB", 512000000},
                                                         {"1.5G", 1610612736},
                                                         {"2GiB", 2147483648},
                                                         {"0.5 KiB", 512},
                                                         {"1TiB", 1099511627776},
                                                         {"1.9", 1}};
  for (const auto& [text, bytes] : cases) {
    CAPTURE(text);
    CHECK(parse_bytes("--memory", text) == bytes);
  }
}

TEST_CASE("a size is one number or two", "[options]") {
  CHECK(parse_image_size("--size", "1024") == ImageSize{1024, 1024});
  CHECK(parse_image_size("--size", "2048x1") == ImageSize{2048, 1});
  CHECK(parse_image_size("--size", "1X65536") == ImageSize{1, 65536});
}

TEST_CASE("a length is absolute or a share of the diagonal", "[options]") {
  CHECK(parse_length("--max-distance", "0.25").value == 0.25);
  CHECK_FALSE(parse_length("--max-distance", "0.25").is_percent);
  CHECK(parse_length("--max-distance", "8%").value == 8);
  CHECK(parse_length("--max-distance", "8%").is_percent);
  CHECK(parse_length("--max-distance", "150").value == 150);
}

TEST_CASE("a source texture's path may hold an equals sign", "[options]") {
  std::vector<OtherMap> maps;
  const SourceTexture texture = parse_source_texture("--source-texture", "occlusion=a=b.png", maps);
  CHECK(texture.channel == Channel::occlusion);
  CHECK(texture.path == "a=b.png");
}

TEST_CASE("channels keep the order they are given in", "[options]") {
  std::vector<OtherMap> maps;
  CHECK(parse_channels("--channels", "emissive,baseColor", maps) ==
        std::vector<Channel>{Channel::emissive, Channel::base_color});
  CHECK(maps.empty());
}

TEST_CASE("maps of the user's own are numbered by name", "[options]") {
  std::vector<OtherMap> maps;
  CHECK(parse_channels("--channels", "mask,occlusion,disp_2", maps) ==
        std::vector<Channel>{other_channel(0), Channel::occlusion, other_channel(1)});
  CHECK(parse_source_texture("--source-texture", "disp_2=d.exr", maps).channel == other_channel(1));
  parse_map_kind("--color", "mask", true, maps);
  REQUIRE(maps.size() == 2);
  CHECK((maps[0].name == "mask" && maps[0].is_colour == true));
  CHECK((maps[1].name == "disp_2" && !maps[1].is_colour));
  CHECK_FALSE(is_map_name("OCCLUSION"));
  CHECK_FALSE(is_map_name("-x"));
  CHECK_FALSE(is_map_name(std::string(65, 'x')));
}

TEST_CASE("a refused value is quoted with its option and what is expected", "[options]") {
  try {
    parse_integer("--threads", "-1", 1, 1024);
    FAIL("accepted");
  } catch (const Error& error) {
    CHECK(error.kind() == ErrorKind::usage);
    CHECK(std::string(error.what()) ==
          "--threads: got \"-1\", expected a whole number from 1 to 1024");
  }
}

namespace {

/// Every text must be refused as a usage error that quotes it.
template <class Parse>
void check_refused(Parse parse, std::initializer_list<const char*> texts) {
  for (const std::string text : texts) {
    CAPTURE(text);
    try {
      parse("--option", text);
      FAIL_CHECK("accepted");
    } catch (const Error& error) {
      CHECK(error.kind() == ErrorKind::usage);
      CHECK(std::string(error.what()).find("--option: got \"" + text + "\"") == 0);
    }
  }
}

}  // namespace

TEST_CASE("what is no amount of memory is refused", "[options]") {
  check_refused(parse_bytes, {"", "0", "-1", "0.5", "12XB", "MiB", "1MiBs", "1MM", "1 ", "1  MiB",
                              "+1", "0x10", "inf", "nan", "99999999999TiB", "1e400"});
}

TEST_CASE("what is no size is refused", "[options]") {
  check_refused(parse_image_size,
                {"", "0", "-1", "65537", "1x65537", "0x4", "4x", "x4", "x", "4x4x4", "1.5", "1e3",
                 " 4", "4 ", "nan", "99999999999999999999"});
}

TEST_CASE("what is no length is refused", "[options]") {
  check_refused(parse_length, {"", "%", "0", "-1", "0%", "-5%", "101%", "5%%", "5 %", "5px", "inf",
                               "nan", "1e31"});
}

TEST_CASE("numbers are in range, finite and nothing but a number", "[options]") {
  const auto angle = [](const std::string& option, const std::string& text) {
    return parse_number(option, text, 0, 89.9);
  };
  check_refused(angle, {"", "90", "89.91", "-1", "-0.001", "nan", "inf", "-inf", "45deg", "4,5"});
  CHECK(angle("--option", "0") == 0);
  CHECK(angle("--option", "89.9") == 89.9);
  const auto threads = [](const std::string& option, const std::string& text) {
    return parse_integer(option, text, 1, 1024);
  };
  check_refused(threads,
                {"", "0", "-1", "1025", "2.5", "two", "1e2", "0x2", "99999999999999999999"});
  CHECK(threads("--option", "1024") == 1024);
}

TEST_CASE("names that this version does not write are refused", "[options]") {
  check_refused(parse_image_pattern, {"", "--plan", "-x.png", "o.glb", "o.GLTF", "o.<channel>.png",
                                      "<FRAME>.png", "<CHANNEL>.<UDIMS>.png", "<>.png"});
  for (const char* text : {"o.png", "-", "a<b.png", "<CHANNEL>/<MATERIAL>.<TARGET>.exr",
                           "glb/o.png", "o.<UDIM>.png", "<CHANNEL>.<UVTILE>.exr"}) {
    CHECK(parse_image_pattern("-o", text) == text);
  }
}

TEST_CASE("a model is an output, with <TARGET> as its only token", "[options]") {
  check_refused(parse_output, {"", "o.<CHANNEL>.glb", "<UDIM>.gltf", "<MATERIAL>.GLB",
                               "o.<TARGETS>.glb", "<FRAME>.png"});
  for (const char* text : {"o.glb", "o.GLTF", "<TARGET>.glb", "<CHANNEL>.png", "glb/o.png"}) {
    CHECK(parse_output("-o", text) == text);
  }
}

TEST_CASE("UDIMs are numbers and ranges", "[options]") {
  using Udims = std::vector<std::uint32_t>;
  check_refused(parse_udims, {"", ",", "1001,", "1000", "999", "10000", "1001-", "-1001",
                              "1004-1001", "1001 1002", "1001-1002-1003", "u1_v1"});
  CHECK(parse_udims("--tiles", "1011,1001-1003,1002") == Udims{1001, 1002, 1003, 1011});
  CHECK(parse_udims("--tiles", "9999") == Udims{9999});
}

TEST_CASE("channels, depths and source textures are spelt as in glTF", "[options]") {
  const auto set_depth = [](const std::string&, const std::string& text) {
    TransferOptions options;
    set_option(options, "depth", text);
  };
  for (const char* text : {"", "U8", "u32", "8"}) CHECK_THROWS_AS(set_depth("", text), Error);
  std::vector<OtherMap> maps;
  const auto parse = [&maps](const std::string& option, const std::string& text) {
    return parse_source_texture(option, text, maps);
  };
  check_refused(parse, {"", "baseColor", "baseColor=", "baseColor=skin.<CHANNEL>.png"});
  CHECK(parse("--source-texture", "baseColor=skin.<UDIM>.png").path == "skin.<UDIM>.png");
  for (const char* text :
       {"", "no.rmal", "basecolor", "baseColor,,emissive", "baseColor, emissive", "baseColor,"}) {
    CAPTURE(text);
    CHECK_THROWS_AS(parse_channels("--channels", text, maps), Error);
  }
}
