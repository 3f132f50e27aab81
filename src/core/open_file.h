// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <string>

namespace pounce {

/// Opens `path` for reading and never waits: not for somebody who writes into a pipe, not for a
/// device. -1, and errno, if that fails. What was opened may be anything: ask fstat() before
/// reading.
int open_for_reading(const std::string& path);

/// "a folder", "a pipe", "a device", "a socket": what a file that is no regular one is, for
/// messages.
const char* kind_of_file(mode_t mode);

}  // namespace pounce
