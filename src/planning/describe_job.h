// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "pounce/options.h"
#include "pounce/report.h"

namespace pounce::planning {

/// Records in the report which command runs, on what, and with which options. Called first of all,
/// so that the report of any failure has it.
void describe(const TransferOptions& options, bool plan_only, Report& report);
void describe(const MapsOptions& options, Report& report);
void describe(const GaussiansOptions& options, Report& report);

/// Adds a file that the job reads, once.
void add_input(const std::string& path, Report& report);

}  // namespace pounce::planning
