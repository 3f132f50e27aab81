// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <array>
#include <csignal>
#include <cstdio>
#include <exception>
#include <new>
#include <string>

#include "commands.h"
#include "job.h"
#include "pounce/error.h"
#include "pounce/version.h"
#include "shared_options.h"
#include "signals.h"
#include "visible.h"

namespace {

using pounce::cli::Command;

constexpr const char* kUsage =
    "Usage: pounce COMMAND ...      (pounce COMMAND --help tells more)\n"
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

/// Says what is wrong with the command line and where to read on.
int usage_error(const CLI::App& program, const std::string& message) {
  std::string name = "pounce";
  for (const CLI::App* command = &program; !command->get_subcommands().empty();) {
    command = command->get_subcommands().front();
    name += " " + command->get_name();
  }
  pounce::cli::write_stderr("pounce: error: " + pounce::cli::visible_line(message) + "\nTry '" +
                            name + " --help'.\n");
  return pounce::exit_status(pounce::ErrorKind::usage);
}

int run(int argc, char** argv) {
  CLI::App program(
      "pounce moves the appearance of a textured mesh or a splat scene onto the UV textures of a "
      "mesh.",
      "pounce");
  program.set_version_flag("--version", "pounce " POUNCE_VERSION);
  program.require_subcommand(1);
  pounce::cli::set_help_text(program, kUsage);
  const std::array commands{
      pounce::cli::add_transfer_command(program),  pounce::cli::add_maps_command(program),
      pounce::cli::add_gaussians_command(program), pounce::cli::add_inspect_command(program),
      pounce::cli::add_compare_command(program),   pounce::cli::add_cache_command(program)};
  try {
    program.parse(argc, argv);
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
    const auto unknown = program.remaining();
    if (argc < 2) return usage_error(program, "no command was given");
    if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr && argc == 2 &&
        program.got_subcommand("cache")) {
      return usage_error(program, "cache does one of: info, list, verify, prune, clear");
    }
    if (!program.get_subcommands().empty() || unknown.empty()) {
      return usage_error(program, error.what());
    }
    return usage_error(
        program, "\"" + unknown.front() +
                     "\" is not a command; there are transfer, maps, gaussians, inspect, compare, "
                     "cache");
  } catch (const pounce::Error& error) {
    if (error.kind() != pounce::ErrorKind::usage) throw;
    return usage_error(program, error.what());
  }
  throw pounce::Error(pounce::ErrorKind::internal, "a command was parsed and not found");
}

}  // namespace

int main(int argc, char** argv) try {
  pounce::cli::handle_signals();  // where early_check.cpp is not part of the program
  occupy_standard_streams();
  std::signal(SIGXFSZ, SIG_IGN);  // a file size limit is then an error of write(), like a full disk
  return run(argc, argv);
} catch (const pounce::Error& error) {
  pounce::cli::write_stderr("pounce: error: " + pounce::cli::visible_line(error.what()) + "\n");
  return pounce::exit_status(error.kind());
} catch (const std::bad_alloc&) {
  pounce::cli::write_stderr("pounce: error: out of memory; give it more (ulimit -v, ulimit -d)\n");
  return pounce::exit_status(pounce::ErrorKind::budget);
} catch (const std::exception& error) {
  pounce::cli::write_stderr("pounce: internal error: " + pounce::cli::visible_line(error.what()) +
                            " (please report)\n");
  return pounce::exit_status(pounce::ErrorKind::internal);
}
