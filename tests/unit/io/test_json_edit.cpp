// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "io/json/untrusted.h"
#include "support/random.h"

using namespace pounce::io;

TEST_CASE("a JSON object is taken apart by member", "[json_edit]") {
  const auto members = json_members(R"( { "a" : 1.50, "b\u0063" :["x}",{"y":"\"]"}],"e":{} } )");
  REQUIRE(members.size() == 3);
  CHECK(members[0].key == "a");
  CHECK(members[0].value == "1.50");
  CHECK(members[1].key == "bc");
  CHECK(members[1].value == R"(["x}",{"y":"\"]"}])");
  CHECK(members[2].value == "{}");
  CHECK(json_members("{ }").empty());
  CHECK(json_members("5").empty());
  CHECK(json_member(R"({"k":1,"k":2})", "k") == "2");
  CHECK(json_member(R"({"k":1})", "l").empty());
  const auto elements = json_elements(R"([ 1e2 , "a,b",[ ],{"c":[1,2]},-0.0])");
  REQUIRE(elements.size() == 5);
  CHECK(elements[0] == "1e2");
  CHECK(elements[1] == "\"a,b\"");
  CHECK(elements[4] == "-0.0");
  CHECK(json_elements("[]").empty());
}

TEST_CASE("an edit of a JSON object touches nothing else", "[json_edit]") {
  const std::string text = "{ \"a\": 0.10,\n\t\"b\" : 12345678901234567890123, \"c\":1E+2 }";
  CHECK(edit_json_object(text, {}) == text);
  CHECK(edit_json_object(text, {{"b", "7"}}) == "{ \"a\": 0.10,\n\t\"b\" : 7, \"c\":1E+2 }");
  CHECK(edit_json_object(text, {{"a", std::nullopt}}) ==
        "{ \"b\" : 12345678901234567890123, \"c\":1E+2 }");
  CHECK(edit_json_object(text, {{"b", std::nullopt}}) == "{ \"a\": 0.10, \"c\":1E+2 }");
  CHECK(edit_json_object(text, {{"c", std::nullopt}}) ==
        "{ \"a\": 0.10,\n\t\"b\" : 12345678901234567890123 }");
  CHECK(edit_json_object(text, {{"a", std::nullopt}, {"c", std::nullopt}, {"d", "[]"}}) ==
        "{ \"b\" : 12345678901234567890123,\"d\":[] }");
  CHECK(edit_json_object("{}", {{"x", "1"}, {"y", std::nullopt}}) == "{\"x\":1}");
  CHECK(edit_json_object("{ \"x\" : 1 }", {{"x", std::nullopt}, {"y", "2"}}) == "{\"y\":2  }");
}

TEST_CASE("an edit of a JSON array touches nothing else", "[json_edit]") {
  CHECK(edit_json_array("[ 1.0, 2.0 ,3 ]", {{1, "{}"}}, {"4", "5"}) == "[ 1.0, {} ,3,4,5 ]");
  CHECK(edit_json_array("[]", {}, {"1"}) == "[1]");
  CHECK(edit_json_array("[\n]", {}, {"1"}) == "[1\n]");
}

// Random edits of random objects against the same edits on a parsed one.
TEST_CASE("JSON edits mean what they say", "[json_edit]") {
  using Json = nlohmann::ordered_json;
  pounce::test::Random random(7);
  const char* const spaces[] = {"", " ", "\n  ", "\t"};
  const char* const values[] = {"1",          "-2.5e3", "\"a,}]\\\"\"", "[1,{\"x\":[]}]",
                                "{\"k\":{}}", "null"};
  for (int round = 0; round < 500; ++round) {
    const auto space = [&] { return spaces[random.below(4)]; };
    std::string text = std::string(space()) + "{";
    const std::uint64_t count = random.below(5);
    for (std::uint64_t i = 0; i < count; ++i) {
      text += std::string(i == 0 ? "" : ",") + space() + "\"" + static_cast<char>(97 + i) + "\"" +
              space() + ":" + space() + values[random.below(6)] + space();
    }
    text += std::string("}") + space();
    JsonChanges changes;
    Json wanted = Json::parse(text);
    for (char key = 'a'; key < 'g'; ++key) {
      const std::string name(1, key);
      const std::uint64_t what = random.below(3);
      if (what == 0) {
        changes[name] = std::nullopt;
        wanted.erase(name);
      } else if (what == 1) {
        changes[name] = values[random.below(6)];
        wanted[name] = Json::parse(*changes[name]);
      }
    }
    CAPTURE(text);
    CHECK(Json::parse(edit_json_object(text, changes)).dump() == wanted.dump());
  }
}
