// SPDX-License-Identifier: Apache-2.0
#include "io/splats/format.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string_view>

#include "core/file.h"
#include "core/input_file.h"
#include "io/files/file_ending.h"
#include "io/json/size.h"
#include "io/splats/gltf_scene.h"
#include "io/splats/ply_header.h"
#include "io/splats/spz.h"
#include "io/splats/stored_zip.h"

namespace pounce::io {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMostMetaBytes = 1 << 20;       // real ones have 20 kB
constexpr std::uint64_t kZipDirectoryBytes = 64 << 10;  // of a dozen entries, at the end
constexpr int kMostMetaDepth = 16;

std::string text_at(const ReadFile& file, std::uint64_t offset, std::uint64_t most) {
  const std::uint64_t size = file.size_bytes();
  std::string text(std::min(most, size - std::min(offset, size)), '\0');
  file.read(std::min(offset, size), std::as_writable_bytes(std::span(text)));
  return text;
}

/// What a meta.json of a SOG, or of one with levels of detail, says of itself.
std::optional<SplatFormat> sog_format(const std::string& meta, const char* what) {
  std::error_code ignored;
  if (!fs::is_regular_file(meta, ignored)) return std::nullopt;
  const auto file = open_input(meta);
  const std::uint64_t size = file->size_bytes();
  if (size > kMostMetaBytes || json_size(*file, 0, size).depth > kMostMetaDepth)
    return std::nullopt;
  const auto json = nlohmann::json::parse(text_at(*file, 0, kMostMetaBytes), nullptr, false);
  if (!json.is_object()) return std::nullopt;
  if (json.contains("lodLevels") && json.contains("tree")) {
    return SplatFormat{"streamed SOG (levels of detail)"};
  }
  for (const char* key : {"means", "scales", "quats", "sh0"}) {
    if (!json.contains(key)) return std::nullopt;
  }
  const auto version = json.find("version");
  const bool is_numbered = version != json.end() && version->is_number_unsigned();
  return SplatFormat{fmt::format("SOG v{} ({})", is_numbered ? version->get<unsigned>() : 1, what),
                     SplatKind::sog};
}

std::optional<SplatFormat> folder_format(const std::string& path) {
  for (const char* name : {"meta.json", "lod-meta.json"}) {
    if (auto found = sog_format((fs::path(path) / name).string(), "a folder")) return found;
  }
  return std::nullopt;
}

/// By the first bytes.
std::optional<SplatFormat> marked_format(const ReadFile& file, const std::string& path) {
  const std::string head = text_at(file, 0, 64);
  const std::string ending = lower_ending(path);
  if (is_ply(file)) {
    if (is_compressed_ply(file, path))
      return SplatFormat{"SuperSplat compressed PLY", SplatKind::compressed_ply};
    return SplatFormat{"3DGS PLY", SplatKind::ply};
  }
  if (head.starts_with("NGSP") && head.size() >= 8) {
    std::uint32_t version = 0;
    std::memcpy(&version, head.data() + 4, sizeof version);
    return SplatFormat{fmt::format("SPZ v{}", version), SplatKind::spz};
  }
  if (is_spz(file) || (head.starts_with("\x1F\x8B") && ending == ".spz"))
    return SplatFormat{"SPZ v1 to v3", SplatKind::spz};
  if (is_zip(file)) {
    const std::uint64_t size = file.size_bytes();
    const std::string directory =
        text_at(file, size - std::min(size, kZipDirectoryBytes), kZipDirectoryBytes);
    if (directory.find("meta.json") != std::string::npos) {
      const bool is_streamed = directory.find("lod-meta.json") != std::string::npos;
      if (is_streamed) return SplatFormat{"streamed SOG (levels of detail)"};
      return SplatFormat{"SOG (bundled)", SplatKind::sog};
    }
  }
  return ending == ".json" ? sog_format(path, "its meta.json") : std::nullopt;
}

}  // namespace

std::optional<SplatFormat> splat_format(const std::string& path) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) return folder_format(path);
  const auto file = open_input(path);
  if (auto marked = marked_format(*file, path)) return marked;
  if (text_at(*file, 0, 4) == "glTF") return std::nullopt;  // whatever its name
  // .splat and .ksplat begin with data; of the others what is left is damaged.
  struct Ending {
    std::string_view ending;
    const char* name;
    SplatKind kind;
  };
  constexpr std::array<Ending, 6> kEndings{{{".ply", "3DGS PLY", SplatKind::ply},
                                            {".splat", ".splat", SplatKind::dot_splat},
                                            {".ksplat", ".ksplat", SplatKind::ksplat},
                                            {".spz", "SPZ", SplatKind::spz},
                                            {".sog", "SOG", SplatKind::sog},
                                            {".lcc", "LCC", SplatKind::unread}}};
  const std::string ending = lower_ending(path);
  for (const Ending& known : kEndings) {
    if (ending == known.ending) return SplatFormat{known.name, known.kind};
  }
  return std::nullopt;
}

std::optional<SplatFormat> source_splat_format(const std::string& path) {
  if (auto format = splat_format(path)) return format;
  std::error_code ignored;
  if (fs::is_directory(path, ignored) || !is_splat_gltf(path)) return std::nullopt;
  return SplatFormat{"glTF (KHR_gaussian_splatting)", SplatKind::gltf};
}

std::string why_not_read(const std::string& path, const SplatFormat& format) {
  const fs::path file(path);
  const fs::path named = file.filename().empty() ? file.parent_path() : file;  // "scene/"
  return fmt::format(
      "{}: a Gaussian splat scene in {}; pounce reads scenes as PLY, SPZ, SOG, glTF, .splat and "
      ".ksplat: convert it, for example with splat-transform {} {}.ply",
      path, format.name, path, named.stem().string());
}

}  // namespace pounce::io
