// SPDX-License-Identifier: Apache-2.0
#include "core/nameless_file.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <vector>

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
  const bool failed_before = std::ferror(stream_) != 0;
  errno = 0;
  if (std::fflush(stream_) == 0 && !failed_before) return;
  if (errno != 0) fail_to_change(folder_, "write a scratch file", errno);
  // What failed is long ago, and nobody has kept the reason: whoever writes a page now is told it
  // again.
  const std::vector<char> page(4096);
  const int file = ::fileno(stream_);
  const off_t end = ::lseek(file, 0, SEEK_END);
  const ssize_t put = ::pwrite(file, page.data(), page.size(), std::max<off_t>(end, 0));
  const bool is_full = put >= 0 && put < static_cast<ssize_t>(page.size());
  fail_to_change(folder_, "write a scratch file", is_full ? ENOSPC : put < 0 ? errno : EIO);
}

}  // namespace pounce
