// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

namespace CLI {  // NOLINT(readability-identifier-naming): CLI11's own
class App;
}

namespace pounce::cli {

/// One command of the program: its parser, and what to do once parsing has filled in its options.
/// run() returns the exit status and throws pounce::Error.
struct Command {
  CLI::App* parser = nullptr;
  std::function<int()> run;
};

Command add_transfer_command(CLI::App& program);
Command add_maps_command(CLI::App& program);
Command add_gaussians_command(CLI::App& program);
Command add_inspect_command(CLI::App& program);
Command add_compare_command(CLI::App& program);
Command add_cache_command(CLI::App& program);

}  // namespace pounce::cli
