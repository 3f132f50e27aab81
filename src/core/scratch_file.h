// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace pounce {

/// Opens a nameless file in `folder` for reading and writing; -1 and errno if that cannot be. Where
/// a file system has no nameless files it has a name for a moment; what a process left that died at
/// that moment is removed. Thread-safe.
int open_scratch_file(const std::string& folder);

}  // namespace pounce
