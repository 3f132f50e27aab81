// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "pounce/report.h"

namespace pounce::outcome {

/// An image that the report tells of as written could not get its name. Nothing where it tells of
/// no such image.
void not_written(const std::string& path, Report& report);

}  // namespace pounce::outcome
