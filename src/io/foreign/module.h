// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "io/codec/colour_config.h"
#include "io/codec/row_decoder.h"

namespace pounce::io {

/// What libpounce-imageio.so gives: the formats and colour configurations of OpenImageIO and
/// OpenColorIO, which bring 260 shared libraries with them. The module is opened when a job needs
/// it, and stays open then. It has copies of its own of the functions it shares with the library,
/// so nothing in these may be one per process. Thread-safe.
class ForeignModule {
 public:
  virtual ~ForeignModule() = default;
  /// See open_foreign().
  virtual std::unique_ptr<RowDecoder> open_image(ByteSource& bytes, ImageInfo& info) const = 0;
  /// See ColourConfig::load().
  virtual std::unique_ptr<const ColourConfig> load_config(const std::string& path,
                                                          bool allow_external,
                                                          std::uint64_t most_bytes) const = 0;
};

/// The module's one function. `version` is the caller's; null if the module is of another one.
using ForeignEntry = const ForeignModule*(const char* version);
inline constexpr const char* kForeignEntry = "pounce_imageio";

/// Where what belongs to the library is looked for: the folder of the file that this function is in
/// (the library, or a program that has it inside), "pounce" beside it, and where it is installed.
std::vector<std::filesystem::path> companion_folders();

/// Opens the module beside the library or the program, or where it is installed. `purpose`: what
/// cannot be done without it, as a sentence's beginning ("a.hdr: Radiance HDR images are"). Throws
/// Error(storage) if there is none, naming the places and the reason.
const ForeignModule& foreign_module(const std::string& purpose);

}  // namespace pounce::io
