// SPDX-License-Identifier: Apache-2.0
#include "arguments.h"

#include <catch2/catch.hpp>

#include "pounce/error.h"
#include "summary.h"

using namespace pounce;
using namespace pounce::cli;

TEST_CASE("amounts of memory count in the unit that is given", "[cli]") {
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

TEST_CASE("a size is one number or two", "[cli]") {
  CHECK(parse_image_size("--size", "1024") == ImageSize{1024, 1024});
  CHECK(parse_image_size("--size", "2048x1") == ImageSize{2048, 1});
  CHECK(parse_image_size("--size", "1X65536") == ImageSize{1, 65536});
}

TEST_CASE("a length is absolute or a share of the diagonal", "[cli]") {
  CHECK(parse_length("--max-distance", "0.25").value == 0.25);
  CHECK_FALSE(parse_length("--max-distance", "0.25").is_percent);
  CHECK(parse_length("--max-distance", "8%").value == 8);
  CHECK(parse_length("--max-distance", "8%").is_percent);
  CHECK(parse_length("--max-distance", "150").value == 150);
}

TEST_CASE("a source texture's path may hold an equals sign", "[cli]") {
  const SourceTexture texture = parse_source_texture("--source-texture", "occlusion=a=b.png");
  CHECK(texture.channel == Channel::occlusion);
  CHECK(texture.path == "a=b.png");
}

TEST_CASE("channels keep the order they are given in", "[cli]") {
  CHECK(parse_channels("--channels", "emissive,baseColor") ==
        std::vector<Channel>{Channel::emissive, Channel::base_color});
}

TEST_CASE("a refused value is quoted with its option and what is expected", "[cli]") {
  try {
    parse_integer("--threads", "-1", 1, 1024);
    FAIL("accepted");
  } catch (const Error& error) {
    CHECK(error.kind() == ErrorKind::usage);
    CHECK(std::string(error.what()) ==
          "--threads: got \"-1\", expected a whole number from 1 to 1024");
  }
}

TEST_CASE("counts and bytes are written for people", "[cli]") {
  CHECK(with_commas(0) == "0");
  CHECK(with_commas(999) == "999");
  CHECK(with_commas(1000) == "1,000");
  CHECK(with_commas(12345678) == "12,345,678");
  CHECK(bytes_text(1023) == "1023 B");
  CHECK(bytes_text(1536) == "1.5 KiB");
  CHECK(bytes_text(536870912) == "512.0 MiB");
}
