// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "io/read_mesh.h"
#include "pounce/error.h"

namespace pounce::test {

/// The message with which read_mesh() refuses a file as bad input, "" if it does not. Other errors
/// pass.
inline std::string refusal(const std::string& path) {
  try {
    io::read_mesh(path);
  } catch (const Error& e) {
    if (e.kind() != ErrorKind::input) throw;
    return e.what();
  }
  return "";
}

}  // namespace pounce::test
