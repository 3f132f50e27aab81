// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace pounce::io {

/// Is this a file of the format that its ending names (images and models that pounce writes), with
/// its end where its own structure says? Nothing is decoded: what is found is another format, an
/// empty or cut off file, or one that was never finished; damage in the middle is not. False for
/// other endings, for what is no file, and for what cannot be read.
bool is_whole_file(const std::string& path) noexcept;

}  // namespace pounce::io
