// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "support/random.h"

namespace pounce::test {

/// Changes the bytes of an image as damage or malice would: flips bits, cuts off the end, inserts
/// and swaps blocks, writes numbers where its headers have theirs. Most PNGs get the checksums that
/// they then need.
void mutate(std::string& bytes, Random& random);

}  // namespace pounce::test
