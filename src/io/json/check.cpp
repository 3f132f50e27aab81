// SPDX-License-Identifier: Apache-2.0
#include "io/json/check.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "pounce/error.h"

namespace pounce::io {
namespace {

std::string member(const std::string& place, const char* key) {
  return place.empty() ? key : place + "." + key;
}

bool is_whole(const nlohmann::json& value) {
  return value.is_number_unsigned() ||
         (value.is_number_integer() && value.get<std::int64_t>() >= 0);
}

bool is_float(const nlohmann::json& value) {
  return value.is_number() &&
         std::abs(value.get<double>()) <= static_cast<double>(std::numeric_limits<float>::max());
}

}  // namespace

void JsonCheck::fail(const std::string& place, const std::string& what) const {
  throw Error(ErrorKind::input,
              fmt::format("{}: {} {}; the file is not valid glTF 2.0, export it again", path_,
                          place, what));
}

const nlohmann::json* JsonCheck::find(const Json& object, const char* key) const {
  const auto it = object.find(key);
  return it == object.end() ? nullptr : &*it;
}

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
    if (!is_float(value)) fail(member(place, key), "holds something that is not a finite number");
  }
  return true;
}

std::size_t JsonCheck::size_of(const char* collection) const {
  const Json* list = array(root_, collection, {});
  return list == nullptr ? 0 : list->size();
}

void JsonCheck::check_index(const Json& value, const std::string& place,
                            const char* collection) const {
  const std::size_t count = size_of(collection);
  if (!is_whole(value)) fail(place, "is not an index");
  if (value.get<std::uint64_t>() >= count) {
    fail(place, fmt::format("is {}, but there are only {} {}", value.get<std::uint64_t>(), count,
                            collection));
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

}  // namespace pounce::io
