// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdio>

namespace pounce::cli {

/// From here on the standard error output is the program's alone: what libraries print there
/// (libpng of a damaged image, in the middle of lines of JSON) is lost. Their reasons are in our
/// messages. Where descriptors are short all stays as it is. Once, before there are threads.
void keep_stderr() noexcept;

/// Where the program itself writes.
std::FILE* own_stderr() noexcept;
/// The same as a descriptor, for who may not use streams.
int own_stderr_descriptor() noexcept;

}  // namespace pounce::cli
