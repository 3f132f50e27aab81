// SPDX-License-Identifier: Apache-2.0
#include <OpenColorIO/OpenColorIO.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <mutex>
#include <optional>
#include <sstream>
#include <utility>
#include <vector>

#include "io/codec/colour_config.h"
#include "io/files/asset_file.h"
#include "io/foreign/ocio_tables.h"
#include "io/foreign/oiio_decoder.h"
#include "pounce/error.h"

namespace OCIO = OCIO_NAMESPACE;

namespace pounce::io {
namespace {

constexpr std::uint64_t kMostConfigBytes = 8 << 20;  // the largest published have 1 MB

/// The text of a configuration. What reads a disk that fails is no damaged configuration, so it is
/// read here.
std::string read_config(const std::string& path) {
  mesh::ImageRef file;
  file.path = file.label = path;
  ByteSource bytes(file);  // or says why not
  if (bytes.size_bytes() > kMostConfigBytes) {
    throw Error(
        ErrorKind::input,
        fmt::format(
            "{}: not a usable OpenColorIO configuration: it has {} bytes, but at most {} MiB "
            "are supported",
            path, bytes.size_bytes(), kMostConfigBytes >> 20));
  }
  std::string text(static_cast<std::size_t>(bytes.size_bytes()), '\0');
  const std::size_t got = bytes.read_at(0, text.data(), text.size());
  bytes.check();
  text.resize(got);
  return text;
}

/// As OCIO::Config::CreateFromFile(), which opens the file itself.
OCIO::ConstConfigRcPtr parse_config(const std::string& path) {
  std::istringstream text(read_config(path));
  const auto config = OCIO::Config::CreateFromStream(text)->createEditableCopy();
  config->setWorkingDir(std::filesystem::absolute(path).parent_path().c_str());
  return config;
}

/// A space of the configuration that is one of ours.
struct Common {
  std::string name;
  Chromaticities primaries;
};

std::optional<Common> common_space(const OCIO::Config& config) {
  const Chromaticities ap0 = colour_space_from_name("aces2065-1")->primaries;
  for (const char* name : {"aces_interchange", "ACES2065-1", "ACES - ACES2065-1", "lin_ap0"}) {
    if (config.getColorSpace(name)) return Common{name, ap0};
  }
  for (const char* name : {"lin_rec709", "Linear Rec.709 (sRGB)", "lin_srgb",
                           "Utility - Linear - Rec.709", "Utility - Linear - sRGB"}) {
    if (config.getColorSpace(name)) return Common{name, kRec709};
  }
  return std::nullopt;
}

void multiply(const Matrix3& m, std::array<double, 3>& c) noexcept {
  c = {m[0] * c[0] + m[1] * c[1] + m[2] * c[2], m[3] * c[0] + m[4] * c[1] + m[5] * c[2],
       m[6] * c[0] + m[7] * c[1] + m[8] * c[2]};
}

/// The configuration's part, with a matrix before or behind it.
class ConfigTransform : public ColourTransform {
 public:
  ConfigTransform(OCIO::ConstCPUProcessorRcPtr processor, const Matrix3& matrix, bool matrix_first)
      : processor_(std::move(processor)), matrix_(matrix), matrix_first_(matrix_first) {}

  void apply(std::array<double, 3>& rgb) const noexcept override {
    if (matrix_first_) multiply(matrix_, rgb);
    std::array<float, 3> single;
    std::copy(rgb.begin(), rgb.end(), single.begin());
    processor_->applyRGB(single.data());
    std::copy(single.begin(), single.end(), rgb.begin());
    if (!matrix_first_) multiply(matrix_, rgb);
  }

  Hash128 identity() const override {
    Hasher hash;
    hash.add(std::string_view(processor_->getCacheID()));
    hash.add(matrix_first_);
    for (const double v : matrix_) hash.add(v);
    return hash.digest();
  }

 private:
  OCIO::ConstCPUProcessorRcPtr processor_;
  Matrix3 matrix_;
  bool matrix_first_;
};

class OcioConfig : public ColourConfig {
 public:
  OcioConfig(const std::string& path, bool allow_external, std::uint64_t most_bytes)
      : path_(path), config_(parse_config(path)), tables_(path, allow_external, most_bytes) {
    config_->validate();
  }

  const std::string& path() const override { return path_; }
  bool has(const std::string& name) const override {
    return config_->getColorSpace(name.c_str()) != nullptr;
  }
  std::string full_name(const std::string& name) const override {
    return config_->getColorSpace(name.c_str())->getName();
  }
  bool is_data(const std::string& name) const override {
    return config_->getColorSpace(name.c_str())->isData();
  }
  std::vector<std::string> names() const override {
    std::vector<std::string> names;
    for (int i = 0; i < config_->getNumColorSpaces(); ++i)
      names.emplace_back(config_->getColorSpaceNameByIndex(i));
    return names;
  }
  std::shared_ptr<const ColourTransform> to_linear(const std::string& name) const override {
    return transform(name, true);
  }
  std::shared_ptr<const ColourTransform> from_linear(const std::string& name) const override {
    return transform(name, false);
  }
  std::uint64_t table_loading_bytes() const override {
    const std::lock_guard lock(mutex_);
    return tables_.loading_bytes();
  }
  std::uint64_t table_bytes() const override {
    const std::lock_guard lock(mutex_);
    return tables_.kept_bytes();
  }

 private:
  std::shared_ptr<const ColourTransform> transform(const std::string& name, bool to_linear) const;

  std::string path_;
  OCIO::ConstConfigRcPtr config_;
  mutable ColourTables tables_;
  mutable std::mutex mutex_;  ///< guards it
};

std::shared_ptr<const ColourTransform> OcioConfig::transform(const std::string& name,
                                                             bool to_linear) const {
  const auto common = common_space(*config_);
  if (!common) {
    throw Error(ErrorKind::input,
                fmt::format("{}: cannot be converted to other colour spaces: it has no role "
                            "aces_interchange and no colour space named ACES2065-1 or "
                            "lin_rec709; add the role aces_interchange",
                            path_));
  }
  const std::lock_guard lock(mutex_);
  tables_.check(config_, {name.c_str(), common->name.c_str()});
  const auto no_way = [&](const OCIO::Exception& e) {
    return fmt::format("{}: cannot convert {} \"{}\": {}", path_, to_linear ? "from" : "to", name,
                       e.what());
  };
  try {
    const char *from = name.c_str(), *to = common->name.c_str();
    if (!to_linear) std::swap(from, to);
    const auto processor = config_->getProcessor(from, to);
    return std::make_shared<ConfigTransform>(
        processor->getOptimizedCPUProcessor(OCIO::OPTIMIZATION_LOSSLESS),
        to_linear ? primaries_matrix(common->primaries, kRec709)
                  : primaries_matrix(kRec709, common->primaries),
        !to_linear);
  } catch (const OCIO::ExceptionMissingFile& e) {
    throw MissingFile(no_way(e));
  } catch (const OCIO::Exception& e) {
    tables_.check_reading();  // a disk that fails is no damaged table
    throw Error(ErrorKind::input, no_way(e));
  }
}

}  // namespace

std::unique_ptr<const ColourConfig> load_ocio_config(const std::string& path, bool allow_external,
                                                     std::uint64_t most_bytes) {
  try {
    return std::make_unique<OcioConfig>(path, allow_external, most_bytes);
  } catch (const OCIO::Exception& e) {
    throw Error(ErrorKind::input,
                fmt::format("{}: not a usable OpenColorIO configuration: {}", path, e.what()));
  }
}

}  // namespace pounce::io
