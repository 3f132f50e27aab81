// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

namespace pounce::fuzz {

/// Writes the images that fuzz_decode starts from.
void put_images(const std::filesystem::path& folder);

}  // namespace pounce::fuzz
