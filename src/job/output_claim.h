// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace pounce::job {

/// While it or a copy of it lives, no other job with --skip-existing makes these outputs: locks on
/// hidden files beside them, in missing folders too. They end with their process, however it ends.
class OutputClaim {
 public:
  /// Nothing if another job, here or in another process, is making one of them: `holder` says who.
  /// Where a folder cannot have locks its outputs are free for all.
  static std::optional<OutputClaim> take(std::vector<std::string> outputs,
                                         std::string* holder = nullptr);

 private:
  OutputClaim() = default;
  std::vector<std::shared_ptr<const void>> locks_;
};

}  // namespace pounce::job
