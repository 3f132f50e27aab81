// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "pounce/transfer.h"

namespace pounce::test {

/// A transfer that neither reads nor leaves a cache.
inline TransferOptions transfer_job(const std::string& source, const std::string& target,
                                    const std::string& output, std::uint64_t mebibytes) {
  TransferOptions options;
  options.source = source;
  options.targets = {target};
  options.output = output;
  options.resources.use_cache = false;
  options.resources.memory_bytes = mebibytes << 20;
  return options;
}

}  // namespace pounce::test
