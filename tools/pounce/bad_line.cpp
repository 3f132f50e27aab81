// SPDX-License-Identifier: Apache-2.0
//
// Command lines that make no sense: how they are told, and what was probably meant.
#include "bad_line.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>

#include "commands.h"
#include "job.h"
#include "pounce/error.h"
#include "pounce/report.h"
#include "pounce/version.h"
#include "summary.h"
#include "terminal.h"

namespace pounce::cli {
namespace {

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

std::vector<std::string> long_options(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

bool is_known(const std::string& name, const std::vector<std::string>& known) {
  return std::find(known.begin(), known.end(), name) != known.end();
}

std::string before_equals(const std::string& argument) {
  return argument.substr(0, argument.find('='));
}

bool is_word(const std::string& text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](unsigned char c) {
    return std::isalpha(c) != 0 || c == '-';
  });
}

bool is_number(const std::string& text) {
  return !text.empty() && text.find_first_not_of("0123456789.") == std::string::npos;
}

bool is_unit(const std::string& text) {
  const std::string unit = lower(text);
  return unit == "b" ||
         (unit.size() <= 3 && std::string("kmgt").find(unit[0]) != std::string::npos &&
          (unit.substr(1).empty() || unit.substr(1) == "b" || unit.substr(1) == "ib"));
}

}  // namespace

BadLine read_bad_line(const std::vector<std::string>& arguments) {
  BadLine line;
  bool quiet = false;
  std::string progress;
  for (std::size_t i = 0; i < arguments.size() && arguments[i] != "--"; ++i) {
    const std::string name = before_equals(arguments[i]);
    const bool has_value = name.size() < arguments[i].size();
    const auto value = [&] {
      return has_value                  ? arguments[i].substr(name.size() + 1)
             : i + 1 < arguments.size() ? arguments[i + 1]
                                        : std::string();
    };
    quiet = quiet || name == "-q" || name == "--quiet";
    if (name == "--progress") progress = value();
    if (name == "--report") line.report_path = value();
  }
  line.json = progress == "json" && !quiet;
  try {
    if (!line.report_path.empty()) parse_report_path("--report", line.report_path);
  } catch (const Error&) {
    line.report_path.clear();  // which may be what is wrong
  }
  return line;
}

bool tell_bad_line(const BadLine& line, const std::string& command, const std::string& message) {
  Report report;
  report.version = POUNCE_VERSION;
  report.command = command;
  report.failure =
      Failure{error_kind_name(ErrorKind::usage), exit_status(ErrorKind::usage), message};
  write_failed_report(line.report_path, line.json ? ProgressKind::json : ProgressKind::plain,
                      report);
  if (line.json)
    write_stderr(warnings_json(report) + end_line(report, report.failure->exit_status));
  return !line.json;
}

std::vector<std::string> command_names(const CLI::App& program) {
  std::vector<std::string> names;
  for (const CLI::App* command : program.get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(command->get_name());
  return names;
}

std::string line_advice(const CLI::App& command, const std::vector<std::string>& arguments) {
  const std::vector<std::string> known = long_options(command);
  for (const std::string& argument : arguments) {
    if (argument == "--") break;
    const std::string name = before_equals(argument);
    if (!name.starts_with("--") || is_known(name, known)) continue;
    const std::string meant = did_you_mean(name, known);
    return meant.empty() ? fmt::format("; {} does not accept {}", command.get_name(), name)
                         : fmt::format("; {} is unknown{}", name, meant);
  }
  return "";
}

void refuse_lookalikes(const CLI::App& command, const std::vector<std::string>& arguments) {
  const std::vector<std::string> known = long_options(command);
  for (std::size_t i = 0; i < arguments.size() && arguments[i] != "--"; ++i) {
    const std::string& argument = arguments[i];
    const std::string name = before_equals(argument);
    if (name.size() >= 4 && name[0] == '-' && is_word(name.substr(1)) && name[1] != '-') {
      const std::string twice = "-" + name;
      const auto meant = std::find_if(known.begin(), known.end(), [&](const std::string& option) {
        return option.starts_with(twice);
      });
      if (meant != known.end()) {
        throw Error(ErrorKind::usage, fmt::format("{}: long options begin with two dashes; did you "
                                                  "mean {}?",
                                                  name, *meant));
      }
    }
    const bool has_size = argument == "--memory" || argument == "--cache-limit" ||
                          argument == "--max-temp" || argument == "--to";
    if (has_size && i + 2 < arguments.size() && is_number(arguments[i + 1]) &&
        is_unit(arguments[i + 2])) {
      throw Error(ErrorKind::usage,
                  fmt::format("{0}: got \"{1}\" and \"{2}\", expected a single word: {0} {1}{2}",
                              argument, arguments[i + 1], arguments[i + 2]));
    }
  }
}

}  // namespace pounce::cli
