// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "pounce/report.h"

namespace pounce::cli {

/// What is said of a finished job, as text with line ends.
std::string summary_text(const Report& report, double wall_s);  ///< outputs, texels, time
std::string details_text(const Report& report);                 ///< -v: stages, memory, tiles
std::string plan_text(const Report& report);                    ///< --plan
std::string warnings_text(const Report& report);
/// One {"warning": text} or {"note": text} per line.
std::string warnings_json(const Report& report);
/// The last line of --progress json: how the job ended.
std::string end_line(const Report& report, int status);
/// A line for each target that found less than --min-coverage.
std::string too_little_text(const Report& report);

/// 12345678 -> "12,345,678".
std::string with_commas(std::uint64_t count);
/// 1536 -> "1.5 KiB"; exact below 1024 bytes.
std::string bytes_text(std::uint64_t bytes);

}  // namespace pounce::cli
