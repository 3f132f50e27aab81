// SPDX-License-Identifier: Apache-2.0
#include "own_stderr.h"

#include <fcntl.h>
#include <unistd.h>

namespace pounce::cli {
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

}  // namespace pounce::cli
