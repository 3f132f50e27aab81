// SPDX-License-Identifier: Apache-2.0
#include "core/lock_holder.h"

#include <algorithm>
#include <span>

#include "pounce/error.h"

namespace pounce {

std::string lock_holder(FileSystem& files, const std::string& lock_path) {
  try {
    const auto file = files.open(lock_path);
    std::string text(std::min<std::uint64_t>(file->size_bytes(), 20), '\0');
    file->read(0, std::as_writable_bytes(std::span(text)));
    text.resize(std::min(text.find_first_not_of("0123456789"), text.size()));
    if (!text.empty()) return "process " + text;
  } catch (const Error&) {
    // It just ended.
  }
  return "another process";
}

}  // namespace pounce
