// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace pounce::commands {

/// What a splat PLY holds: counts, columns, how it was trained, boxes, what a transfer would leave
/// out and why, quantiles of opacity and size. Reads the whole file, in constant memory.
nlohmann::ordered_json describe_splats(const std::string& path);
/// That description for people.
std::string splats_text(const nlohmann::ordered_json& description);

}  // namespace pounce::commands
