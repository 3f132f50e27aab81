// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace pounce::io {

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
