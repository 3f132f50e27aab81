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
#include "io/files/file_ending.h"
#include "io/splats/ply_header.h"

namespace pounce::io {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMostMetaBytes = 1 << 20;       // real ones have 20 kB
constexpr std::uint64_t kZipDirectoryBytes = 64 << 10;  // of a dozen entries, at the end

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
  const auto file = posix_file_system().open(meta);
  if (file->size_bytes() > kMostMetaBytes) return std::nullopt;
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
  return SplatFormat{fmt::format("SOG v{} ({})", is_numbered ? version->get<unsigned>() : 1, what)};
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
  if (is_ply(file)) return SplatFormat{"3DGS PLY", true};
  if (head.starts_with("NGSP") && head.size() >= 8) {
    std::uint32_t version = 0;
    std::memcpy(&version, head.data() + 4, sizeof version);
    return SplatFormat{fmt::format("SPZ v{}", version)};
  }
  if (head.starts_with("\x1F\x8B") && ending == ".spz") return SplatFormat{"SPZ v1 to v3"};
  if (head.starts_with("PK\x03\x04")) {
    const std::uint64_t size = file.size_bytes();
    const std::string directory =
        text_at(file, size - std::min(size, kZipDirectoryBytes), kZipDirectoryBytes);
    if (directory.find("meta.json") != std::string::npos &&
        directory.find("quats") != std::string::npos) {
      return SplatFormat{"SOG (bundled)"};
    }
  }
  return ending == ".json" ? sog_format(path, "its meta.json") : std::nullopt;
}

}  // namespace

std::optional<SplatFormat> splat_format(const std::string& path) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) return folder_format(path);
  const auto file = posix_file_system().open(path);
  if (auto marked = marked_format(*file, path)) return marked;
  if (text_at(*file, 0, 4) == "glTF") return std::nullopt;  // whatever its name
  // .splat and .ksplat begin with data; of the others what is left is damaged.
  constexpr std::array<std::pair<std::string_view, std::string_view>, 4> kEndings{
      {{".splat", ".splat"}, {".ksplat", ".ksplat"}, {".spz", "SPZ"}, {".sog", "SOG"}}};
  const std::string ending = lower_ending(path);
  if (ending == ".ply") return SplatFormat{"3DGS PLY", true};
  for (const auto& [own, name] : kEndings) {
    if (ending == own) return SplatFormat{std::string(name)};
  }
  return std::nullopt;
}

std::string why_not_read(const std::string& path, const SplatFormat& format) {
  const fs::path file(path);
  const fs::path named = file.filename().empty() ? file.parent_path() : file;  // "scene/"
  return fmt::format(
      "{}: a Gaussian splat scene in {}; pounce reads splat scenes from 3DGS PLY: convert it, for "
      "example with splat-transform {} {}.ply",
      path, format.name, path, named.stem().string());
}

}  // namespace pounce::io
