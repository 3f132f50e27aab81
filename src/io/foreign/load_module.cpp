// SPDX-License-Identifier: Apache-2.0
#include <dlfcn.h>
#include <fmt/format.h>

#include <filesystem>
#include <mutex>

#include "io/foreign/module.h"
#include "pounce/error.h"
#include "pounce/version.h"

namespace pounce::io {
namespace {

constexpr const char* kFileName = "libpounce-imageio.so";

struct Loaded {
  const ForeignModule* module = nullptr;
  std::string problem;
};

Loaded load() {
  Loaded loaded;
  for (const std::filesystem::path& folder : companion_folders()) {
    const std::filesystem::path path = folder / kFileName;
    std::error_code unknown;
    if (!std::filesystem::exists(path, unknown)) continue;
    void* const handle = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
    const char* const why = handle == nullptr ? dlerror() : nullptr;
    if (handle == nullptr) {
      loaded.problem = fmt::format("{} cannot be opened: {}", path.string(),
                                   why == nullptr ? "the reason is not known" : why);
      continue;
    }
    const auto entry = reinterpret_cast<ForeignEntry*>(dlsym(handle, kForeignEntry));
    loaded.module = entry == nullptr ? nullptr : entry(POUNCE_VERSION);
    if (loaded.module != nullptr) return loaded;
    loaded.problem = fmt::format("{} belongs to another version of pounce", path.string());
  }
  if (loaded.problem.empty()) {
    for (const std::filesystem::path& folder : companion_folders())
      loaded.problem += fmt::format(
          "{}{}", loaded.problem.empty() ? "it is neither in " : " nor in ", folder.string());
  }
  return loaded;
}

}  // namespace

std::vector<std::filesystem::path> companion_folders() {
  Dl_info self{};
  std::filesystem::path folder;
  if (dladdr(reinterpret_cast<const void*>(&companion_folders), &self) != 0 &&
      self.dli_fname != nullptr) {
    std::error_code unknown;
    folder = std::filesystem::weakly_canonical(self.dli_fname, unknown).parent_path();
  }
  return {folder, folder / "pounce", POUNCE_COMPANION_FOLDER};
}

const ForeignModule& foreign_module(const std::string& purpose) {
  static const Loaded loaded = load();
  if (loaded.module != nullptr) return *loaded.module;
  throw Error(ErrorKind::storage, fmt::format("{} read by {}, which is not installed: {}", purpose,
                                              kFileName, loaded.problem));
}

std::unique_ptr<RowDecoder> open_foreign(ByteSource& bytes, ImageInfo& info) {
  const std::string purpose = fmt::format("{}: {} images are", bytes.label(),
                                          info.format == "hdr"   ? "Radiance HDR"
                                          : info.format == "bmp" ? "BMP"
                                                                 : "Targa");
  return foreign_module(purpose).open_image(bytes, info);
}

std::unique_ptr<const ColourConfig> ColourConfig::load(const std::string& path, bool allow_external,
                                                       std::uint64_t most_bytes) {
  return foreign_module(path + ": OpenColorIO configurations are")
      .load_config(path, allow_external, most_bytes);
}

}  // namespace pounce::io
