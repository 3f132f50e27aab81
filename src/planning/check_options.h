// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pounce/options.h"

namespace pounce::planning {

/// Throws Error(usage) for what no transfer can do, whatever its files hold.
void check_options(const TransferOptions& options);

}  // namespace pounce::planning
