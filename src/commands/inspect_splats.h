// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace pounce::commands {

/// What a splat scene holds: format, counts, columns of a PLY, how it was trained, boxes, what a
/// transfer would leave out and why, quantiles of opacity and size. Reads the whole scene, in
/// constant memory; formats that must be unpacked first are, into a nameless file of the system's
/// temporary folder.
nlohmann::ordered_json describe_splats(const std::string& path);
/// That description for people.
std::string splats_text(const nlohmann::ordered_json& description);

}  // namespace pounce::commands
