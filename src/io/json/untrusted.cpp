// SPDX-License-Identifier: Apache-2.0
//
// JSON from elsewhere, before and after it is parsed.
//
// A parser keeps what it reads: an empty object of two bytes becomes hundreds of bytes of tree, and
// of tinygltf's model over a thousand. So the text is scanned once before, in constant memory, and
// what it holds is counted: from the counts follows what parsing takes (gltf_cost()), and whether
// it is begun at all. The scanner knows brackets, strings and which array of the root it is in; it
// may count too much where keys have escapes in them, never too little. Depth is counted because
// writers and tinygltf recurse.
//
// After parsing a document is a tree of anything. JsonCheck looks a member up together with its
// type and range, and says where in the document it is wrong: no code behind it asks again.
//
// The last part of this file edits JSON as text. It is for documents that were parsed and checked:
// its walk knows no errors.
//
// Why counting and not a parser with a limit: a parser that stops at a limit has taken the memory
// by then, and says only that it was too much. Counts say how much a file needs, so a job can be
// refused with a number, and leased where it fits (docs/decisions/017).
#include "io/json/untrusted.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <span>
#include <string_view>
#include <vector>

#include "io/problems.h"

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
  /// A value is whatever stands between brackets and commas; a key is the last string before a
  /// bracket. Both are right for valid JSON, and more than enough for anything else.
  void add(char c) {
    ++size_.text_bytes;
    if (in_string_) {
      add_to_string(c);
    } else if (c == '"') {
      in_string_ = true;
      // Only the beginning of a string is kept: the longest word that is asked for has fewer
      // characters.
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
      // After a bracket that closes, what stood inside is no key any more.
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
      // Extensions may hold members of the same names; only those of the root become objects of
      // tinygltf.
      if (depth_ == 1) key_ = string_;
      if (string_.starts_with(kData)) {
        size_.data_bytes += string_bytes_;
        // Buffers and images are decoded and dropped from the tree: they cost other copies than
        // text.
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

std::string member(const std::string& place, const char* key) {
  return place.empty() ? key : place + "." + key;
}

bool is_whole(const nlohmann::json& value) {
  return value.is_number_unsigned() ||
         (value.is_number_integer() && value.get<std::int64_t>() >= 0);
}

// A number that is finite as a double may be infinite as a float, which is what readers make of it.
bool is_float(const nlohmann::json& value) {
  return value.is_number() &&
         std::abs(value.get<double>()) <= static_cast<double>(std::numeric_limits<float>::max());
}

}  // namespace

JsonSize json_size(const ReadFile& file, std::uint64_t offset, std::uint64_t size) {
  Scanner scanner;
  // The text is read once for this and once to be parsed: reading twice costs less than holding it.
  std::vector<char> piece;
  for (std::uint64_t done = 0; done < size; done += piece.size()) {
    piece.resize(std::min<std::uint64_t>(size - done, kPieceBytes));
    file.read(offset + done, std::as_writable_bytes(std::span(piece)));
    for (const char c : piece) scanner.add(c);
  }
  return scanner.size();
}

void JsonCheck::fail(const std::string& place, const std::string& what) const {
  refuse(path_, "{} {}; the file is not valid glTF 2.0, export it again", place, what);
}

const nlohmann::json* JsonCheck::find(const Json& object, const char* key) const {
  const auto it = object.find(key);
  return it == object.end() ? nullptr : &*it;
}

// Absent is not wrong: most members are optional, and the caller knows which are not. Null where
// absent; of another type is an error always.
const nlohmann::json* JsonCheck::object(const Json& parent, const char* key,
                                        const std::string& place) const {
  const Json* value = find(parent, key);
  if (value != nullptr && !value->is_object()) fail(member(place, key), "is not a JSON object");
  return value;
}

const nlohmann::json* JsonCheck::array(const Json& parent, const char* key,
                                       const std::string& place) const {
  const Json* value = find(parent, key);
  if (value != nullptr && !value->is_array()) fail(member(place, key), "is not an array");
  return value;
}

const std::string* JsonCheck::string(const Json& parent, const char* key,
                                     const std::string& place) const {
  const Json* value = find(parent, key);
  if (value == nullptr) return nullptr;
  if (!value->is_string()) fail(member(place, key), "is not a string");
  return value->get_ptr<const std::string*>();
}

void JsonCheck::boolean(const Json& parent, const char* key, const std::string& place) const {
  const Json* value = find(parent, key);
  if (value != nullptr && !value->is_boolean()) fail(member(place, key), "is not true or false");
}

std::uint64_t JsonCheck::whole(const Json& parent, const char* key, const std::string& place,
                               std::uint64_t lo, std::uint64_t hi, std::uint64_t fallback) const {
  return find(parent, key) == nullptr ? fallback : required_whole(parent, key, place, lo, hi);
}

// JSON has one kind of number. 3.0 is none here: the parser keeps it as a float, and glTF wants
// integers where it counts.
std::uint64_t JsonCheck::required_whole(const Json& parent, const char* key,
                                        const std::string& place, std::uint64_t lo,
                                        std::uint64_t hi) const {
  const Json* value = find(parent, key);
  if (value == nullptr) fail(member(place, key), "is missing");
  if (!is_whole(*value)) fail(member(place, key), "is not a whole number");
  const auto number = value->get<std::uint64_t>();
  if (number < lo || number > hi) {
    fail(member(place, key), fmt::format("is {}, but must be {} to {}", number, lo, hi));
  }
  return number;
}

void JsonCheck::number(const Json& parent, const char* key, const std::string& place) const {
  const Json* value = find(parent, key);
  if (value != nullptr && !is_float(*value)) fail(member(place, key), "is not a finite number");
}

bool JsonCheck::numbers(const Json& parent, const char* key, const std::string& place,
                        std::size_t count) const {
  const Json* list = array(parent, key, place);
  if (list == nullptr) return false;
  if (count != 0 && list->size() != count) {
    fail(member(place, key), fmt::format("has {} numbers, but must have {}", list->size(), count));
  }
  for (const Json& value : *list) {
    if (!is_float(value))
      fail(member(place, key), "contains something that is not a finite number");
  }
  return true;
}

std::size_t JsonCheck::size_of(const char* collection) const {
  const Json* list = array(root_, collection, {});
  return list == nullptr ? 0 : list->size();
}

// Against the array as it is: an entry that is there may still be wrong, and has its own check.
void JsonCheck::check_index(const Json& value, const std::string& place,
                            const char* collection) const {
  const std::size_t count = size_of(collection);
  if (!is_whole(value)) fail(place, "is not an index");
  if (value.get<std::uint64_t>() >= count) {
    fail(place,
         fmt::format("is {}, but only {} {} exist", value.get<std::uint64_t>(), count, collection));
  }
}

bool JsonCheck::index(const Json& parent, const char* key, const std::string& place,
                      const char* collection) const {
  const Json* value = find(parent, key);
  if (value != nullptr) check_index(*value, member(place, key), collection);
  return value != nullptr;
}

void JsonCheck::required_index(const Json& parent, const char* key, const std::string& place,
                               const char* collection) const {
  if (!index(parent, key, place, collection)) fail(member(place, key), "is missing");
}

void JsonCheck::indices(const Json& parent, const char* key, const std::string& place,
                        const char* collection) const {
  const Json* list = array(parent, key, place);
  if (list == nullptr) return;
  for (const Json& value : *list) check_index(value, member(place, key), collection);
}

// A tree that is parsed and written again comes out different: members in another order, 0.10 as
// 0.1, integers beyond 2^53 rounded. A model shall keep every byte that its new textures do not
// concern, so edits are of text: a value is found by walking over what stands before it, and what
// lies between two edits is copied. The walk trusts the text, which a parser has accepted; it knows
// strings, brackets and commas, and nothing of what values mean.

namespace {

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

/// Walks over text that a parser has accepted.
class Cursor {
 public:
  explicit Cursor(std::string_view text) : text_(text) {}

  std::size_t place() const { return at_; }
  void skip_space() {
    while (at_ < text_.size() && is_space(text_[at_])) ++at_;
  }
  char peek() {
    skip_space();
    return at_ < text_.size() ? text_[at_] : '\0';
  }
  void step() { at_ += at_ < text_.size() ? 1 : 0; }

  /// The next value, whole.
  std::string_view value() {
    skip_space();
    const std::size_t start = at_;
    std::size_t depth = 0;
    while (at_ < text_.size()) {
      const char c = text_[at_];
      if (c == '"') {
        skip_string();
        if (depth == 0) break;
        continue;
      }
      // A number or a word ends before what follows it; an array or an object with its own bracket.
      const bool closes = c == '}' || c == ']';
      if (depth == 0 && (closes || c == ',' || is_space(c))) break;
      depth += c == '{' || c == '[' ? 1 : 0;
      depth -= closes ? 1 : 0;
      ++at_;
      if (closes && depth == 0) break;
    }
    return text_.substr(start, at_ - start);
  }

 private:
  void skip_string() {
    // A backslash hides the character behind it, so an escaped quote does not end the string.
    for (++at_; at_ < text_.size() && text_[at_] != '"'; ++at_) at_ += text_[at_] == '\\' ? 1 : 0;
    step();
  }

  std::string_view text_;
  std::size_t at_ = 0;
};

/// A member with its place in the text: from its key's quote to the end of its value.
struct Place {
  JsonMember member;
  std::size_t begin = 0, end = 0;
};

/// All members of an object; of one that stands twice, both.
std::vector<Place> places(std::string_view object) {
  std::vector<Place> found;
  Cursor cursor(object);
  cursor.skip_space();
  cursor.step();  // {
  while (cursor.peek() == '"') {
    Place place;
    place.begin = cursor.place();
    const std::string_view key = cursor.value();
    // Escapes in keys are rare, and only then is it worth to ask a parser what they mean.
    place.member.key = key.find('\\') == std::string_view::npos
                           ? std::string(key.substr(1, key.size() - 2))
                           : nlohmann::json::parse(key).get<std::string>();
    cursor.peek();
    cursor.step();  // :
    place.member.value = cursor.value();
    place.end = cursor.place();
    found.push_back(std::move(place));
    if (cursor.peek() == ',') cursor.step();
  }
  return found;
}

std::string joined(const std::vector<std::string>& parts) {
  std::string out;
  for (const std::string& part : parts) out += (out.empty() ? "" : ",") + part;
  return out;
}

/// `text` with `addition` as new entries before its closing bracket.
/// The bracket is the last of its kind in the text, since what stands inside is closed before it.
std::string with_entries(std::string text, const std::string& addition, bool was_empty) {
  if (addition.empty()) return text;
  // Before the white space in front of the bracket, so that an indented file stays one.
  std::size_t end = text.find_last_of("}]");
  while (end > 0 && is_space(text[end - 1])) --end;
  return text.insert(end, (was_empty ? "" : ",") + addition);
}

}  // namespace

std::vector<JsonMember> json_members(std::string_view object) {
  std::vector<JsonMember> members;
  for (Place& place : places(object)) members.push_back(std::move(place.member));
  return members;
}

std::vector<std::string_view> json_elements(std::string_view array) {
  std::vector<std::string_view> elements;
  Cursor cursor(array);
  cursor.skip_space();
  cursor.step();  // [
  while (cursor.peek() != ']' && cursor.peek() != '\0') {
    elements.push_back(cursor.value());
    if (cursor.peek() == ',') cursor.step();
  }
  return elements;
}

std::string_view json_member(std::string_view object, std::string_view key) {
  std::string_view found;
  for (const Place& place : places(object)) {
    if (place.member.key == key) found = place.member.value;
  }
  return found;
}

// One pass over the old members. What lies between them (commas, white space) is copied with the
// member behind it, so a member that goes takes the comma in front of it along; the first that
// stays after removed ones must not keep its own.
std::string edit_json_object(std::string_view object, const JsonChanges& changes) {
  const std::vector<Place> old = places(object);
  JsonChanges fresh = changes;
  std::string out;
  std::size_t copied = 0, kept = 0;
  for (const Place& place : old) {
    const auto change = changes.find(place.member.key);
    // A member that stands twice is changed in both places. Parsers differ in which of the two
    // counts.
    const bool removed = change != changes.end() && !change->second;
    fresh.erase(place.member.key);
    if (removed) {
      // With the comma before it; the first that stays drops its own below.
      out +=
          object.substr(copied, (&place == old.data() ? place.begin : (&place)[-1].end) - copied);
      copied = place.end;
      continue;
    }
    const std::size_t value_at =
        static_cast<std::size_t>(place.member.value.data() - object.data());
    if (kept++ == 0 && &place != old.data()) {
      copied = std::max(copied, place.begin);  // all before it were removed
    }
    out += object.substr(copied, value_at - copied);
    out += change != changes.end() ? *change->second : std::string(place.member.value);
    copied = place.end;
  }
  out += object.substr(copied);
  std::vector<std::string> added;
  for (const auto& [key, value] : fresh) {
    if (value) added.push_back(json_quoted(key) + ":" + *value);
  }
  return with_entries(std::move(out), joined(added), kept == 0);
}

// Elements that do not change are copied with all that stands around them.
std::string edit_json_array(std::string_view array,
                            const std::map<std::size_t, std::string>& changed,
                            const std::vector<std::string>& appended) {
  // Indices rise in a map, so the text is passed over once.
  const std::vector<std::string_view> old = json_elements(array);
  std::string out;
  std::size_t copied = 0;
  for (const auto& [index, value] : changed) {
    const std::string_view element = old.at(index);
    const auto begin = static_cast<std::size_t>(element.data() - array.data());
    out += array.substr(copied, begin - copied);
    out += value;
    copied = begin + element.size();
  }
  out += array.substr(copied);
  return with_entries(std::move(out), joined(appended), old.empty());
}

// Names inside files need not be UTF-8, JSON must be: what is none becomes a replacement character.
std::string json_quoted(const std::string& text) {
  return nlohmann::json(text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace pounce::io
