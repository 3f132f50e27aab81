// SPDX-License-Identifier: Apache-2.0
#include "core/open_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

namespace pounce {

int open_for_reading(const std::string& path) {
  int flags = O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY;
  for (;;) {
    const int descriptor = ::open(path.c_str(), flags);
    if (descriptor >= 0) return descriptor;
    if (errno == EINTR) continue;
    // A file server has a lease on it, which it gives back within seconds to whoever waits.
    struct stat status {};
    if (errno != EWOULDBLOCK || (flags & O_NONBLOCK) == 0) return -1;
    if (::stat(path.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) return -1;
    flags &= ~O_NONBLOCK;
  }
}

const char* kind_of_file(mode_t mode) {
  if (S_ISDIR(mode)) return "a folder";
  if (S_ISFIFO(mode)) return "a pipe";
  return S_ISSOCK(mode) ? "a socket" : "a device";
}

}  // namespace pounce
