// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

namespace pounce::io {

/// Throws Error(input) that calls the image of that label damaged: `what` is not to be had of it,
/// and `why`, if that is known.
[[noreturn]] void refuse_damaged(const std::string& label, const std::string& what,
                                 const std::string& why);

/// The same of a decoder that failed with the message `why`, which may be empty. One that got no
/// memory is Error(budget), `needed_bytes` being what it may take; of one that cannot do what is
/// asked of it the image may be whole.
[[noreturn]] void decoder_failed(const std::string& label, const std::string& what,
                                 const std::string& why, std::uint64_t needed_bytes);

}  // namespace pounce::io
