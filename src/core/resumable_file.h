// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "core/file.h"

namespace pounce {

/// See FileSystem; counted in `account`, which may be null.
std::unique_ptr<ResumableFile> create_resumable(const std::string& path,
                                                std::shared_ptr<ScratchAccount> account);
std::unique_ptr<ResumableFile> reopen_resumable(const std::string& path,
                                                std::shared_ptr<ScratchAccount> account);

}  // namespace pounce
