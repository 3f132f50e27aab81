// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace pounce {

/// What to do about an errno of a file or folder, as the end of a sentence: "; free some space or
/// choose another folder". "" where its message says it all.
const char* storage_advice(int code);

}  // namespace pounce
