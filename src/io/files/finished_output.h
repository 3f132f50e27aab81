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

/// Is this a file of the format that its ending names (images and models that pounce writes), with
/// its end where its own structure says? Nothing is decoded: what is found is another format, an
/// empty or cut off file, or one that was never finished; damage in the middle is not. False for
/// other endings, for what is no file, and for what cannot be read.
bool is_whole_file(const std::string& path) noexcept;

}  // namespace pounce::io
