// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <string>

namespace pounce::io {

/// Removes the hidden files ".NAME.<digits>-<digits>.tmp" that processes which died left beside the
/// output `name` in `folder`: those that nobody has locked and that belong to this user or to
/// `owner`. Failures do not matter. A folder is listed anew only once its last listing was a
/// fiftieth of the time since: a job may have thousands of outputs in a folder of a million files.
/// Thread-safe.
void remove_leftovers(const std::string& folder, const std::string& name, uid_t owner);

/// The hidden file beside an output `name` whose lock says that a job is making it: one of those
/// above, so that it goes where its process could not remove it.
std::string claim_name(const std::string& name);

}  // namespace pounce::io
