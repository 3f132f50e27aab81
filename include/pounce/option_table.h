// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pounce/error.h"
#include "pounce/export.h"
#include "pounce/options.h"
#include "pounce/report.h"

/// Options by name and as text: what the command line, a report, a form or a binding for another
/// language needs. Every option of a job is a row of a table; see docs/options.md.
namespace pounce {

/// The commands that run a job.
enum class JobCommand : std::uint8_t {
  transfer,   ///< TransferOptions
  maps,       ///< MapsOptions
  gaussians,  ///< GaussiansOptions
  apply,      ///< TransferOptions whose source is a hit map
  proxy,      ///< ProxyOptions
  mesh,       ///< TexturedMeshOptions
};
/// "transfer", "maps", "gaussians", "apply", "proxy", "mesh".
POUNCE_API const char* job_command_name(JobCommand command) noexcept;

/// How many values an option has.
enum class OptionValues : std::uint8_t {
  none,     ///< a switch: "true" or "false"
  one,      ///< one value
  list,     ///< one text with values between commas: "normal,height"
  several,  ///< one value each time it is set
};

/// One option, as help shows it. Text is English, in one paragraph that is not wrapped.
struct OptionInfo {
  std::string name;   ///< "size": "--size" on the command line; "source", "target": operands
  char letter = 0;    ///< 'o' for "-o"; 0: none
  std::string value;  ///< placeholder of its value, such as "N|WxH" or "up|down"; empty: a switch
  std::string group;  ///< heading in help
  std::string help;
  std::string range;         ///< legal numbers, such as "0 to 16"; empty: in `help`
  std::string default_text;  ///< what holds if it is not set, for people; empty: nothing
  /// The default as a value that set_option() accepts, if it is the same for every job; setting it
  /// changes nothing. Empty: none, or it depends on the files.
  std::string usual;
  OptionValues values = OptionValues::one;
  bool is_operand = false;   ///< no name on the command line
  bool is_required = false;  ///< there is no default
  std::string excludes;      ///< name of the option that cannot be combined with it; empty: none
};

/// All options of a command, operands first, then group by group.
POUNCE_API const std::vector<OptionInfo>& option_table(JobCommand command);

/// Sets the option of this name. Throws Error(usage) that names the option, the text and what is
/// expected, also for a name that the command does not have.
POUNCE_API void set_option(TransferOptions& options, const std::string& name,
                           const std::string& text);
POUNCE_API void set_option(MapsOptions& options, const std::string& name, const std::string& text);
POUNCE_API void set_option(GaussiansOptions& options, const std::string& name,
                           const std::string& text);
POUNCE_API void set_option(ProxyOptions& options, const std::string& name, const std::string& text);
POUNCE_API void set_option(TexturedMeshOptions& options, const std::string& name,
                           const std::string& text);

/// The options that differ from their defaults, as texts that set_option() accepts: what a report
/// records of them (Report::options).
POUNCE_API std::vector<OptionReport> option_texts(const TransferOptions& options);
POUNCE_API std::vector<OptionReport> option_texts(const MapsOptions& options);
POUNCE_API std::vector<OptionReport> option_texts(const GaussiansOptions& options);
POUNCE_API std::vector<OptionReport> option_texts(const ProxyOptions& options);
POUNCE_API std::vector<OptionReport> option_texts(const TexturedMeshOptions& options);

/// The command and options in a report, to run it again.
struct RecordedJob {
  std::string command;
  std::vector<OptionReport> options;
};
/// Reads a report (JSON, docs/report.md), or any JSON object with "command" and "options" in the
/// same form. Throws Error(input) if it is none, Error(storage) if it cannot be read.
POUNCE_API RecordedJob read_job(const std::string& path);

// Texts of values, as the command line has them. `option` is the option's name for messages
// ("--size"). All throw Error(usage) that names the option, the text and what is expected.

/// A finite decimal number of `lowest`..`highest`.
POUNCE_API double parse_number(const std::string& option, const std::string& text, double lowest,
                               double highest);
/// An amount of memory: a number >= 1 byte with an optional unit. K, M, G, T and KiB, MiB, GiB, TiB
/// count in 1024s; kB, MB, GB, TB in 1000s; upper and lower case are the same.
POUNCE_API std::uint64_t parse_bytes(const std::string& option, const std::string& text);
/// A time in seconds: a number with s, min, h, d or w.
POUNCE_API double parse_duration(const std::string& option, const std::string& text);
/// A path: not empty, and not what looks like the next option.
POUNCE_API std::string parse_path(const std::string& option, const std::string& text);

/// "; did you mean NAME?" for the name that `word` probably misspells; "" if none is close.
POUNCE_API std::string did_you_mean(const std::string& word, const std::vector<std::string>& known);

}  // namespace pounce
