// SPDX-License-Identifier: Apache-2.0
#include <cstring>

#include "io/foreign/module.h"
#include "io/foreign/oiio_decoder.h"
#include "pounce/version.h"

namespace pounce::io {
namespace {

class Module : public ForeignModule {
 public:
  std::unique_ptr<RowDecoder> open_image(ByteSource& bytes, ImageInfo& info) const override {
    return open_by_oiio(bytes, info);
  }
  std::unique_ptr<const ColourConfig> load_config(const std::string& path, bool allow_external,
                                                  std::uint64_t most_bytes) const override {
    return load_ocio_config(path, allow_external, most_bytes);
  }
};

}  // namespace
}  // namespace pounce::io

/// Loaded by name (ForeignEntry).
extern "C" [[gnu::visibility("default")]] const pounce::io::ForeignModule* pounce_imageio(
    const char* version) {
  static const pounce::io::Module module;
  return std::strcmp(version, POUNCE_VERSION) == 0 ? &module : nullptr;
}
