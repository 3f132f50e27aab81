// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace CLI {  // NOLINT(readability-identifier-naming): CLI11's own
class App;
}

namespace pounce::cli {

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
