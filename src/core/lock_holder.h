// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "core/file.h"

namespace pounce {

/// Who has FileSystem::try_lock()'s lock on this file, for messages: "process 123", or "another
/// process" where the file does not say.
std::string lock_holder(FileSystem& files, const std::string& lock_path);

}  // namespace pounce
