// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>

#include "planning/name_patterns.h"
#include "support/bytes.h"
#include "support/test_data.h"

using namespace pounce;
using namespace pounce::planning;

TEST_CASE("tokens are replaced, everything else stays") {
  const std::map<std::string, std::string> values{{"CHANNEL", "baseColor"}, {"MATERIAL", "a<b"}};
  CHECK(expand_pattern("out/a.<CHANNEL>.png", values) == "out/a.baseColor.png");
  CHECK(expand_pattern("<CHANNEL><CHANNEL>", values) == "baseColorbaseColor");
  CHECK(expand_pattern("<MATERIAL>.png", values) == "a<b.png");  // values are not expanded again
  CHECK(expand_pattern("plain.png", values) == "plain.png");
  CHECK(expand_pattern("a<b.png", values) == "a<b.png");
  CHECK(expand_pattern("a>b.png", values) == "a>b.png");
  CHECK(expand_pattern("", values).empty());
}

TEST_CASE("an unknown token is named together with those that exist") {
  std::string message;
  CHECK(test::error_kind(
            [] {
              expand_pattern("a.<Channel>.png", {{"CHANNEL", "x"}, {"TARGET", "y"}});
            },
            &message) == static_cast<int>(ErrorKind::usage));
  CHECK(message.find("<Channel>") != std::string::npos);
  CHECK(message.find("<CHANNEL>, <TARGET>") != std::string::npos);
}

TEST_CASE("a token is found only whole") {
  CHECK(has_token("a.<CHANNEL>.png", "CHANNEL"));
  CHECK_FALSE(has_token("a.<CHANNELS>.png", "CHANNEL"));
  CHECK_FALSE(has_token("a.CHANNEL.png", "CHANNEL"));
  CHECK_FALSE(has_token("a.<channel>.png", "CHANNEL"));
}

TEST_CASE("a name from a file cannot leave the folder it is written to") {
  CHECK(file_name_part("skin") == "skin");
  CHECK(file_name_part("../../etc/x") == ".._.._etc_x");
  CHECK(file_name_part("a\\b\nc\td") == "a_b_c_d");
  CHECK(file_name_part("..") == "_");
  CHECK(file_name_part(".") == "_");
  CHECK(file_name_part("") == "_");
  CHECK(file_name_part("H\xC3\xA4nde") == "H\xC3\xA4nde");
}

TEST_CASE("two images of one name, impossible folders and folders as files are refused") {
  const test::TempFolder folder;
  const auto kind = [](const std::vector<std::string>& paths) {
    return test::error_kind([&] { check_outputs(paths); });
  };
  const std::string a = folder.file("a.png"), b = folder.file("b.png");
  CHECK(kind({a, b}) == 0);
  CHECK(kind({"plain.png"}) == 0);
  CHECK(kind({a, b, a}) == static_cast<int>(ErrorKind::usage));
  CHECK(kind({a, folder.file("./x/../a.png")}) == static_cast<int>(ErrorKind::usage));
  CHECK(kind({folder.file("missing/deep/a.png")}) == 0);
  CHECK_FALSE(std::filesystem::exists(folder.file("missing")));
  std::ofstream(folder.file("file")) << "x";
  CHECK(kind({folder.file("file/a.png")}) == static_cast<int>(ErrorKind::storage));
  CHECK(kind({folder.file("file/deep/a.png")}) == static_cast<int>(ErrorKind::storage));
  std::filesystem::create_directory(folder.file("c.png"));
  CHECK(kind({folder.file("c.png")}) == static_cast<int>(ErrorKind::storage));
}
