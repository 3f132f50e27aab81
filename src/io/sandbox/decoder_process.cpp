// SPDX-License-Identifier: Apache-2.0
#include "io/sandbox/decoder_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <mutex>

#include "io/foreign/module.h"
#include "pounce/error.h"

extern char** environ;

namespace pounce::io {
namespace {

constexpr const char* kProgram = "pounce-decoder";

std::string program_path() {
  for (const std::filesystem::path& folder : companion_folders()) {
    const std::filesystem::path path = folder / kProgram;
    if (access(path.c_str(), X_OK) == 0) return path.string();
  }
  return "";
}

/// Those that wait for an image, without and with the module. They end when this process does: each
/// finds its socket closed.
struct Idle {
  const pid_t owner = getpid();
  std::mutex mutex;
  std::string program = program_path();
  std::array<std::vector<std::unique_ptr<DecoderProcess>>, 2> processes;
};
Idle& idle() {
  static Idle all;
  if (all.owner == getpid()) return all;
  // After a fork these are the other process's, to use and to end.
  static Idle* const own = new Idle;
  return *own;
}

/// Much more than any decoder needs.
double most_cpu_seconds(std::uint64_t work_bytes) {
  return 20 + static_cast<double>(work_bytes) / (1 << 20);
}

/// The program with `socket` as its standard input and nothing else of ours.
pid_t spawn(const std::string& path, int socket, bool with_module) {
  posix_spawn_file_actions_t actions;
  posix_spawnattr_t attributes;
  posix_spawn_file_actions_init(&actions);
  posix_spawnattr_init(&attributes);
  posix_spawn_file_actions_adddup2(&actions, socket, 0);
  posix_spawn_file_actions_addopen(&actions, 1, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 2, "/dev/null", O_WRONLY, 0);
  // Interrupting a job is the job's matter.
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  std::string name = path, option = with_module ? "--serve-module" : "--serve";
  std::array<char*, 3> arguments{name.data(), option.data(), nullptr};
  pid_t pid = -1;
  if (posix_spawn(&pid, path.c_str(), &actions, &attributes, arguments.data(), environ) != 0)
    pid = -1;
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  return pid;
}

}  // namespace

std::unique_ptr<DecoderProcess> DecoderProcess::take(bool with_module) {
  {
    const std::lock_guard lock(idle().mutex);
    auto& waiting = idle().processes[with_module ? 1 : 0];
    if (!waiting.empty()) {
      std::unique_ptr<DecoderProcess> process = std::move(waiting.back());
      waiting.pop_back();
      return process;
    }
  }
  return start(with_module);
}

void DecoderProcess::use_program(const std::string& path) {
  const std::lock_guard lock(idle().mutex);
  idle().program = path;
  for (auto& processes : idle().processes) processes.clear();
}

void DecoderProcess::give_back(std::unique_ptr<DecoderProcess> process) {
  if (!process || !process->is_alive()) return;
  const std::lock_guard lock(idle().mutex);
  idle().processes[process->with_module_ ? 1 : 0].push_back(std::move(process));
}

std::unique_ptr<DecoderProcess> DecoderProcess::start(bool with_module) {
  std::string path;
  {
    const std::lock_guard lock(idle().mutex);
    path = idle().program;
  }
  std::array<int, 2> sockets{};
  if (path.empty() || socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, sockets.data()) != 0)
    return nullptr;
  const pid_t pid = spawn(path, sockets[1], with_module);
  close(sockets[1]);
  if (pid < 0) {
    close(sockets[0]);
    return nullptr;
  }
  std::unique_ptr<DecoderProcess> process(new DecoderProcess(pid, sockets[0], with_module));
  return process->begin() ? std::move(process) : nullptr;
}

/// It says that it is there, and confined.
bool DecoderProcess::begin() {
  try {
    std::vector<int> none;
    const auto hello = receive_message(socket_, none);
    for (const int descriptor : none) close(descriptor);
    if (!hello || !hello->at("confined").get<bool>()) return false;
    address_space_ = hello->at("address_space").get<std::uint64_t>();
    return true;
  } catch (const std::exception&) {
    return false;
  }
}

DecoderProcess::~DecoderProcess() { end(); }

/// Ends it, whatever it does. Returns how it ended, if that was before.
std::string DecoderProcess::end() {
  if (pid_ < 0) return "";
  close(socket_);
  int status = 0;
  // Closed sockets end a process that waits; one that works is ended. What ended by itself is told.
  const bool ended = waitpid(pid_, &status, WNOHANG) == pid_;
  if (!ended) {
    kill(pid_, SIGKILL);
    while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
  }
  pid_ = -1;
  if (!ended) return "";
  if (WIFSIGNALED(status)) {
    return WTERMSIG(status) == SIGSYS
               ? std::string("asked the system for what a decoder does not need")
               : fmt::format("was ended by signal {} ({})", WTERMSIG(status),
                             strsignal(WTERMSIG(status)));
  }
  return fmt::format("ended with status {}", WEXITSTATUS(status));
}

void DecoderProcess::fail(const std::string& label, const std::string& why) {
  throw Error(ErrorKind::input,
              fmt::format("{}: {}; the file is damaged or made to do harm", label, why));
}

double DecoderProcess::cpu_seconds() const {
  clockid_t clock{};
  timespec now{};
  if (clock_getcpuclockid(pid_, &clock) != 0 || clock_gettime(clock, &now) != 0) return 0;
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

void DecoderProcess::wait_for_answer(const std::string& label, std::uint64_t work_bytes) {
  // Without CPU it waits for a disk, or for ever.
  const double most_cpu = most_cpu_seconds(work_bytes);
  const double begun = cpu_seconds();
  const auto start = std::chrono::steady_clock::now();
  for (;;) {
    pollfd wanted{socket_, POLLIN, 0};
    if (poll(&wanted, 1, 100) > 0) return;
    const std::chrono::duration<double> waited = std::chrono::steady_clock::now() - start;
    if (cpu_seconds() - begun < most_cpu && waited.count() < 30 * most_cpu) continue;
    end();
    fail(label, "its decoder does not come to an end");
  }
}

Message DecoderProcess::ask(const std::string& label, const Message& request,
                            const std::vector<int>& descriptors, std::uint64_t memory_bytes,
                            std::uint64_t work_bytes) {
  const rlimit space{address_space_ + memory_bytes, RLIM_INFINITY};
  prlimit(pid_, RLIMIT_AS, &space, nullptr);
  // Where nobody is left to end it.
  const rlimit cpu{static_cast<rlim_t>(cpu_seconds() + 2 * most_cpu_seconds(work_bytes)),
                   RLIM_INFINITY};
  prlimit(pid_, RLIMIT_CPU, &cpu, nullptr);
  Message answer;
  try {
    send_message(socket_, request, descriptors);
    wait_for_answer(label, work_bytes);
    std::vector<int> none;
    auto received = receive_message(socket_, none);
    for (const int descriptor : none) close(descriptor);
    if (!received) throw std::runtime_error("the socket is closed");
    answer = std::move(*received);
    if (answer.contains("error")) {
      const int kind = answer.at("error").get<int>();
      const std::string text = answer.at("text").get<std::string>();
      if (kind < 0 || kind > static_cast<int>(ErrorKind::internal))
        fail(label, "its decoder fails");
      throw Error(static_cast<ErrorKind>(kind), text);
    }
  } catch (const Error&) {
    throw;
  } catch (const std::exception&) {
    // What is closed from the other side ends within a moment.
    if (pid_ > 0) usleep(20000);
    const std::string how = end();
    fail(label, how.empty() ? "its decoder gives no answer" : "its decoder " + how);
  }
  if (answer.contains("no_memory"))
    fail(label, "decoding it takes more memory than an image of its size needs");
  return answer;
}

}  // namespace pounce::io
