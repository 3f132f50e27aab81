// SPDX-License-Identifier: Apache-2.0
//
// Reports as job files. Of a report only the command and its options matter; values that somebody
// writes by hand may also be JSON's own numbers, true and false.
//
// A report is a job file because printing options is the inverse of parsing them (codecs.cpp). So
// nothing is interpreted here: names and values stay text, and set_option() refuses what it does
// not know, with the messages of the command line. All else in the file is ignored; a report of a
// later version may have more in it.
//
// The file may be anybody's. It is limited in size before it is read, and parsed without
// exceptions.
#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <span>

#include "core/file.h"
#include "pounce/option_table.h"

namespace pounce {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint64_t kLargestFile = 256ULL << 20;  // a report of 10,000 images has 4 MB

[[noreturn]] void refuse(const std::string& path, const std::string& what) {
  throw Error(ErrorKind::input, path + ": " + what);
}

std::string read_text(const std::string& path) {
  const std::unique_ptr<ReadFile> file = posix_file_system().open(path);
  if (file->size_bytes() > kLargestFile) refuse(path, "too large for a report");
  std::string text(file->size_bytes(), '\0');
  file->read(0, std::as_writable_bytes(std::span(text)));
  return text;
}

std::string text_of(const std::string& path, const std::string& name, const Json& value) {
  if (value.is_string()) return value.get<std::string>();
  // As JSON prints them, which the parsers read: numbers have a point and no blanks, switches are
  // true and false.
  if (value.is_number() || value.is_boolean()) return value.dump();
  refuse(path,
         fmt::format("options: \"{}\" is neither text, a number, true, false nor a list of these",
                     name));
}

}  // namespace

RecordedJob read_job(const std::string& path) {
  const Json json = Json::parse(read_text(path), nullptr, false);
  // Two members make a job. A file that somebody writes by hand needs nothing else.
  const bool is_job = json.is_object() && json.contains("command") && json["command"].is_string() &&
                      json.contains("options") && json["options"].is_object();
  if (!is_job) {
    refuse(path,
           "not a report or job file; it needs a JSON object with \"command\" and \"options\" "
           "(docs/report.md)");
  }
  RecordedJob job;
  job.command = json["command"].get<std::string>();
  for (const auto& [name, value] : json["options"].items()) {
    OptionReport& option = job.options.emplace_back();
    option.name = name;
    option.is_list = value.is_array();
    if (!value.is_array()) option.values = {text_of(path, name, value)};
    for (const Json& element : value.is_array() ? value : Json::array())
      option.values.push_back(text_of(path, name, element));
  }
  return job;
}

}  // namespace pounce
