// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "pounce/error.h"

namespace pounce::io {

/// Error(storage) of a file that is not there, for callers that can do without it; one that is
/// there and cannot be read is another matter.
class MissingFile : public Error {
 public:
  explicit MissingFile(const std::string& message) : Error(ErrorKind::storage, message) {}
};

}  // namespace pounce::io
