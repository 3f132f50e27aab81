// SPDX-License-Identifier: Apache-2.0
//
// What must be sure before the libraries that pounce is linked with begin.
//
// Reading images pulls in some two hundred shared libraries. Several start threads or take memory
// in their initialisers, and end the process (abort, segmentation fault) where they get none; no
// line of main() has run by then. Functions of .preinit_array run before all of them.
#include <fcntl.h>
#include <pthread.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <exception>
#include <new>
#include <system_error>

#include "pounce/error.h"
#include "terminal.h"

// The sanitizers' own initialisers run later than this file.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)

namespace {

using pounce::ErrorKind;

/// What the libraries' initialisers and the smallest job take, and room to spare.
constexpr std::size_t kLeastBytes = 32u << 20;
constexpr std::size_t kLeastStackBytes = 1u << 20;
constexpr std::size_t kUsualStackBytes = 8u << 20;

/// Nothing here may need memory.
[[noreturn]] void end(ErrorKind kind, const char* what) {
  char line[512];
  const int length = std::snprintf(line, sizeof line, "pounce: error: %s\n", what);
  (void)!write(pounce::cli::own_stderr_descriptor(), line,
               std::min<std::size_t>(static_cast<std::size_t>(length), 511));
  _exit(pounce::exit_status(kind));
}

/// For what is thrown where nobody can catch it: in initialisers and threads of libraries.
[[noreturn]] void end_by_exception() {
  try {
    if (const auto thrown = std::current_exception()) std::rethrow_exception(thrown);
  } catch (const std::bad_alloc&) {
    end(ErrorKind::budget,
        "out of memory; raise the limit (ulimit -v, ulimit -d), or use a smaller --memory or "
        "--threads");
  } catch (const std::system_error& error) {
    char text[256];
    std::snprintf(text, sizeof text,
                  "the system refuses a resource that a library needs: %s; raise the limit of "
                  "threads or memory (ulimit -u, -v, -d), or lower --threads",
                  error.what());
    end(ErrorKind::storage, text);
  } catch (const std::exception& error) {
    char text[256];
    std::snprintf(text, sizeof text, "internal error: %s (please report)", error.what());
    end(ErrorKind::internal, text);
  } catch (...) {
  }
  end(ErrorKind::internal, "internal error: uncaught exception (please report)");
}

/// Threads' stacks are as large as the limit says when the process begins, and the main one may
/// grow to what it says at that time.
void check_stack() {
  rlimit limit{};
  if (getrlimit(RLIMIT_STACK, &limit) != 0 || limit.rlim_cur >= kUsualStackBytes) return;
  limit.rlim_cur = std::min<rlim_t>(kUsualStackBytes, limit.rlim_max);
  if (limit.rlim_cur < kLeastStackBytes || setrlimit(RLIMIT_STACK, &limit) != 0)
    end(ErrorKind::budget, "stacks need at least 1 MiB; raise the limit (ulimit -s)");
  pthread_attr_t usual;
  if (pthread_attr_init(&usual) != 0) return;
  if (pthread_attr_setstacksize(&usual, limit.rlim_cur) == 0) pthread_setattr_default_np(&usual);
  pthread_attr_destroy(&usual);
}

void check_memory() {
  void* const some =
      mmap(nullptr, kLeastBytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (some == MAP_FAILED) {
    end(ErrorKind::budget,
        "out of memory: in addition to its libraries pounce needs at least 32 MiB; raise the "
        "limit (ulimit -v, ulimit -d)");
  }
  munmap(some, kLeastBytes);
}

void check_early(int, char**, char**) {
  pounce::cli::handle_signals();  // initialisers take a tenth of a second
  std::set_terminate(end_by_exception);
  check_stack();
  check_memory();
}

using EarlyFunction = void (*)(int, char**, char**);
[[gnu::section(".preinit_array"), gnu::used]] const EarlyFunction kBeforeLibraries = check_early;

}  // namespace

#endif
