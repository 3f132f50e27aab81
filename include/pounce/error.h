// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>
#include <string>

#include "pounce/export.h"

namespace pounce {

/// What kind of thing went wrong. The numbers are the exit statuses of the `pounce` program.
enum class ErrorKind : int {
  usage = 2,    ///< options that contradict each other or make no sense
  input = 3,    ///< a mesh, texture or splat file that cannot be used
  budget = 4,   ///< the memory budget is below the least that works, or the system has no memory
  storage = 5,  ///< a file or folder that cannot be read, written or created; a full disk; no
                ///< thread to be had
  damaged_store = 6,  ///< a tile store whose bytes do not match their checksums
  internal = 70,      ///< a broken promise of ours; please report
  busy = 75,          ///< another process holds what is needed; also storage that may come back
  cancelled = 130,    ///< stopped by the caller; running again resumes or starts over
};

/// The one type that leaves the library; what a listener threw may be nested in it. what() is one
/// sentence that names the file, what was found there and what to do.
class POUNCE_API Error : public std::runtime_error {
 public:
  Error(ErrorKind kind, const std::string& message, bool is_passing = false)
      : std::runtime_error(message), kind_(kind), is_passing_(is_passing) {}
  /// What kind of failure this is; never changes after construction.
  ErrorKind kind() const noexcept { return kind_; }
  /// The same job may succeed later, elsewhere or once somebody has made room, without a change of
  /// its options: a full disk, one that does not answer, a file that another machine has replaced.
  bool is_passing() const noexcept { return is_passing_; }

 private:
  ErrorKind kind_;
  bool is_passing_;
};

/// The name of a kind, as written above: "usage", "damaged_store", ...
POUNCE_API const char* error_kind_name(ErrorKind kind) noexcept;

/// The exit status that belongs to a kind of error.
constexpr int exit_status(ErrorKind kind) noexcept { return static_cast<int>(kind); }
/// The same of an error: 75, which schedulers try again, for storage that may be there later.
inline int exit_status(const Error& error) noexcept {
  return exit_status(error.kind() == ErrorKind::storage && error.is_passing() ? ErrorKind::busy
                                                                              : error.kind());
}

}  // namespace pounce
