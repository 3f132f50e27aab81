// SPDX-License-Identifier: Apache-2.0
//
// What is printed from the tables of options: their description, texts of values, refusals.
//
// An option is described once, in its row (row.h), and all that a program can say of it is derived
// here: help, reports, hashes, refusals, values from C++ (docs/decisions/052-option-table.md). The
// functions are templates over the options of a command; each command has a table of its own and
// needs no other.
//
// A row prints nothing for a value that equals its default. That one rule serves all: such an
// option is not in the report, not in the hash, and refused nowhere.
#include "pounce/option_table.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <span>

#include "core/file.h"
#include "io/image/write.h"
#include "options/row.h"
#include "options/table.h"

namespace pounce {

namespace options {
namespace {

/// As messages name it: as it is typed.
std::string typed_name(const OptionInfo& info) {
  // Operands have no dashes and are named by their placeholder: "SOURCE", not "--source".
  if (info.is_operand) return info.value;
  return info.letter != 0 ? std::string{'-', info.letter} : "--" + info.name;
}

template <class Options>
std::vector<OptionInfo> infos() {
  std::vector<OptionInfo> infos;
  for (const Row<Options>& row : rows_of<Options>()) infos.push_back(row.info);
  return infos;
}

template <class Options>
void set(Options& options, const std::string& name, const std::string& text) {
  // A linear search: a job has some dozens of options and sets each of them once.
  std::vector<std::string> known;
  for (const Row<Options>& row : rows_of<Options>()) {
    if (row.info.name == name) return row.set(options, typed_name(row.info), text);
    known.push_back(row.info.name);
  }
  throw Error(ErrorKind::usage,
              fmt::format("{}: unknown option{}", name, did_you_mean(name, known)));
}

template <class Options>
std::vector<OptionReport> texts_where(const Options& options, bool (*counts)(const Row<Options>&)) {
  // In the order of the rows, whatever order they were set in: the hash depends on it.
  std::vector<OptionReport> texts;
  for (const Row<Options>& row : rows_of<Options>()) {
    if (!counts(row)) continue;
    const bool is_list =
        row.info.values == OptionValues::list || row.info.values == OptionValues::several;
    Texts values = row.get(options);
    if (!values.empty()) texts.push_back({row.info.name, std::move(values), is_list});
  }
  return texts;
}

template <class Options>
std::vector<OptionReport> all_texts(const Options& options) {
  return texts_where<Options>(options, [](const Row<Options>&) { return true; });
}

template <class Options>
const std::string& source_of(const Options& options) {
  return options.source;
}
const std::string& source_of(const TexturedMeshOptions& options) { return options.transfer.source; }

}  // namespace

template <class Options>
std::vector<OptionReport> hashed_texts(const Options& options) {
  return texts_where<Options>(
      options, [](const Row<Options>& row) { return row.hashed == Hashed::as_text; });
}

template <class Options>
void check_ranges(const Options& options) {
  for (const Row<Options>& row : rows_of<Options>()) {
    if (!row.is_checked) continue;
    // Printed, then read into options that nobody keeps. Only the refusal matters.
    Options ignored;
    for (const std::string& text : row.get(options)) row.set(ignored, typed_name(row.info), text);
  }
}

template <class Options>
void refuse_unsuitable(const Options& options, Source kind) {
  const char* const is = kind == Source::splats ? "a splat scene"
                         : kind == Source::map  ? "a hit map"
                                                : "a mesh";
  // What has its default is not refused, so a script may pass defaults to any kind of source.
  for (const Row<Options>& row : rows_of<Options>()) {
    if (applies_to(row.source, kind) || row.get(options).empty()) continue;
    Texts suitable;
    if (applies_to(row.source, Source::mesh)) suitable.emplace_back("meshes");
    if (applies_to(row.source, Source::splats)) suitable.emplace_back("splat scenes");
    throw Error(ErrorKind::usage,
                fmt::format("{} applies only to {}; {} is {}", typed_name(row.info),
                            fmt::join(suitable, " and "), source_of(options), is));
  }
}

void refuse_formats(const TransferOptions& options) {
  Texts outputs{options.output};
  for (const ChannelOutput& own : options.image.channel_outputs) outputs.push_back(own.path);
  if (!options.image.map_output.empty()) outputs.push_back(options.image.map_output);
  const Depth depth = options.image.depth.value_or(Depth::u8);  // no source is known yet
  const auto format_of = [depth](const std::string& path) {
    const std::string name = io::format_look(path, depth).name;
    return name.empty() ? "PNG" : name;  // in a model
  };
  for (const Row<TransferOptions>& row : rows_of<TransferOptions>()) {
    if (row.formats.empty() || row.get(options).empty()) continue;
    // One output of the format is enough: channels may have different formats (--output-for), and
    // the option then applies to those that have it.
    const bool is_met = std::any_of(outputs.begin(), outputs.end(), [&](const auto& path) {
      return std::find(row.formats.begin(), row.formats.end(), format_of(path)) !=
             row.formats.end();
    });
    if (is_met) continue;
    throw Error(ErrorKind::usage,
                fmt::format("{} applies only to {} output, but {} is not", typed_name(row.info),
                            fmt::join(row.formats, " or "), options.output));
  }
}

void refuse_unsuitable(const TransferOptions& options, Method method) {
  // By method as by source above: only what belongs to the other one, and was set.
  const Only other = method == Method::surface ? Only::gaussian : Only::surface;
  for (const Row<TransferOptions>& row : rows_of<TransferOptions>()) {
    if (row.method != other || row.get(options).empty()) continue;
    throw Error(
        ErrorKind::usage,
        fmt::format("{0} applies only to --method {1}; use that method, or remove {0}",
                    typed_name(row.info),
                    method_name(other == Only::surface ? Method::surface : Method::gaussian)));
  }
}

// The templates are instantiated here, so that tables and rows stay inside of this room.
template std::vector<OptionReport> hashed_texts(const TransferOptions&);
template std::vector<OptionReport> hashed_texts(const MapsOptions&);
template void check_ranges(const TransferOptions&);
template void check_ranges(const MapsOptions&);
template void check_ranges(const GaussiansOptions&);
template void check_ranges(const ProxyOptions&);
template void check_ranges(const TexturedMeshOptions&);
template void refuse_unsuitable(const TransferOptions&, Source);
template void refuse_unsuitable(const GaussiansOptions&, Source);
template void refuse_unsuitable(const ProxyOptions&, Source);
template void refuse_unsuitable(const TexturedMeshOptions&, Source);

}  // namespace options

const char* job_command_name(JobCommand command) noexcept {
  switch (command) {
    case JobCommand::maps:
      return "maps";
    case JobCommand::gaussians:
      return "gaussians";
    case JobCommand::apply:
      return "apply";
    case JobCommand::proxy:
      return "proxy";
    case JobCommand::mesh:
      return "mesh";
    case JobCommand::transfer:
      break;
  }
  return "transfer";
}

const std::vector<OptionInfo>& option_table(JobCommand command) {
  // Built when first asked for, once. Callers keep references.
  static const std::vector<OptionInfo> transfer = options::infos<TransferOptions>();
  static const std::vector<OptionInfo> maps = options::infos<MapsOptions>();
  static const std::vector<OptionInfo> gaussians = options::infos<GaussiansOptions>();
  static const std::vector<OptionInfo> apply = options::apply_infos();
  static const std::vector<OptionInfo> proxy = options::infos<ProxyOptions>();
  static const std::vector<OptionInfo> mesh = options::infos<TexturedMeshOptions>();
  switch (command) {
    case JobCommand::maps:
      return maps;
    case JobCommand::gaussians:
      return gaussians;
    case JobCommand::apply:
      return apply;
    case JobCommand::proxy:
      return proxy;
    case JobCommand::mesh:
      return mesh;
    case JobCommand::transfer:
      break;
  }
  return transfer;
}

void set_option(TransferOptions& options, const std::string& name, const std::string& text) {
  options::set(options, name, text);
}
void set_option(MapsOptions& options, const std::string& name, const std::string& text) {
  options::set(options, name, text);
}
void set_option(GaussiansOptions& options, const std::string& name, const std::string& text) {
  options::set(options, name, text);
}
void set_option(ProxyOptions& options, const std::string& name, const std::string& text) {
  options::set(options, name, text);
}
void set_option(TexturedMeshOptions& options, const std::string& name, const std::string& text) {
  options::set(options, name, text);
}

std::vector<OptionReport> option_texts(const TransferOptions& options) {
  return options::all_texts(options);
}
std::vector<OptionReport> option_texts(const MapsOptions& options) {
  return options::all_texts(options);
}
std::vector<OptionReport> option_texts(const GaussiansOptions& options) {
  return options::all_texts(options);
}
std::vector<OptionReport> option_texts(const ProxyOptions& options) {
  return options::all_texts(options);
}
std::vector<OptionReport> option_texts(const TexturedMeshOptions& options) {
  return options::all_texts(options);
}

// --- job files -----------------------------------------------------------------------------------
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
