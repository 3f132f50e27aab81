// SPDX-License-Identifier: Apache-2.0
#include <sys/resource.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <filesystem>

#include "pounce/error.h"
#include "unit/io/model_target.h"

using namespace pounce;
using namespace pounce::test;
using Catch::Matchers::Contains;
using nlohmann::json;

TEST_CASE("what is not edited keeps every byte of its JSON", "[model]") {
  const TempFolder folder;
  GltfBuilder target = textured();
  target.write_glb(folder.file("plain.glb"));
  std::string text = Glb(folder.file("plain.glb")).text;
  while (text.back() == ' ') text.pop_back();
  const std::string odd =
      "\"extras\" : { \"big\": 18446744073709551617, \"f\":0.10, \"e\":1E+2, \"n\": -0,\n "
      "\"u\":\"\\u00e9\"}";
  const std::string camera =
      "\"cameras\":[ {\"type\":\"perspective\",\"perspective\":{\"yfov\":0.50,\"znear\":1e-2}} ]";
  text.insert(1, odd + "," + camera + ",");
  test::write_file(folder.file("target.gltf"), text);
  json document = json::parse(text);
  test::write_file(folder.file("data.bin"), target.buffer);
  text.replace(text.find("\"byteLength\":" + std::to_string(target.buffer.size()) + "}]"), 0,
               "\"uri\":\"data.bin\",");
  test::write_file(folder.file("target.gltf"), text);
  for (const char* name : {"out.glb", "out.gltf"}) {
    const io::ModelRequest request{
        folder.file("target.gltf"),
        folder.file(name),
        0,
        {{0, Channel::base_color, {1, 1, 1, 1}, folder.file("out.skin.png")}}};
    FakeImages({kNewImage}).write(request);
    const std::string out = test::file_bytes(folder.file(name));
    CHECK_THAT(out, Contains(odd));
    CHECK_THAT(out, Contains(camera));
    CHECK(geometry(io::read_mesh(folder.file(name))) ==
          geometry(io::read_mesh(folder.file("target.gltf"))));
  }
  CHECK(test::file_bytes(folder.file("out.skin.png")) == kNewImage);
  const json out = json::parse(test::file_bytes(folder.file("out.gltf")));
  CHECK(out["images"][0]["uri"] == "out.skin.png");
  CHECK(out["buffers"][0]["uri"] == "out.bin");
  CHECK(out["buffers"][0]["byteLength"] == std::filesystem::file_size(folder.file("out.bin")));
  CHECK(test::file_bytes(folder.file("out.bin")).find(std::string(16, 'o')) == std::string::npos);
}

TEST_CASE("a .glb takes in buffers and images that are files", "[model]") {
  const TempFolder folder;
  GltfBuilder target = textured();
  // Buffer 0 a file of 37 bytes, buffer 1 the builder's own as a data URI.
  json document = target.doc;
  document["buffers"] = {
      {{"byteLength", 37}, {"uri", "some%20file.bin"}, {"name", "first"}},
      {{"byteLength", target.buffer.size()},
       {"uri", "data:application/octet-stream;base64," + test::base64(target.buffer)}}};
  for (auto& view : document["bufferViews"]) view["buffer"] = 1;
  document["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", 4}, {"byteLength", 20}});
  document["images"].push_back({{"uri", "old.png"}, {"name", "kept"}});
  document["textures"].push_back({{"source", 1}});
  document["materials"][0]["normalTexture"] = {{"index", 1}};
  const std::string first = "0123456789abcdefghijklmnopqrstuvwxyz!";
  test::write_file(folder.file("some file.bin"), first);
  test::write_file(folder.file("old.png"), kOther);
  test::write_file(folder.file("target.gltf"), document.dump());
  io::ModelRequest request{folder.file("target.gltf"), folder.file("out.glb"), 0, {base_color(0)}};
  SECTION("into a .glb") {
    const io::ModelPlan plan = io::plan_model(request);
    CHECK(plan.outputs == std::vector<std::string>{request.output});
    CHECK(plan.inputs == std::vector<std::string>{folder.file("some file.bin"), request.target,
                                                  folder.file("old.png")});
    FakeImages({kNewImage}).write(request);
    const Glb out(request.output);
    REQUIRE(out.doc["buffers"].size() == 1);
    CHECK(out.doc["buffers"][0]["name"] == "first");
    CHECK_FALSE(out.doc["buffers"][0].contains("uri"));
    CHECK(out.view(document["bufferViews"].size() - 1) == first.substr(4, 20));
    CHECK(out.shown(out.doc["materials"][0]["normalTexture"]) == kOther);
    CHECK(out.doc["images"][1]["name"] == "kept");
    CHECK(out.doc["images"][1]["mimeType"] == "image/png");
    for (const auto& view : out.doc["bufferViews"]) CHECK(view.value("byteOffset", 0) % 4 == 0);
  }
  SECTION("as files beside a .gltf") {
    request.output = folder.file("an out.gltf");
    request.textures[0].path = folder.file("an out.skin.baseColor.png");
    const io::ModelPlan plan = io::plan_model(request);
    CHECK(plan.outputs ==
          std::vector<std::string>{request.textures[0].path, folder.file("an out.bin"),
                                   folder.file("an out.image1.png"), request.output});
    FakeImages({kNewImage}).write(request);
    for (const std::string& path : plan.outputs) CHECK(std::filesystem::exists(path));
    const json out = json::parse(test::file_bytes(request.output));
    CHECK(out["buffers"][0]["uri"] == "an%20out.bin");
    CHECK(out["buffers"][1] == document["buffers"][1]);
    CHECK(out["images"][0]["uri"] == "an%20out.skin.baseColor.png");
    CHECK(out["images"][1]["uri"] == "an%20out.image1.png");
    CHECK(test::file_bytes(folder.file("an out.bin")) == first);
    CHECK(test::file_bytes(folder.file("an out.image1.png")) == kOther);
  }
  CHECK(geometry(io::read_mesh(request.output)) == geometry(io::read_mesh(request.target)));
}

TEST_CASE("a missing image is named as before, a missing buffer ends it", "[model]") {
  const TempFolder folder;
  GltfBuilder target = textured();
  target.doc["images"].push_back({{"uri", "gone.png"}});
  target.write(folder.file("target.gltf"));
  io::ModelRequest request{folder.file("target.gltf"), folder.file("out.glb"), 0, {base_color(0)}};
  const io::ModelPlan plan = io::plan_model(request);
  REQUIRE(plan.warnings.size() == 1);
  CHECK_THAT(plan.warnings[0], Contains("gone.png is missing"));
  FakeImages({kNewImage}).write(request);
  CHECK(Glb(request.output).doc["images"][1]["uri"] == "gone.png");

  json document = json::parse(test::file_bytes(request.target));
  document["buffers"].push_back({{"byteLength", 4}, {"uri", "gone.bin"}});
  test::write_file(request.target, document.dump());
  CHECK_THROWS_WITH(io::plan_model(request), Contains("buffer 1 is the file \"gone.bin\""));
}

TEST_CASE("unknown chunks of a GLB stay in a .glb", "[model]") {
  const TempFolder folder;
  const GltfBuilder target = textured();
  std::string bytes = test::file_bytes(target.write_glb(folder.file("target.glb")));
  const std::string chunk("\5\0\0\0XTRAhello", 13);
  bytes += chunk;
  const auto length = static_cast<std::uint32_t>(bytes.size());
  std::memcpy(bytes.data() + 8, &length, 4);
  test::write_file(folder.file("target.glb"), bytes);
  io::ModelRequest request{folder.file("target.glb"), folder.file("out.glb"), 0, {base_color(0)}};
  FakeImages({kNewImage}).write(request);
  const Glb out(request.output);
  REQUIRE(out.others.size() == 1);
  CHECK(out.others[0].second == std::string("hello\0\0\0", 8));
  request.output = folder.file("out.gltf");
  request.textures[0].path = folder.file("out.png");
  const io::ModelPlan plan = io::plan_model(request);
  REQUIRE(plan.warnings.size() == 1);
  CHECK_THAT(plan.warnings[0], Contains("left out of a .gltf"));
}

TEST_CASE("compressed copies of geometry move with their buffers", "[model]") {
  const TempFolder folder;
  GltfBuilder target = textured();
  json document = target.doc;
  document["buffers"] = {{{"byteLength", 40}, {"uri", "packed.bin"}},
                         {{"byteLength", target.buffer.size()}, {"uri", "plain.bin"}}};
  for (auto& view : document["bufferViews"]) view["buffer"] = 1;
  // Nothing names it, so nobody unpacks it.
  document["bufferViews"].push_back({{"buffer", 1}, {"byteLength", 4}, {"byteStride", 4}});
  document["bufferViews"].back()["extensions"] = {{"EXT_meshopt_compression",
                                                   {{"buffer", 1},
                                                    {"byteOffset", 8},
                                                    {"byteLength", 8},
                                                    {"byteStride", 4},
                                                    {"count", 1},
                                                    {"mode", "ATTRIBUTES"}}}};
  document["extensionsUsed"] = {"EXT_meshopt_compression"};
  test::write_file(folder.file("packed.bin"), std::string(40, 'p'));
  test::write_file(folder.file("plain.bin"), target.buffer);
  test::write_file(folder.file("target.gltf"), document.dump());
  const io::ModelRequest request{
      folder.file("target.gltf"), folder.file("out.glb"), 0, {base_color(0)}};
  FakeImages({kNewImage}).write(request);
  const Glb out(request.output);
  const std::size_t last = document["bufferViews"].size() - 1;
  const auto& packed = out.doc["bufferViews"][last]["extensions"]["EXT_meshopt_compression"];
  CHECK(packed["buffer"] == 0);
  CHECK(packed["byteOffset"] == 48 + 8);  // 40 rounded up to 16
  CHECK(packed["count"] == 1);
  CHECK_THAT(out.bin, Contains("oooooooooooooooo"));  // nothing is left out here
}

TEST_CASE("an OBJ is no target for a model", "[model]") {
  const TempFolder folder;
  test::write_file(folder.file("t.obj"), "v 0 0 0\n");
  CHECK_THROWS_WITH(
      io::plan_model({folder.file("t.obj"), folder.file("o.glb"), 0, {base_color(0)}}),
      Contains("t.obj is neither") && Contains("convert the target"));
  CHECK(io::is_model_path("a.GLB"));
  CHECK(io::is_model_path("a.gltf"));
  CHECK_FALSE(io::is_model_path("a.glb.png"));
  CHECK_FALSE(io::is_model_path(".glb"));
}

TEST_CASE("a model that cannot be written leaves nothing", "[model]") {
  const TempFolder folder;
  GltfBuilder target = textured();
  target.view(std::string(1 << 20, 'b'));
  target.write_glb(folder.file("target.glb"));
  const auto count = [&] {
    return std::distance(std::filesystem::directory_iterator(folder.path()), {});
  };
  struct rlimit before {};
  getrlimit(RLIMIT_FSIZE, &before);
  struct rlimit small = before;
  small.rlim_cur = 1 << 19;
  std::signal(SIGXFSZ, SIG_IGN);
  setrlimit(RLIMIT_FSIZE, &small);
  for (const char* name : {"out.glb", "out.gltf"}) {
    const io::ModelRequest request{
        folder.file("target.glb"),
        folder.file(name),
        0,
        {{0, Channel::base_color, {1, 1, 1, 1}, folder.file("out.png")}}};
    CHECK_THROWS_WITH(FakeImages({kNewImage}).write(request), Contains("File too large"));
  }
  setrlimit(RLIMIT_FSIZE, &before);
  CHECK(count() == 1);
  // A folder stands where the model should be: the images that already have their names go again.
  std::filesystem::create_directory(folder.path() / "out.gltf");
  CHECK_THROWS(FakeImages({kNewImage})
                   .write({folder.file("target.glb"),
                           folder.file("out.gltf"),
                           0,
                           {{0, Channel::base_color, {1, 1, 1, 1}, folder.file("out.png")}}}));
  CHECK(count() == 2);
}
