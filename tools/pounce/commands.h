// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>
#include <vector>

#include "job.h"
#include "pounce/option_table.h"

namespace pounce::cli {

/// One command of the program: its parser, and what to do once parsing has filled in its options.
/// run() returns the exit status and throws pounce::Error.
struct Command {
  CLI::App* parser = nullptr;
  std::function<int()> run;
};

Command add_transfer_command(CLI::App& program);
Command add_prepare_command(CLI::App& program);
Command add_assemble_command(CLI::App& program);
Command add_status_command(CLI::App& program);
/// `rest`: what follows "--" on the command line.
Command add_submit_command(CLI::App& program, const std::vector<std::string>& rest);
Command add_apply_command(CLI::App& program);
Command add_maps_command(CLI::App& program);
Command add_gaussians_command(CLI::App& program);
Command add_proxy_command(CLI::App& program);
Command add_mesh_command(CLI::App& program);
Command add_inspect_command(CLI::App& program);
Command add_compare_command(CLI::App& program);
Command add_cache_command(CLI::App& program);

/// What is generated from the commands and their options: "man", "bash", "zsh", "fish" or
/// "markdown" (docs/options.md). Throws Error(usage) for another kind.
std::string generate(const CLI::App& program, const std::string& kind);

// What commands are made of. Help is one paragraph that is wrapped here.

/// Makes a command's help read: purpose, usage line and worked examples, options by group, exit
/// statuses.
void set_help_text(CLI::App& command, const std::string& usage_and_examples);

using SetText = std::function<void(const std::string& text)>;

/// Adds an option whose one value goes, as text, to `set`, which throws Error(usage).
CLI::Option* add_value(CLI::App& command, const std::string& name, const std::string& value_name,
                       const std::string& group, const std::string& help, SetText set);
/// Adds an option without a value that sets `flag` to `value`.
CLI::Option* add_switch(CLI::App& command, const std::string& name, const std::string& group,
                        const std::string& help, bool& flag, bool value = true);
/// Adds an option or operand of the table, each of whose values goes to `set`: "true" of a switch.
CLI::Option* add_row(CLI::App& command, const OptionInfo& info, SetText set);
/// Adds the row of this name in the table of transfer to another kind of command.
void add_transfer_row(CLI::App& command, const std::string& name, const std::string& group,
                      SetText set);
/// A path for a report: one that ends as meshes, splats or images do is refused, since writing
/// there would replace an input or a result.
std::string parse_report_path(const std::string& option, const std::string& text);
/// --report, --progress, -q and -v.
void add_job_options(CLI::App& command, JobSettings& settings);

// --- lines that cannot be parsed -----------------------------------------------------------------

/// What a command line that cannot be parsed still says of how its errors are to be told.
struct BadLine {
  std::string report_path;  ///< "": no report
  bool json = false;        ///< --progress json, without -q
};
BadLine read_bad_line(const std::vector<std::string>& arguments);

/// Writes the failed report and the JSON line that such a line asks for. True: the message is still
/// to be told as text.
bool tell_bad_line(const BadLine& line, const std::string& command, const std::string& message);

std::vector<std::string> command_names(const CLI::App& program);

/// What the arguments of a command hold that it does not know, and what was probably meant: a
/// sentence's end. "": nothing to say.
std::string line_advice(const CLI::App& command, const std::vector<std::string>& arguments);

/// Throws Error(usage) for what would be parsed as something else than it looks like: "-out x" is
/// "-o ut x", and "--memory 2 GiB" has a word too many.
void refuse_lookalikes(const CLI::App& command, const std::vector<std::string>& arguments);

}  // namespace pounce::cli
