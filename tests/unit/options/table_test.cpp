// SPDX-License-Identifier: Apache-2.0
#include "options/table.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <set>

namespace pounce {
namespace {

using Catch::Contains;

/// A value of every option that is not its default.
const std::map<std::string, std::string> kValues{
    {"source", "s.glb"},
    {"target", "t.glb"},
    {"output", "<CHANNEL>.exr"},
    {"output-for", "normal=n.png"},
    {"coverage", "m.png"},
    {"map", "m.exr"},
    {"tiles", "1001-1003,1011"},
    {"size", "64x32"},
    {"depth", "half"},
    {"padding", "3"},
    {"min-coverage", "12.5"},
    {"skip-existing", "true"},
    {"exr-compression", "piz"},
    {"tile-size", "32"},
    {"mipmap", "true"},
    {"drop-alpha", "true"},
    {"onto", "o.png"},
    {"mask", "m.png"},
    {"channels", "baseColor,mine"},
    {"bake", "normal,height"},
    {"normal-y", "down"},
    {"output-normal-y", "down"},
    {"source-texture", "baseColor=b.png"},
    {"data", "mine"},
    {"color", "other"},
    {"factors", "vertices"},
    {"source-colorspace", "acescg"},
    {"output-colorspace", "srgb"},
    {"ocio", "c.ocio"},
    {"source-mesh", "head*"},
    {"source-material", "skin"},
    {"source-uv-set", "1"},
    {"source-axes", "x,z,-y"},
    {"target-mesh", "head*"},
    {"target-material", "skin"},
    {"target-uv-set", "1"},
    {"target-axes", "x,z,-y"},
    {"method", "gaussian"},
    {"filter", "tent"},
    {"sigma", "0.7000000001"},
    {"densify", "true"},
    {"max-distance", "3.25%"},
    {"max-angle", "60.0000001"},
    {"sh", "dc"},
    {"min-opacity", "0.1"},
    {"max-scale", "2"},
    {"box", "-1,-1,-1,1,1,1.5"},
    {"rays", "3"},
    {"alpha", "true"},
    {"min-confidence", "0.5"},
    {"near-target", "off"},
    {"sharpen", "0.5"},
    {"count", "12"},
    {"detail", "0.25%"},
    {"close", "true"},
    {"inside", "0.5,-1.25,3"},
    {"keep-uvs", "true"},
    {"allow-external", "true"},
    {"allow-format", "bmp,tga"},
    {"look", "around"},
    {"sandbox", "on"},
    {"memory", "4096"},
    {"threads", "2"},
    {"cache", "c"},
    {"cache-readonly", "d"},
    {"no-cache", "true"},
    {"cache-limit", "none"},
    {"temp", "t"},
    {"max-temp", "10GiB"},
    {"no-wait", "true"},
};

/// Of a number that is not listed the end of its range.
std::string value_of(const OptionInfo& info) {
  const auto known = kValues.find(info.name);
  const bool is_square = info.name == "size" && info.value == "N";  // of a proxy
  if (known != kValues.end() && !is_square) return known->second;
  const std::size_t to = info.range.find(" to ");
  INFO(info.name);
  REQUIRE(to != std::string::npos);
  return info.range.substr(to + 4);
}

/// The texts of one option as set_option() takes them.
std::vector<std::string> texts_to_set(const OptionInfo& info, const OptionReport& option) {
  if (info.values != OptionValues::list) return option.values;
  std::string joined;
  for (const std::string& value : option.values) joined += (joined.empty() ? "" : ",") + value;
  return {joined};
}

template <class Options>
void check_table(JobCommand command) {
  std::set<std::string> names;
  for (const OptionInfo& info : option_table(command)) {
    CAPTURE(job_command_name(command), info.name);
    CHECK(names.insert(info.name).second);
    CHECK_FALSE(info.help.empty());
    CHECK(info.help.back() != '.');
    CHECK(info.group.empty() == info.is_operand);
    CHECK(info.value.empty() == (info.values == OptionValues::none));
    CHECK((info.excludes.empty() || names.count(info.excludes) == 1));

    Options usual;  // a default said aloud is not said at all
    if (!info.usual.empty()) set_option(usual, info.name, info.usual);
    CHECK(option_texts(usual).empty());

    Options given;
    set_option(given, info.name, value_of(info));
    const auto texts = option_texts(given);
    REQUIRE(texts.size() == 1);
    CHECK(texts[0].name == info.name);
    Options again;
    for (const std::string& text : texts_to_set(info, texts[0])) set_option(again, info.name, text);
    const auto texts_again = option_texts(again);
    REQUIRE(texts_again.size() == 1);
    CHECK(texts_again[0].values == texts[0].values);
  }
}

}  // namespace

TEST_CASE("every option is printed as a text that is read again", "[options]") {
  check_table<TransferOptions>(JobCommand::transfer);
  check_table<MapsOptions>(JobCommand::maps);
  check_table<GaussiansOptions>(JobCommand::gaussians);
  check_table<TransferOptions>(JobCommand::apply);
  check_table<ProxyOptions>(JobCommand::proxy);
  check_table<TexturedMeshOptions>(JobCommand::mesh);
}

TEST_CASE("an unknown option is told with what was meant", "[options]") {
  TransferOptions options;
  CHECK_THROWS_WITH(set_option(options, "sice", "8"), "sice: unknown option; did you mean size?");
  CHECK_THROWS_WITH(set_option(options, "output", "o.<FRAME>.png"), Contains("-o: got"));
  MapsOptions maps;
  CHECK_THROWS_AS(set_option(maps, "rays", "1"), Error);
}

TEST_CASE("options are refused where they do not apply", "[options]") {
  TransferOptions options;
  options.source = "x.glb";
  options.splats.rays = 1;
  CHECK_THROWS_WITH(options::refuse_unsuitable(options, options::Source::mesh),
                    "--rays applies only to splat scenes; x.glb is a mesh");
  CHECK_NOTHROW(options::refuse_unsuitable(options, options::Source::splats));
  options.splats.rays = 0;
  options.mesh.filter = kDefaultFilter;  // which is not said at all
  CHECK_NOTHROW(options::refuse_unsuitable(options, options::Source::splats));
  options.mesh.filter = Filter::tent;
  CHECK_THROWS_WITH(options::refuse_unsuitable(options, options::Source::splats),
                    Contains("only to meshes"));
  options.source = "m.exr";
  CHECK_NOTHROW(options::refuse_unsuitable(options, options::Source::map));
  options.search.max_angle_deg = 45;
  CHECK_THROWS_WITH(options::refuse_unsuitable(options, options::Source::map),
                    "--max-angle applies only to meshes and splat scenes; m.exr is a hit map");
  CHECK_NOTHROW(options::refuse_unsuitable(options, Method::surface));
  CHECK_THROWS_WITH(options::refuse_unsuitable(options, Method::gaussian),
                    Contains("--filter applies only to --method surface"));
}

TEST_CASE("numbers that no parser has seen are checked, too", "[options]") {
  const auto refused = [](auto&& change, const std::string& option) {
    TransferOptions options;
    change(options);
    CAPTURE(option);
    CHECK_THROWS_WITH(options::check_ranges(options), Contains(option + ": got"));
  };
  TransferOptions usual;
  CHECK_NOTHROW(options::check_ranges(usual));
  refused([](auto& o) { o.splats.rays = 17; }, "--rays");
  refused([](auto& o) { o.splats.views = 5; }, "--views");
  refused([](auto& o) { o.splats.views = 97; }, "--views");
  refused([](auto& o) { o.search.max_angle_deg = 90; }, "--max-angle");
  refused([](auto& o) { o.search.max_distance = Length{-1, false}; }, "--max-distance");
  refused([](auto& o) { o.splats.filter.min_opacity = 0.001; }, "--min-opacity");
  refused([](auto& o) { o.splats.filter.box = AxisBox{{0, 0, 0}, {1, -1, 1}}; }, "--box");
  refused([](auto& o) { o.image.layout.tile_size = 40; }, "--tile-size");
  refused([](auto& o) { o.image.padding_px = 5000; }, "--padding");
  refused([](auto& o) { o.min_coverage_percent = NAN; }, "--min-coverage");
  refused([](auto& o) { o.image.size = ImageSize{0, 1}; }, "--size");
  refused([](auto& o) { o.image.tiles = {1000}; }, "--tiles");
}

TEST_CASE("options that change no byte are no part of the hash", "[options]") {
  TransferOptions options;
  options.output = "o.png";
  options.resources.threads = 2;
  options.image.size = ImageSize{8, 8};
  CHECK(options::hashed_texts(options).empty());
  options.search.max_angle_deg = 60;
  options.mesh.filter = Filter::tent;
  const auto texts = options::hashed_texts(options);
  REQUIRE(texts.size() == 2);
  CHECK(texts[0].name == "filter");
  CHECK(texts[1].name == "max-angle");
}

}  // namespace pounce
