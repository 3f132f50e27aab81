// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/file.h"

namespace pounce::io {

/// A string of so many bytes costs its copies; a shorter one what a value costs, too.
inline constexpr std::uint64_t kLongStringBytes = 1024;

/// What a JSON text holds, found in one pass that keeps nothing of it: what bounds the memory that
/// parsing it needs. Of text that is no JSON, anything.
struct JsonSize {
  std::uint64_t text_bytes = 0;  ///< without data URIs
  /// Of strings of more than kLongStringBytes that no escape could make data URIs: a part of
  /// text_bytes.
  std::uint64_t long_bytes = 0;
  std::uint64_t data_bytes = 0;  ///< of strings that begin with "data:"
  int depth = 0;                 ///< how deep brackets nest outside of strings
  /// Objects in the root's "nodes", "accessors" and the like; in "meshes" those within them, too.
  std::uint64_t entries = 0;
  std::uint64_t extension_values = 0;  ///< values inside of "extensions", at least
  std::uint64_t materials = 0;         ///< objects of the root's "materials"
};

/// Looks at `size` bytes of a file from `offset`.
JsonSize json_size(const ReadFile& file, std::uint64_t offset, std::uint64_t size);

/// Typed look-ups in a JSON document that nobody has checked yet. Every function throws
/// Error(input) naming the file and the `place` ("nodes[3]") where something is missing or of the
/// wrong type.
class JsonCheck {
 public:
  JsonCheck(std::string path, const nlohmann::json& root) : path_(std::move(path)), root_(root) {}
  using Json = nlohmann::json;

  [[noreturn]] void fail(const std::string& place, const std::string& what) const;

  const Json* find(const Json& object, const char* key) const;
  /// The member if there, which must then be an object / an array / a string / true or false.
  const Json* object(const Json& parent, const char* key, const std::string& place) const;
  const Json* array(const Json& parent, const char* key, const std::string& place) const;
  const std::string* string(const Json& parent, const char* key, const std::string& place) const;
  void boolean(const Json& parent, const char* key, const std::string& place) const;
  /// A whole number of [lo, hi]; `fallback` if absent.
  std::uint64_t whole(const Json& parent, const char* key, const std::string& place,
                      std::uint64_t lo, std::uint64_t hi, std::uint64_t fallback) const;
  std::uint64_t required_whole(const Json& parent, const char* key, const std::string& place,
                               std::uint64_t lo, std::uint64_t hi) const;
  /// A finite number that a float can hold.
  void number(const Json& parent, const char* key, const std::string& place) const;
  /// An array of finite numbers; `count` of them unless that is 0. Is it there?
  bool numbers(const Json& parent, const char* key, const std::string& place,
               std::size_t count) const;
  /// An index into root[collection]. Is it there?
  bool index(const Json& parent, const char* key, const std::string& place,
             const char* collection) const;
  void required_index(const Json& parent, const char* key, const std::string& place,
                      const char* collection) const;
  /// An array of indices into root[collection].
  void indices(const Json& parent, const char* key, const std::string& place,
               const char* collection) const;
  std::size_t size_of(const char* collection) const;

  /// Calls f(object, "collection[i]") for every entry of root[collection].
  template <class F>
  void for_each(const char* collection, F f) const {
    for_each_in(root_, collection, std::string(), f);
  }
  template <class F>
  void for_each_in(const Json& parent, const char* key, const std::string& place, F f) const {
    const Json* list = array(parent, key, place);
    if (list == nullptr) return;
    for (std::size_t i = 0; i < list->size(); ++i) {
      const std::string here =
          (place.empty() ? "" : place + ".") + key + "[" + std::to_string(i) + "]";
      if (!(*list)[i].is_object()) fail(here, "is not a JSON object");
      f((*list)[i], here);
    }
  }

 private:
  void check_index(const Json& value, const std::string& place, const char* collection) const;

  std::string path_;
  const Json& root_;
};

/// Edits of JSON as text, so that what is not edited keeps every byte: the order and the spelling
/// of keys and numbers (0.10, 1e2, integers beyond 2^53), white space, what nobody here knows.
/// Every text handed in must be valid JSON of the kind that is asked for (a parser has read it).

struct JsonMember {
  std::string key;         ///< without escapes
  std::string_view value;  ///< a part of the text that was handed in
};
std::vector<JsonMember> json_members(std::string_view object);
std::vector<std::string_view> json_elements(std::string_view array);
/// The value of a member, the last one if there are several of that name; "" where there is none.
std::string_view json_member(std::string_view object, std::string_view key);

/// New values by key; nothing = remove the member. What is new is added at the end, in the order
/// of the keys.
using JsonChanges = std::map<std::string, std::optional<std::string>>;
std::string edit_json_object(std::string_view object, const JsonChanges& changes);

/// New values by index, and more of them for the end.
std::string edit_json_array(std::string_view array,
                            const std::map<std::size_t, std::string>& changed,
                            const std::vector<std::string>& appended);

/// As a JSON string, with quotes.
std::string json_quoted(const std::string& text);

}  // namespace pounce::io
