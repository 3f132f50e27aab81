// SPDX-License-Identifier: Apache-2.0
//
// A tree that is parsed and written again comes out different: members in another order, 0.10 as
// 0.1, integers beyond 2^53 rounded. A model shall keep every byte that its new textures do not
// concern, so edits are of text: a value is found by walking over what stands before it, and what
// lies between two edits is copied. The walk trusts the text, which a parser has accepted; it knows
// strings, brackets and commas, and nothing of what values mean.
#include "io/json/edit.h"

#include <algorithm>
#include <nlohmann/json.hpp>

namespace pounce::io {
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
