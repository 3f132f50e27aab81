// SPDX-License-Identifier: Apache-2.0
#include "io/json/size.h"

#include <algorithm>
#include <array>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace pounce::io {
namespace {

constexpr std::size_t kPieceBytes = 1 << 20;
constexpr std::string_view kData = "data:";
constexpr std::size_t kLongestKey = 16;
// What becomes an object of tinygltf each.
constexpr std::array<std::string_view, 9> kTyped = {"accessors", "bufferViews", "meshes",
                                                    "nodes",     "samplers",    "scenes",
                                                    "skins",     "textures",    "images"};

/// With escapes in it a key may say anything: what costs more is assumed.
bool may_be(const std::string& key, std::string_view word) {
  return key == word || key.find('\\') != std::string::npos;
}

/// Takes the text character by character.
class Scanner {
 public:
  void add(char c) {
    ++size_.text_bytes;
    if (in_string_) {
      add_to_string(c);
    } else if (c == '"') {
      in_string_ = true;
      string_.clear();
      string_bytes_ = 0;
    } else if (c == '{' || c == '[') {
      size_.depth = std::max(size_.depth, ++depth_);
      if (c == '{') add_object();
      if (c == '{' && extensions_depth_ == 0 && may_be(string_, "extensions")) {
        extensions_depth_ = depth_;
      }
      add_value();
    } else if (c == '}' || c == ']') {
      if (depth_-- == extensions_depth_) extensions_depth_ = 0;
      string_.clear();
    } else if (c == ',') {
      add_value();
    }
  }
  JsonSize size() const { return size_; }

 private:
  void add_to_string(char c) {
    const bool escaped = escaped_;
    escaped_ = c == '\\' && !escaped;
    if (c == '"' && !escaped) {
      in_string_ = false;
      // At this depth strings are keys, or values that are taken for keys: no array is theirs.
      if (depth_ == 1) key_ = string_;
      if (string_.starts_with(kData)) {
        size_.data_bytes += string_bytes_;
        size_.text_bytes -= string_bytes_;
      } else if (string_bytes_ > kLongStringBytes && string_.find('\\') == std::string::npos) {
        size_.long_bytes += string_bytes_;
      }
      return;
    }
    ++string_bytes_;
    if (string_.size() < kLongestKey) string_ += c;
  }

  void add_value() { size_.extension_values += extensions_depth_ > 0 ? 1 : 0; }

  void add_object() {
    // Depth counts the object itself: 3 = the root, its array, the object.
    if (depth_ == 3 && may_be(key_, "materials")) ++size_.materials;
    const bool is_typed = std::any_of(kTyped.begin(), kTyped.end(),
                                      [&](std::string_view word) { return may_be(key_, word); });
    if (is_typed && (depth_ == 3 || (depth_ > 3 && may_be(key_, "meshes")))) ++size_.entries;
  }

  JsonSize size_;
  int depth_ = 0;
  int extensions_depth_ = 0;  ///< of the outermost "extensions" that this is in; 0 = in none
  bool in_string_ = false, escaped_ = false;
  std::string string_;  ///< the first characters of the string at hand
  std::uint64_t string_bytes_ = 0;
  std::string key_;  ///< of the root's members, the last
};

}  // namespace

JsonSize json_size(const ReadFile& file, std::uint64_t offset, std::uint64_t size) {
  Scanner scanner;
  std::vector<char> piece;
  for (std::uint64_t done = 0; done < size; done += piece.size()) {
    piece.resize(std::min<std::uint64_t>(size - done, kPieceBytes));
    file.read(offset + done, std::as_writable_bytes(std::span(piece)));
    for (const char c : piece) scanner.add(c);
  }
  return scanner.size();
}

}  // namespace pounce::io
