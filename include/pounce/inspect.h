// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "pounce/error.h"
#include "pounce/export.h"
#include "pounce/options.h"

namespace pounce {

/// What a mesh (.glb, .gltf, .obj, .ply, .stl), splat scene (.ply), image or tile store holds, as
/// text for people. Throws Error(input) if the file is none of these or malformed,
/// Error(damaged_store) for a store whose bytes do not match their checksums. `allow_external`,
/// `trust`: as in TransferOptions.
POUNCE_API std::string inspect_text(const std::string& path, bool allow_external = false,
                                    const ImageTrust& trust = {});
/// The same as JSON. Ends with a newline.
POUNCE_API std::string inspect_json(const std::string& path, bool allow_external = false,
                                    const ImageTrust& trust = {});

}  // namespace pounce
