// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

namespace pounce::io {

/// "pounce 0.2.0": what says Software in every image.
std::string software_name();

/// What an image's description says of the job that made it: "pounce:job=" and 32 digits. PNG holds
/// it as the text Description, TIFF and EXIF (JPEG) as ImageDescription, EXR as comments.
std::string job_description(const std::string& job);
/// The member "pounce" of a model's asset.extras.
std::string job_extras(const std::string& job);

/// The job that a PNG, JPEG, TIFF, EXR, .glb or .gltf says it was made by: 32 digits, or nothing:
/// it is not there, has no such text, or cannot be read. Looks where pounce writes it and no
/// further.
std::optional<std::string> read_job(const std::string& path) noexcept;

}  // namespace pounce::io
