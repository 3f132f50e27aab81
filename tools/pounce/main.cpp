// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <csignal>
#include <cstdio>
#include <exception>
#include <new>
#include <string>
#include <utility>
#include <vector>

#include "commands.h"
#include "job.h"
#include "pounce/error.h"
#include "pounce/version.h"
#include "terminal.h"

namespace {

using pounce::cli::Command;

constexpr const char* kUsage =
    "Usage: pounce COMMAND ...      (pounce COMMAND --help lists its options)\n"
    "\n"
    "Examples:\n"
    "  pounce transfer scan.glb avatar.glb -o avatar.png\n"
    "  pounce compare avatar.png truth.png --min-psnr 40";

/// A file opened by the job must never get the number of a standard stream that the caller closed:
/// progress would be written into it. The substitutes refuse what a closed stream refuses.
void occupy_standard_streams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (fcntl(stream, F_GETFD) >= 0) continue;
    // The lowest free number is this one, since those below it are taken by now.
    if (open("/dev/null", stream == STDIN_FILENO ? O_WRONLY : O_RDONLY) < 0) return;
  }
}

/// The command that the line begins with, if it does.
const CLI::App* named_command(const CLI::App& program, int argc, char** argv) {
  if (argc < 2) return nullptr;
  for (const CLI::App* command : program.get_subcommands([](const CLI::App*) { return true; })) {
    if (command->get_name() == argv[1]) return command;
  }
  return nullptr;
}

std::string chosen_name(const CLI::App& program, int argc, char** argv) {
  const CLI::App* named = named_command(program, argc, argv);
  return named == nullptr ? "" : named->get_name();
}

/// Says what is wrong with the command line and where to read on: where it `is_untold`, as a failed
/// job does, in JSON where the line asks for that, and in a report where it names one.
int usage_error(const CLI::App& program, const std::string& chosen, int argc, char** argv,
                bool is_untold, const std::string& message) {
  std::string name = chosen.empty() ? "pounce" : "pounce " + chosen;
  const CLI::App* command = &program;
  for (int depth = 0; !command->get_subcommands().empty(); ++depth) {
    command = command->get_subcommands().front();
    if (depth > 0) name += " " + command->get_name();
  }
  const auto line = pounce::cli::read_bad_line({argv + 1, argv + argc});
  if (!is_untold || pounce::cli::tell_bad_line(line, chosen, message)) {
    pounce::cli::write_stderr("pounce: error: " + pounce::cli::visible_line(message) + "\nTry '" +
                              name + " --help'.\n");
  }
  return pounce::exit_status(pounce::ErrorKind::usage);
}

/// "compare takes A and B: ...".
std::string too_many(const CLI::App& command, const std::string& what) {
  std::string takes;
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_positional()) takes += (takes.empty() ? "" : " and ") + option->get_name(true);
  }
  return what + "; " + command.get_name() + " takes " + (takes.empty() ? "options only" : takes);
}

/// What was probably meant by a command line that cannot be parsed.
std::string parse_problem(const CLI::App& program, int argc, char** argv,
                          const CLI::ParseError& error) {
  const std::vector<std::string> arguments{argv + 1, argv + argc};
  if (arguments.empty()) return "no command given";
  if (const CLI::App* cache = named_command(program, argc, argv);
      cache != nullptr && cache->get_name() == "cache" && cache->get_subcommands().empty()) {
    constexpr const char* kActions = "cache needs one of: info, list, verify, prune, clear";
    if (arguments.size() == 1) return kActions;
    return "\"" + arguments[1] + "\": " + kActions +
           (arguments[1] == "purge"
                ? "; did you mean clear?"
                : pounce::did_you_mean(arguments[1], pounce::cli::command_names(*cache)));
  }
  const auto unknown = program.remaining();
  if (program.get_subcommands().empty() && !unknown.empty()) {
    return "\"" + unknown.front() + "\" is not a command; choose transfer, apply, maps, " +
           "gaussians, proxy, mesh, inspect, compare, cache, prepare, assemble, status or submit" +
           pounce::did_you_mean(unknown.front(), pounce::cli::command_names(program));
  }
  const CLI::App* command = &program;
  while (!command->get_subcommands().empty()) command = command->get_subcommands().front();
  const std::string what = error.what();
  constexpr const char* kTwice = ": At Most 1 required";
  if (const std::size_t at = what.find(kTwice); at != std::string::npos)
    return what.substr(0, at) + ": given more than once; specify it once";
  const std::string advice = pounce::cli::line_advice(*command, arguments);
  const bool is_extra = dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr;
  if (is_extra && advice.empty()) return too_many(*command, what);
  return what + advice;
}

/// "help", "help transfer" and "version" as first words, as other programs have them.
std::vector<std::string> with_usual_words(std::vector<std::string> arguments) {
  if (arguments.empty()) return arguments;
  if (arguments.front() == "version" && arguments.size() == 1) return {"--version"};
  if (arguments.front() != "help") return arguments;
  arguments.erase(arguments.begin());
  arguments.emplace_back("--help");
  return arguments;
}

int run(int argc, char** argv) {
  CLI::App program(
      "pounce transfers the appearance of a textured mesh or a Gaussian splat scene onto the UVs "
      "of "
      "another mesh, within a memory limit you set.",
      "pounce");
  program.set_version_flag("--version", "pounce " POUNCE_VERSION);
  program.require_subcommand(1);
  pounce::cli::set_help_text(program, kUsage);
  // What is meant for another program: it would be read as operands.
  std::vector<std::string> words{argv + 1, argv + argc}, rest;
  if (const auto end = std::find(words.begin(), words.end(), "--");
      !words.empty() && words.front() == "submit" && end != words.end()) {
    rest.assign(end + 1, words.end());
    words.erase(end, words.end());
  }
  const std::array commands{
      pounce::cli::add_transfer_command(program), pounce::cli::add_apply_command(program),
      pounce::cli::add_maps_command(program),     pounce::cli::add_gaussians_command(program),
      pounce::cli::add_proxy_command(program),    pounce::cli::add_mesh_command(program),
      pounce::cli::add_prepare_command(program),  pounce::cli::add_assemble_command(program),
      pounce::cli::add_status_command(program),   pounce::cli::add_submit_command(program, rest),
      pounce::cli::add_inspect_command(program),  pounce::cli::add_compare_command(program),
      pounce::cli::add_cache_command(program)};
  bool is_parsed = false;
  try {
    if (argc == 3 && std::string(argv[1]) == "--generate") {
      pounce::cli::write_stdout(pounce::cli::generate(program, argv[2]));
      return 0;
    }
    std::vector<std::string> arguments = with_usual_words(words);
    std::reverse(arguments.begin(), arguments.end());  // as CLI11 takes them
    if (const CLI::App* named = named_command(program, argc, argv))
      pounce::cli::refuse_lookalikes(*named, {argv + 2, argv + argc});
    program.parse(std::move(arguments));
    is_parsed = true;
    for (const Command& command : commands) {
      if (command.parser->parsed()) return command.run();
    }
  } catch (const CLI::CallForHelp&) {
    const CLI::App* chosen = &program;
    while (!chosen->get_subcommands().empty()) chosen = chosen->get_subcommands().front();
    pounce::cli::write_stdout(chosen->help());
    return 0;
  } catch (const CLI::CallForVersion& version) {
    pounce::cli::write_stdout(std::string(version.what()) + "\n");
    return 0;
  } catch (const CLI::ParseError& error) {
    return usage_error(program, chosen_name(program, argc, argv), argc, argv, true,
                       parse_problem(program, argc, argv, error));
  } catch (const pounce::Error& error) {
    if (error.kind() != pounce::ErrorKind::usage) throw;
    return usage_error(program, chosen_name(program, argc, argv), argc, argv, !is_parsed,
                       error.what());
  }
  throw pounce::Error(pounce::ErrorKind::internal, "a command was parsed and not found");
}

}  // namespace

int main(int argc, char** argv) try {
  pounce::cli::handle_signals();  // where early_check.cpp is not part of the program
  occupy_standard_streams();
  pounce::cli::keep_stderr();
  std::signal(SIGXFSZ, SIG_IGN);  // a file size limit is then an error of write(), like a full disk
  return run(argc, argv);
} catch (const pounce::Error& error) {
  pounce::cli::write_stderr("pounce: error: " + pounce::cli::visible_line(error.what()) + "\n");
  return error.kind() == pounce::ErrorKind::cancelled ? pounce::cli::stopped_status()
                                                      : pounce::exit_status(error);
} catch (const std::bad_alloc&) {
  pounce::cli::write_stderr(
      "pounce: error: out of memory; raise the limit (ulimit -v, ulimit -d)\n");
  return pounce::exit_status(pounce::ErrorKind::budget);
} catch (const std::exception& error) {
  pounce::cli::write_stderr("pounce: internal error: " + pounce::cli::visible_line(error.what()) +
                            " (please report)\n");
  return pounce::exit_status(pounce::ErrorKind::internal);
}
