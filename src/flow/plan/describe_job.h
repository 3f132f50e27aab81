// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "pounce/options.h"
#include "pounce/report.h"

namespace pounce::flow {

/// Says in the report which command runs, on what, and with which options (those that differ from
/// their defaults). First of all, so that the report of any failure says it.
void describe(const TransferOptions& options, bool plan_only, Report& report);
void describe(const MapsOptions& options, Report& report);
void describe(const GaussiansOptions& options, Report& report);

/// Adds a file that the job reads, once.
void add_input(const std::string& path, Report& report);

}  // namespace pounce::flow
