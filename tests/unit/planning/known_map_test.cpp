// SPDX-License-Identifier: Apache-2.0
//
// A map's note is read as what a stranger may have written.
#include "planning/known_map.h"

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "io/image/write.h"
#include "projection/hit_block.h"
#include "support/bytes.h"
#include "support/random.h"
#include "support/test_data.h"

using namespace pounce;
using namespace pounce::planning;
using nlohmann::json;

namespace {

/// A map of 4 x 2 texels with this note.
void write_map(const std::string& path, const std::string& note, ImageSize size = {4, 2}) {
  io::ImageWriteSpec spec{size.width, size.height, projection::kHitMapNames.size(), Depth::float32,
                          true};
  for (const char* name : projection::kHitMapNames) spec.names.emplace_back(name);
  spec.hits_note = note;
  io::ImageWriter writer(path, spec);
  const std::vector<float> texels(std::size_t{size.width} * size.height * spec.channels);
  writer.write_rows(size.height, reinterpret_cast<const std::byte*>(texels.data()));
  writer.commit();
}

/// Two materials, of which one is used and has a texture that lies turned on the second UV set.
json sound_note() {
  const json identity{1, 0, 0, 0, 1, 0}, turned{0, 1, 0.25, -1, 0, 0.5};
  json channels;
  for (int c = 0; c < kChannelCount; ++c)
    channels[channel_name(static_cast<Channel>(c))] = {{"factor", {1, 0.5, 1, 1}}};
  channels["baseColor"]["texture"] = {
      {"uvSet", 1}, {"transform", turned}, {"wrap", {"clamp", "mirror"}}};
  return {{"version", 1},
          {"width", 4},
          {"height", 2},
          {"pages", 4},
          {"vertexColors", true},
          {"maxDistance", 0.125},
          {"materials",
           {{{"name", "unused"}, {"used", false}},
            {{"name", "skin"},
             {"used", true},
             {"opaque", true},
             {"occlusionStrength", 0.5},
             {"emissiveStrength", 2},
             {"lattice", {{"width", 64}, {"height", 32}, {"uvSet", 1}, {"transform", turned}}},
             {"udims", {1001, 1012}},
             {"channels", channels}}}}};
}

TransferOptions painting(Channel channel) {
  TransferOptions options;
  options.material.textures = {{channel, "t.png"}};
  options.material.apply_vertex_colours = false;
  return options;
}

}  // namespace

TEST_CASE("a map's note stands for both meshes", "[planning]") {
  const test::TempFolder folder;
  write_map(folder.file("m.1001.exr"), sound_note().dump());
  write_map(folder.file("m.1012.exr"), sound_note().dump());
  const KnownMap map = read_known_map(folder.file("m.<UDIM>.exr"));
  CHECK(map.size == ImageSize{4, 2});
  REQUIRE(map.pages.size() == 2);
  CHECK(map.pages[1].udim == 1012);
  CHECK(map.note.pages == 4);
  CHECK(map.note.has_colours);
  CHECK_FALSE(map.note.uv_set);

  const mesh::Mesh source = map_source(map, painting(Channel::base_color));
  REQUIRE(source.materials.size() == 2);
  CHECK(source.triangle_material == std::vector<std::uint32_t>{1, 1});  // one per UDIM
  const mesh::Material& skin = source.materials[1];
  CHECK(skin.name == "skin");
  CHECK(skin.is_opaque);
  CHECK(skin.emissive_strength == 2);
  CHECK(skin.factors[0][1] == 0.5F);
  REQUIRE(skin.textures[0]);
  CHECK(skin.textures[0]->wrap_u == mesh::Wrap::clamp);
  CHECK(skin.textures[0]->wrap_v == mesh::Wrap::mirror);
  // UDIM 1012 is the second column and the second row from below, which is v = -1..0.
  const Vec2f uv = source.uv_sets[0][3];
  CHECK((uv.x > 1 && uv.x < 2 && uv.y > -1 && uv.y < 0));

  const mesh::Mesh target = map_target(map);
  CHECK(target.triangles.size() == 4);
  CHECK(target.uv_sets[0][0] == Vec2f{0, 0});
  CHECK(target.uv_sets[0][6] == Vec2f{2, 0});

  const TransferOptions options = apply_options(map, painting(Channel::base_color));
  CHECK(options.image.size == map.size);
  CHECK(options.search.max_distance->value == 0.125);
  CHECK(options.targets.size() == 1);
}

TEST_CASE("a map is refused for what it has no place for", "[planning]") {
  const test::TempFolder folder;
  const std::string path = folder.file("m.exr");
  json note = sound_note();
  json& skin = note["materials"][1];
  std::string expected;
  TransferOptions options = painting(Channel::base_color);
  SECTION("no image where the map was made") {
    skin["lattice"]["width"] = skin["lattice"]["height"] = 0;
    expected = "had no texture";
  }
  SECTION("another UV set") {
    skin["channels"]["baseColor"]["texture"]["uvSet"] = 0;
    expected = "lies elsewhere";
  }
  SECTION("another transform: a channel without a texture of its own") {
    options = painting(Channel::occlusion);
    expected = "lies elsewhere";
  }
  SECTION("vertex colours") {
    options.material.apply_vertex_colours = true;
    expected = "--factors factors";
  }
  write_map(path, note.dump());
  const KnownMap map = read_known_map(path);
  SourcePlan plan;
  plan.channels.emplace_back().channel = options.material.textures.front().channel;
  CHECK_THROWS_WITH(check_map_channels(map, options, plan), Catch::Contains(expected));
}

TEST_CASE("a note that lacks something or has another kind of it is refused", "[planning]") {
  const test::TempFolder folder;
  const std::string path = folder.file("m.exr");
  const auto refusal = [&](const json& note) -> std::string {
    write_map(path, note.dump());
    std::string message;
    const int kind = test::error_kind([&] { read_known_map(path); }, &message);
    CHECK(kind == static_cast<int>(ErrorKind::input));
    CHECK(message.starts_with(path + ": "));
    return message;
  };
  const std::vector<std::string> places{"/version",
                                        "/width",
                                        "/pages",
                                        "/vertexColors",
                                        "/maxDistance",
                                        "/materials",
                                        "/materials/0/name",
                                        "/materials/0/used",
                                        "/materials/1/opaque",
                                        "/materials/1/lattice",
                                        "/materials/1/lattice/height",
                                        "/materials/1/lattice/transform",
                                        "/materials/1/udims",
                                        "/materials/1/channels",
                                        "/materials/1/channels/emissive",
                                        "/materials/1/channels/emissive/factor",
                                        "/materials/1/channels/baseColor/texture/wrap",
                                        "/materials/1/channels/baseColor/texture/transform"};
  for (const std::string& place : places) {
    CAPTURE(place);
    const json::json_pointer at(place);
    const json wrong[] = {nullptr, json::object(), json::array({"x"}), -1, "x"};
    for (const json& value : wrong) {
      if (value == json("x") && place.ends_with("name")) continue;
      json note = sound_note();
      note[at] = value;
      refusal(note);
    }
    json note = sound_note();
    note[at.parent_pointer()].erase(at.back());
    CHECK_THAT(refusal(note), Catch::Contains(at.back()));
  }
  json note = sound_note();
  note["materials"][1]["lattice"]["width"] = 0;  // and a height
  CHECK_THAT(refusal(note), Catch::Contains("lattice"));
  note = sound_note();
  note["pages"] = 3;
  CHECK_THAT(refusal(note), Catch::Contains("pages"));
  note = sound_note();
  note["maxDistance"] = 0;
  CHECK_THAT(refusal(note), Catch::Contains("maxDistance"));
  note = sound_note();
  note["version"] = 2;
  CHECK_THAT(refusal(note), Catch::Contains("another version"));
  note = sound_note();
  note["width"] = 8;
  CHECK_THAT(refusal(note), Catch::Contains("is 4 x 2 texels, but was written as 8 x 2"));
  write_map(path, "");
  CHECK_THROWS_WITH(read_known_map(path), Catch::Contains("is not a hit map"));
}

TEST_CASE("no damage of a note does worse than to be refused", "[planning]") {
  const test::TempFolder folder;
  const std::string path = folder.file("m.exr"), sound = sound_note().dump();
  test::Random random(1);
  int accepted = 0, refused = 0;
  for (int i = 0; i < 1500; ++i) {
    std::string note = sound;
    note[random.below(note.size())] = static_cast<char>(random.whole(32, 126));
    write_map(path, note);
    try {
      const KnownMap map = read_known_map(path);
      map_target(map);
      map_source(map, painting(Channel::base_color));
      SourcePlan plan;
      plan.channels.emplace_back();
      check_map_channels(map, painting(Channel::base_color), plan);
      ++accepted;
    } catch (const Error& error) {
      CHECK(error.kind() == ErrorKind::input);
      ++refused;
    }
  }
  CHECK(accepted > 20);
  CHECK(refused > 500);
}
