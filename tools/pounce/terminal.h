// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdio>
#include <string>
#include <string_view>

#include "pounce/progress.h"

namespace pounce::cli {

/// Text as it may reach a terminal. Names in files and names of files may hold what a terminal
/// obeys: control characters and marks that turn the direction of writing become "\u001b" and the
/// like, which is also what JSON calls them, and bytes that are no UTF-8 become "\x9b". Line ends
/// and tabs stay, since they are ours; everything else is as it was.
std::string visible(std::string_view text);
/// The same for a message, which is one line whatever the names in it hold.
std::string visible_line(std::string_view text);

/// From here on the standard error output is the program's alone: what libraries print there
/// (libpng of a damaged image, in the middle of lines of JSON) is lost. Their reasons are in our
/// messages. Where descriptors are short all stays as it is. Once, before there are threads.
void keep_stderr() noexcept;
/// Where the program itself writes.
std::FILE* own_stderr() noexcept;
/// The same as a descriptor, for who may not use streams.
int own_stderr_descriptor() noexcept;

/// An errno of writing for which trying again may help: Error::is_passing().
bool may_pass(int code) noexcept;

/// Writes text or JSON to the standard output, visible(), and makes sure that it arrived; throws
/// Error(storage).
void write_stdout(const std::string& text);
/// Writes text to the standard error output, visible(). That it cannot be read there is no error.
void write_stderr(const std::string& text);

/// From here on SIGINT, SIGTERM, SIGUSR1 and SIGHUP (unless it is ignored, as under nohup) cancel
/// the job that runs, which ends within five seconds; without one, or as a second wish, they end
/// the process at once, with stopped_status(). To be called as early as can be; a second call
/// changes nothing.
void handle_signals() noexcept;
/// Of a job that a signal stopped: 143 for SIGTERM and SIGUSR1, which schedulers send, else 130.
inline constexpr int kTerminated = 143;
int stopped_status() noexcept;

/// While it lives, this is the job that runs.
class SignalsCancel {
 public:
  explicit SignalsCancel(Progress& progress);
  ~SignalsCancel();
  SignalsCancel(const SignalsCancel&) = delete;
  SignalsCancel& operator=(const SignalsCancel&) = delete;
};

}  // namespace pounce::cli
