// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>
#include <fstream>
#include <string>

#include "io/codec/colour_config.h"
#include "pounce/error.h"
#include "support/test_data.h"

using namespace pounce;

namespace {

/// A configuration of these colour spaces.
std::string config_file(const test::TempFolder& folder, const std::string& roles,
                        const std::string& spaces) {
  const std::string path = folder.file("c.ocio");
  std::ofstream(path) << "ocio_profile_version: 2\nsearch_path: .\nroles: {default: raw" << roles
                      << "}\nfile_rules:\n  - !<Rule> {name: Default, colorspace: default}\n"
                         "displays:\n  d:\n    - !<View> {name: v, colorspace: raw}\n"
                         "colorspaces:\n  - !<ColorSpace>\n    name: raw\n    isdata: true\n"
                      << spaces;
  return path;
}

std::string space(const std::string& name, const std::string& transform = "") {
  return "  - !<ColorSpace>\n    name: " + name + "\n" +
         (transform.empty() ? "" : "    to_scene_reference: !<" + transform + "\n");
}

using Colour = std::array<double, 3>;

Colour through(const ColourTransform& transform, Colour colour) {
  transform.apply(colour);
  return colour;
}

void check_colour(const Colour& got, const Colour& expected) {
  for (std::size_t c = 0; c < 3; ++c) CHECK(got[c] == Approx(expected[c]).margin(1e-6));
}

}  // namespace

TEST_CASE("a configuration's spaces are beside ours by ACES or by Rec. 709", "[io]") {
  const test::TempFolder folder;
  const std::string squared = space("squared", "ExponentTransform> {value: 2}");
  const Colour number{0.8, 0.4, 0.2}, light{0.64, 0.16, 0.04};
  SECTION("Rec. 709 under a usual name") {
    const auto config =
        io::ColourConfig::load(config_file(folder, "", space("Utility - Linear - sRGB") + squared));
    check_colour(through(*config->to_linear("squared"), number), light);
    check_colour(through(*config->from_linear("squared"), light), number);
  }
  SECTION("ACES2065-1 by its role, or by name") {
    const bool by_role = GENERATE(true, false);
    const auto config = io::ColourConfig::load(
        by_role ? config_file(folder, ", aces_interchange: base", space("base") + squared)
                : config_file(folder, "", space("ACES - ACES2065-1") + squared));
    const Matrix3 m = primaries_matrix(colour_space_from_name("aces2065-1")->primaries, kRec709);
    Colour expected;
    for (std::size_t row = 0; row < 3; ++row)
      expected[row] = m[3 * row] * light[0] + m[3 * row + 1] * light[1] + m[3 * row + 2] * light[2];
    check_colour(through(*config->to_linear("squared"), number), expected);
    check_colour(through(*config->from_linear("squared"), expected), number);
  }
  SECTION("nothing in common") {
    const auto config = io::ColourConfig::load(config_file(folder, "", space("base") + squared));
    CHECK(config->has("SQUARED"));
    CHECK_THROWS_AS(config->to_linear("squared"), Error);
  }
}

TEST_CASE("transforms that do the same have one identity, others have others", "[io]") {
  const test::TempFolder folder;
  const std::string spaces = space("lin_rec709") + space("a", "ExponentTransform> {value: 2}") +
                             space("b", "ExponentTransform> {value: 2.01}") +
                             space("c", "FileTransform> {src: t.spi1d, interpolation: linear}");
  const auto table = [&](const char* middle) {
    std::ofstream(folder.file("t.spi1d")) << "Version 1\nFrom 0 1\nLength 3\nComponents 1\n{\n0\n"
                                          << middle << "\n1\n}\n";
  };
  const auto identity = [&](const std::string& name, bool to_linear = true) {
    const auto config = io::ColourConfig::load(config_file(folder, "", spaces));
    const auto made = to_linear ? config->to_linear(name) : config->from_linear(name);
    return made->identity();
  };
  table("0.25");
  CHECK(identity("a") == identity("a"));
  CHECK(identity("a") != identity("b"));
  CHECK(identity("a") != identity("a", false));
  CHECK(identity("c") == identity("c"));
  CHECK(identity("c") != identity("a"));
}

TEST_CASE("a file that is no configuration is named", "[io]") {
  const test::TempFolder folder;
  const std::string path = folder.file("c.ocio");
  const auto says = [&](const std::string& text) {
    try {
      const auto config = io::ColourConfig::load(path);
    } catch (const Error& e) {
      return std::string(e.what()).find(text) != std::string::npos;
    }
    return false;
  };
  CHECK(says("No such file"));
  std::ofstream(path) << "ocio_profile_version: 2\n";
  CHECK(says(path));
  std::ofstream(path) << std::string(1000, '\0');
  CHECK(says("not a usable OpenColorIO configuration"));
}
