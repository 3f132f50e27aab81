// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>

#include "core/begun_work.h"

namespace pounce::runtime {

/// Work that any thread of the job may take; with one thread it is done here. Who waits for it
/// works meanwhile.
std::unique_ptr<BegunWork> begin_work(std::function<void()> work);

}  // namespace pounce::runtime
