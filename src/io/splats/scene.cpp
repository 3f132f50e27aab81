// SPDX-License-Identifier: Apache-2.0
//
// What a file or a folder is, and the reader that it gets.
//
// A scene is told by its first bytes wherever its format has a mark, since names lie: downloads end
// in .zip, and a .ply may be a mesh. Formats without a mark (.splat, .ksplat) go by their ending,
// after all others. To be sure of a glTF its JSON has to be read, so it comes last and only for
// sources (source_splat_format): whoever wants a mesh does not pay for it.
//
// What is looked at here was checked by nobody. A PLY's header is at most 1 MiB, a meta.json is
// measured before it is parsed, of a ZIP's directory only the last 64 KiB are searched; of a gzip
// four bytes are unpacked. Of formats that are known but not read (streamed SOG, LCC) the name is
// told with a cure.
//
// Every reader supplies any range of rows at any time, in any thread. That is what lets the store
// be built by runs in parallel (sorting/splat_sort.h), and a sample be taken from all over a
// scene without reading it.
#include "io/splats/scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>

#include "core/file.h"
#include "core/input_file.h"
#include "io/files/asset_file.h"
#include "io/json/untrusted.h"
#include "io/splats/batch.h"
#include "io/splats/ply_scene.h"
#include "io/splats/point_scene.h"
#include "io/splats/spz_scene.h"
#include "io/splats/unpack.h"
#include "pounce/error.h"

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
  // No exceptions: what is no JSON is no SOG, and the next format is tried.
  const auto json = nlohmann::json::parse(text_at(*file, 0, kMostMetaBytes), nullptr, false);
  if (!json.is_object()) return std::nullopt;
  // Levels of detail have a tree of files; one whole SOG has four attributes in one meta.json.
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
    if (is_point_ply(file, path)) return SplatFormat{"point cloud PLY", SplatKind::point_ply};
    return SplatFormat{"3DGS PLY", SplatKind::ply};
  }
  // Version 4 begins with its mark; older ones are gzip, and their mark is inside.
  if (is_las(file)) return SplatFormat{"LAS", SplatKind::las};
  if (head.starts_with("NGSP") && head.size() >= 8) {
    std::uint32_t version = 0;
    std::memcpy(&version, head.data() + 4, sizeof version);
    return SplatFormat{fmt::format("SPZ v{}", version), SplatKind::spz};
  }
  if (is_spz(file) || (head.starts_with("\x1F\x8B") && ending == ".spz"))
    return SplatFormat{"SPZ v1 to v3", SplatKind::spz};
  // A ZIP is a SOG if it lists a meta.json. The search is for the name alone: what is wrong with
  // the archive is told when it is opened.
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

/// Captures take 12 to 15 bytes a Gaussian in the formats that compress (SPZ, SOG), and one that
/// repeats itself could take next to none: 7 KB would ask for 60 GiB of scratch.
constexpr std::uint64_t kLeastBytesPerSplat = 1;
/// Too few for harm: 60 MiB of scratch.
constexpr std::uint64_t kUnquestionedSplats = 1 << 18;

/// Throws Error(input) if a scene announces more Gaussians than its files can reasonably hold.
void require_plausible_count(const SplatSceneInfo& info) {
  // Asked after the scene is open, when all of its files are known: SOG has several.
  if (info.splats <= kUnquestionedSplats) return;
  std::uint64_t bytes = 0;
  for (const std::string& file : info.files) bytes += open_input(file)->size_bytes();
  if (info.splats <= bytes / kLeastBytesPerSplat) return;
  throw Error(ErrorKind::input,
              fmt::format("{}: states {} Gaussians in {} bytes, less than one byte per Gaussian; a "
                          "capture needs more than ten. If it is not damaged, convert it to PLY",
                          info.files.front(), info.splats, bytes));
}

std::unique_ptr<SplatScene> open_format(const std::string& path, const Axes& axes,
                                        const std::function<void()>& poll) {
  const auto format = source_splat_format(path);
  if (!format) {
    throw Error(ErrorKind::input, path +
                                      ": not a splat scene (PLY, SPZ, SOG, glTF with "
                                      "KHR_gaussian_splatting, .splat and .ksplat are supported)");
  }
  switch (format->kind) {
    case SplatKind::ply:
      return std::make_unique<SplatPly>(path, axes);
    case SplatKind::compressed_ply:
      return open_compressed_ply(path, axes);
    case SplatKind::point_ply:
      return open_point_ply(path, axes);
    case SplatKind::las:
      return open_las(path, axes);
    case SplatKind::spz:
      return std::make_unique<SpzScene>(open_input(path), path, axes, poll);
    case SplatKind::sog:
      return open_sog(path, axes);
    case SplatKind::gltf:
      return open_splat_gltf(path, axes, poll);
    case SplatKind::dot_splat:
      return open_dot_splat(path, axes);
    case SplatKind::ksplat:
      return open_ksplat(path, axes);
    case SplatKind::unread:
      break;
  }
  throw Error(ErrorKind::input, why_not_read(path, *format));
}

}  // namespace

std::optional<SplatFormat> splat_format(const std::string& path) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) return folder_format(path);
  const auto file = open_input(path);
  if (is_ply_mesh(*file, path)) return std::nullopt;
  if (auto marked = marked_format(*file, path)) return marked;
  if (text_at(*file, 0, 4) == "glTF") return std::nullopt;  // whatever its name
  // .splat and .ksplat begin with data; of the others what is left is damaged.
  struct Ending {
    std::string_view ending;
    const char* name;
    SplatKind kind;
  };
  // Endings of formats with a mark are here, too: a damaged file gets the message of its own
  // reader.
  constexpr std::array<Ending, 8> kEndings{{{".ply", "3DGS PLY", SplatKind::ply},
                                            {".las", "LAS", SplatKind::las},
                                            {".laz", "LAS", SplatKind::las},
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
      "{}: a Gaussian splat scene in {}, which is not supported; convert it to PLY, SPZ, SOG, "
      "glTF, .splat or .ksplat, for example with splat-transform {} {}.ply",
      path, format.name, path, named.stem().string());
}

std::unique_ptr<SplatScene> open_splat_scene(const std::string& path, const Axes& axes,
                                             const std::function<void()>& poll) {
  auto scene = open_format(path, axes, poll);
  require_plausible_count(scene->info());
  return scene;
}

PageVector<store::Splat> sample(const SplatScene& scene) {
  constexpr std::uint64_t kRowsPerSpot = 64, kSpots = kSampleSplats / kRowsPerSpot;
  const std::uint64_t rows = scene.info().splats;
  store::SplatRows read;
  read.splats.reserve(std::min(rows, kSampleSplats));
  store::SplatCounts ignored{};
  if (rows <= kSampleSplats) {
    scene.read(0, rows, read, ignored);
  } else {
    // Neighbours in a file often lie together, so 1,024 spots of 64 rows: enough to be even, few
    // enough to read. The product is split, since rows * i may not fit into 64 bits.
    for (std::uint64_t i = 0; i < kSpots; ++i)
      scene.read(rows / kSpots * i + rows % kSpots * i / kSpots, kRowsPerSpot, read, ignored);
  }
  return std::move(read.splats);
}

}  // namespace pounce::io
