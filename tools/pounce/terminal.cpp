// SPDX-License-Identifier: Apache-2.0
//
// What the program shares with the terminal that it was started from: its streams, and signals.
#include "terminal.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <ctime>

#include "pounce/error.h"

namespace pounce::cli {
namespace {

/// One character, or a byte that begins none: then size is 0.
struct Character {
  std::uint32_t code = 0;
  std::size_t size = 0;
};

Character first_character(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char lead = byte(0);
  if (lead < 0x80) return {lead, 1};
  const std::size_t size = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  if (lead < 0xC2 || lead > 0xF4 || size > text.size()) return {};
  std::uint32_t code = lead & (0x7FU >> size);
  for (std::size_t i = 1; i < size; ++i) {
    if ((byte(i) & 0xC0) != 0x80) return {};
    code = code << 6 | (byte(i) & 0x3FU);
  }
  // Longer than needed, half of a pair, beyond the last: terminals differ in what they make of it.
  const bool too_long = (size == 3 && code < 0x800) || (size == 4 && code < 0x10000);
  if (too_long || (code >= 0xD800 && code < 0xE000) || code > 0x10FFFF) return {};
  return {code, size};
}

bool is_obeyed(std::uint32_t code) {
  const bool turns_direction = (code >= 0x202A && code <= 0x202E) ||  // embeddings, overrides
                               (code >= 0x2066 && code <= 0x2069);    // isolates
  return code < 0x20 || (code >= 0x7F && code < 0xA0) || code == 0x2028 || code == 0x2029 ||
         turns_direction;
}

std::string visible_but(std::string_view kept, std::string_view text) {
  std::string out;
  out.reserve(text.size());
  while (!text.empty()) {
    const auto [code, size] = first_character(text);
    if (size == 0) {
      out += fmt::format("\\x{:02x}", static_cast<unsigned char>(text[0]));
    } else if (is_obeyed(code) && kept.find(text[0]) == std::string_view::npos) {
      out += fmt::format("\\u{:04x}", code);
    } else {
      out += text.substr(0, size);
    }
    text.remove_prefix(size == 0 ? 1 : size);
  }
  return out;
}

}  // namespace

std::string visible(std::string_view text) { return visible_but("\n\t", text); }

std::string visible_line(std::string_view text) { return visible_but("\t", text); }

namespace {

std::FILE* own = nullptr;
int own_descriptor = STDERR_FILENO;

}  // namespace

void keep_stderr() noexcept {
// What a sanitizer reports goes there, too.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
  const int copy = nowhere < 0 ? -1 : fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, STDERR_FILENO + 1);
  std::FILE* const stream = copy < 0 ? nullptr : fdopen(copy, "w");
  if (stream != nullptr && dup2(nowhere, STDERR_FILENO) == STDERR_FILENO) {
    std::setvbuf(stream, nullptr, _IONBF, 0);  // as stderr has it
    own = stream;
    own_descriptor = copy;
  } else if (stream != nullptr) {
    std::fclose(stream);
  } else if (copy >= 0) {
    close(copy);
  }
  if (nowhere >= 0) close(nowhere);
#endif
}

std::FILE* own_stderr() noexcept { return own != nullptr ? own : stderr; }
int own_stderr_descriptor() noexcept { return own_descriptor; }

bool may_pass(int code) noexcept {
  return code == ENOSPC || code == EDQUOT || code == EIO || code == ESTALE;
}

void write_stdout(const std::string& text) {
  const std::string shown = visible(text);
  const bool arrived = std::fwrite(shown.data(), 1, shown.size(), stdout) == shown.size() &&
                       std::fflush(stdout) == 0;
  if (arrived) return;
  const int reason = errno;
  throw Error(ErrorKind::storage,
              fmt::format("standard output: cannot write: {}", std::strerror(reason)),
              may_pass(reason));
}

void write_stderr(const std::string& text) {
  const std::string shown = visible(text);
  std::fwrite(shown.data(), 1, shown.size(), own_stderr());
}

namespace {

// What the signal handler may touch.
std::atomic<Progress*> running_job{nullptr};
std::atomic<std::int64_t> stopped_ms{0};
std::atomic<int> stopped_by{SIGINT};
static_assert(std::atomic<Progress*>::is_always_lock_free);
static_assert(std::atomic<std::int64_t>::is_always_lock_free);

/// A scheduler that stops a job kills it some seconds later: by then it must have ended by itself.
constexpr unsigned kMostSeconds = 4;

/// timeout(1) and other supervisors signal the process and then its group: that is one wish.
constexpr std::int64_t kSameWishMs = 500;

std::int64_t now_ms() {
  timespec now = {};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return std::int64_t{now.tv_sec} * 1000 + now.tv_nsec / 1'000'000;
}

extern "C" void stop_job(int signal) {
  const int before = errno;
  Progress* const progress = running_job.load();
  if (progress == nullptr || !progress->cancelled()) stopped_by = signal;
  if (progress == nullptr) _exit(stopped_status());
  if (!progress->cancelled()) {
    stopped_ms = now_ms();
    progress->cancel();
    alarm(kMostSeconds);
  } else if (now_ms() - stopped_ms > kSameWishMs) {
    _exit(stopped_status());
  }
  errno = before;
}

/// What is at work (a mesh of gigabytes, a disk that does not answer) looks too seldom whether it
/// should stop. A process may end anywhere without harm; see docs/exit-status.md.
extern "C" void stop_now(int) {
  constexpr std::string_view kSaid =
      "pounce: error: stopped in the middle of its work; run the same command again to go on\n";
  (void)!write(own_stderr_descriptor(), kSaid.data(), kSaid.size());
  _exit(stopped_status());
}

}  // namespace

void handle_signals() noexcept {
  struct sigaction action = {};
  action.sa_handler = stop_job;
  action.sa_flags = SA_RESTART;  // no read or write of a library fails for a signal
  sigemptyset(&action.sa_mask);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGUSR1}) {
    struct sigaction before = {};
    const bool outlives_terminal = signal == SIGHUP && sigaction(signal, nullptr, &before) == 0 &&
                                   before.sa_handler == SIG_IGN;
    if (!outlives_terminal) sigaction(signal, &action, nullptr);
  }
  action.sa_handler = stop_now;
  sigaction(SIGALRM, &action, nullptr);
}

int stopped_status() noexcept {
  const int signal = stopped_by;
  return signal == SIGTERM || signal == SIGUSR1 ? kTerminated : exit_status(ErrorKind::cancelled);
}

SignalsCancel::SignalsCancel(Progress& progress) { running_job = &progress; }
SignalsCancel::~SignalsCancel() { running_job = nullptr; }

}  // namespace pounce::cli
