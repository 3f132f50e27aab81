// SPDX-License-Identifier: Apache-2.0
#include "commands.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
#include <memory>
#include <sstream>

#include "job.h"
#include "pounce/error.h"
#include "pounce/report.h"
#include "pounce/version.h"
#include "terminal.h"

namespace pounce::cli {
namespace {

constexpr std::size_t kHelpColumn = 30;
constexpr std::size_t kHelpWidth = 100;  // of the whole line

constexpr const char* kExitStatusHelp =
    "Exit status:\n"
    "    0  success\n"
    "    1  compare: below --min-psnr; transfer: below --min-coverage\n"
    "    2  invalid command line\n"
    "    3  a mesh, image or scene cannot be used\n"
    "    4  --memory is too small; the message names the least that works\n"
    "    5  a file or folder cannot be read, written or created; could not create threads\n"
    "    6  a cached file is damaged\n"
    "   70  internal error; please report it\n"
    "   75  may succeed later: disk full, or another process is building what this job needs\n"
    "  130  interrupted; no incomplete output is left, the same command continues\n"
    "  143  the same, terminated (SIGTERM, SIGUSR1)";

class HelpFormatter : public CLI::Formatter {
 public:
  explicit HelpFormatter(std::string usage) : usage_(std::move(usage)) {
    column_width(kHelpColumn);
  }
  std::string make_usage(const CLI::App*, std::string) const override {
    return "\n" + usage_ + "\n";
  }
  std::string make_option_opts(const CLI::Option* option) const override {
    const std::string& value = option->get_option_text();  // and no list of what it excludes
    return value.empty() ? "" : " " + value;
  }
  std::string make_option_desc(const CLI::Option* option) const override {
    return wrapped(option->get_description());
  }

 private:
  static std::string wrapped(const std::string& paragraph) {
    std::istringstream words(paragraph);
    std::string text, line;
    for (std::string word; words >> word;) {
      if (!line.empty() && line.size() + 1 + word.size() > kHelpWidth - kHelpColumn) {
        text += line + "\n";
        line.clear();
      }
      line += (line.empty() ? "" : " ") + word;
    }
    return text + line;
  }

  std::string usage_;
};

/// The help of a row: what it does, then its range and default.
std::string help_of(const OptionInfo& info) {
  const bool has_default = !info.default_text.empty();
  if (!has_default && info.range.empty()) return info.help;
  return fmt::format("{} [{}{}{}{}]", info.help, info.range,
                     has_default && !info.range.empty() ? "; " : "", has_default ? "default: " : "",
                     info.default_text);
}

}  // namespace

void set_help_text(CLI::App& command, const std::string& usage_and_examples) {
  command.formatter(std::make_shared<HelpFormatter>(usage_and_examples));
  command.footer(kExitStatusHelp);
}

CLI::Option* add_value(CLI::App& command, const std::string& name, const std::string& value_name,
                       const std::string& group, const std::string& help, SetText set) {
  return command.add_option_function<std::string>(name, std::move(set), help)
      ->type_name(value_name)  // for "1 required SIZE missing"
      ->option_text(value_name)
      ->group(group);
}

CLI::Option* add_switch(CLI::App& command, const std::string& name, const std::string& group,
                        const std::string& help, bool& flag, bool value) {
  return command
      .add_flag_callback(
          name, [&flag, value] { flag = value; }, help)
      ->disable_flag_override()  // --plan=no would read like the opposite of what it does
      ->group(group);
}

CLI::Option* add_row(CLI::App& command, const OptionInfo& info, SetText set) {
  const bool is_several = info.values == OptionValues::several;
  const auto set_all = [set](const std::vector<std::string>& texts) {
    for (const std::string& text : texts) set(text);
  };
  if (info.is_operand) {
    CLI::Option* operand =
        is_several ? command.add_option_function<std::vector<std::string>>(info.value, set_all)
                   : command.add_option_function<std::string>(info.value, set);
    return operand->description(info.help)->option_text(is_several ? "..." : " ");
  }
  const std::string name =
      (info.letter != 0 ? std::string{'-', info.letter, ','} : "") + "--" + info.name;
  if (info.values == OptionValues::none) {
    return command
        .add_flag_callback(
            name, [set] { set("true"); }, help_of(info))
        ->disable_flag_override()
        ->group(info.group);
  }
  if (!is_several) return add_value(command, name, info.value, info.group, help_of(info), set);
  return command.add_option_function<std::vector<std::string>>(name, set_all, help_of(info))
      ->type_name(info.value)
      ->option_text(info.value)
      ->expected(1)
      ->allow_extra_args(false)  // else "[bc]", a pattern, is a list of CLI11's
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
      ->group(info.group);
}

void add_transfer_row(CLI::App& command, const std::string& name, const std::string& group,
                      SetText set) {
  for (OptionInfo info : option_table(JobCommand::transfer)) {
    if (info.name != name) continue;
    info.group = group;
    add_row(command, info, set);
  }
}

std::string parse_report_path(const std::string& option, const std::string& text) {
  static constexpr const char* kNotReports[] = {
      ".glb", ".gltf", ".bin", ".obj", ".mtl", ".ply",  ".png",  ".jpg", ".jpeg", ".tif", ".tiff",
      ".tx",  ".exr",  ".ppm", ".pgm", ".pnm", ".webp", ".ktx2", ".bmp", ".tga",  ".hdr"};
  std::string path = parse_path(option, text);
  std::transform(path.begin(), path.end(), path.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  for (const char* ending : kNotReports) {
    if (!path.ends_with(ending)) continue;
    throw Error(ErrorKind::usage,
                fmt::format("{}: got \"{}\", expected a name for JSON (such as report.json), not "
                            "for a mesh or an image",
                            option, text));
  }
  return text;
}

void add_job_options(CLI::App& command, JobSettings& settings) {
  const char* const group = "Reporting";
  add_value(command, "--report", "FILE", group,
            "Write a JSON report: times, counts, bytes, memory, warnings, outputs and options; "
            "also of a job that fails, with its error. - is the standard output",
            [&settings](const std::string& text) {
              settings.report_path = parse_report_path("--report", text);
            });
  add_value(command, "--progress", "auto|plain|json|openjd|none", group,
            "Progress on the standard error output. auto: a bar on a terminal, else plain. plain: "
            "a line every few seconds and at the end of each stage. json: one JSON object per "
            "line; the last states how the job ended. openjd: openjd_progress, openjd_status and "
            "openjd_fail on the standard output [default: auto]",
            [&settings](const std::string& text) {
              settings.progress = parse_progress_kind("--progress", text);
            });
  CLI::Option* quiet =
      add_switch(command, "-q,--quiet", group, "Print errors only", settings.quiet);
  add_switch(command, "-v,--verbose", group,
             "Also print time per stage, memory and tiles at the end", settings.verbose)
      ->excludes(quiet);
}

// --- lines that cannot be parsed -----------------------------------------------------------------
//
// Command lines that make no sense: how they are told, and what was probably meant.

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
