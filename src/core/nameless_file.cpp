// SPDX-License-Identifier: Apache-2.0
#include "core/nameless_file.h"

#include <unistd.h>

#include <cerrno>

#include "core/posix_io.h"

namespace pounce {

NamelessFile::NamelessFile(const std::string& folder) : folder_(folder) {
  const int file = open_scratch_file(folder);
  if (file < 0) fail_to_change(folder, "create a scratch file", errno);
  stream_ = ::fdopen(file, "w+b");
  if (stream_ == nullptr) {
    const int code = errno;
    ::close(file);
    fail_to_change(folder, "create a scratch file", code);
  }
  path_ = "/proc/self/fd/" + std::to_string(file);
  if (::access(path_.c_str(), R_OK) == 0) return;
  const int code = errno;
  std::fclose(stream_);
  fail_storage(path_, "read a scratch file through it (is /proc mounted?)", code);
}

NamelessFile::~NamelessFile() { std::fclose(stream_); }

void NamelessFile::flush() {
  errno = 0;
  const bool has_failed = std::fflush(stream_) != 0 || std::ferror(stream_) != 0;
  if (has_failed) fail_to_change(folder_, "write a scratch file", errno);
}

}  // namespace pounce
