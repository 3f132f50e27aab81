// SPDX-License-Identifier: Apache-2.0
#include "terminal.h"

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

namespace pounce::cli {
namespace {

TEST_CASE("what a terminal obeys is shown, what people write stays", "[cli]") {
  CHECK(visible("a\x1b[2Jb") == "a\\u001b[2Jb");
  CHECK(visible(std::string_view("a\0b", 3)) == "a\\u0000b");
  CHECK(visible("\r\x7f\a") == "\\u000d\\u007f\\u0007");
  CHECK(visible("\xC2\x9B") == "\\u009b");       // CSI as one character
  CHECK(visible("x\x9b\x31mx") == "x\\x9b1mx");  // and as one byte
  CHECK(visible("a\xE2\x80\xAEgpj") == "a\\u202egpj");
  CHECK(visible("\xE2\x80\xA9") == "\\u2029");
  CHECK(visible("two\tcolumns\nand lines\n") == "two\tcolumns\nand lines\n");
  CHECK(visible("Gr\xC3\xBC\xC3\x9F"
                "e \xE6\x9C\xAC \xF0\x9F\x8E\xA8 \\u001b") ==
        "Gr\xC3\xBC\xC3\x9F"
        "e \xE6\x9C\xAC \xF0\x9F\x8E\xA8 \\u001b");
  CHECK(visible_line("one\npounce: error: two") == "one\\u000apounce: error: two");
}

TEST_CASE("bytes that are no UTF-8 are shown one by one", "[cli]") {
  CHECK(visible("\xC3") == "\\xc3");
  CHECK(visible("\xC0\x9B") == "\\xc0\\x9b");  // longer than needed
  CHECK(visible("\xE0\x82\x9B") == "\\xe0\\x82\\x9b");
  CHECK(visible("\xED\xA0\x80") == "\\xed\\xa0\\x80");  // half of a pair
  CHECK(visible("\xF4\x90\x80\x80z") == "\\xf4\\x90\\x80\\x80z");
  CHECK(visible("\xE2\x80") == "\\xe2\\x80");
  CHECK(visible("") == "");
}

TEST_CASE("JSON says the same after it was made visible", "[cli]") {
  const nlohmann::json json{{"na\x7fme", "a\x1b\xC2\x9B\n\t\"\\\xE2\x80\xAE\xC3\xBC"}};
  for (const int indent : {-1, 2}) {
    const std::string shown = visible(json.dump(indent));
    CHECK(nlohmann::json::parse(shown) == json);
    CHECK(visible(shown) == shown);
  }
}

}  // namespace
}  // namespace pounce::cli
