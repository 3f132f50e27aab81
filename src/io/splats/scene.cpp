// SPDX-License-Identifier: Apache-2.0
#include "io/splats/scene.h"

#include <fmt/format.h>

#include "core/input_file.h"
#include "io/splats/compressed_ply.h"
#include "io/splats/dot_splat.h"
#include "io/splats/format.h"
#include "io/splats/gltf_scene.h"
#include "io/splats/ksplat.h"
#include "io/splats/ply.h"
#include "io/splats/sog.h"
#include "io/splats/spz.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

/// Captures take 12 to 15 bytes a Gaussian in the formats that compress (SPZ, SOG), and one that
/// repeats itself could take next to none: 7 KB would ask for 60 GiB of scratch.
constexpr std::uint64_t kLeastBytesPerSplat = 1;
/// Too few for harm: 60 MiB of scratch.
constexpr std::uint64_t kUnquestionedSplats = 1 << 18;

/// Throws Error(input) if a scene announces more Gaussians than its files can reasonably hold.
void require_plausible_count(const SplatSceneInfo& info) {
  if (info.splats <= kUnquestionedSplats) return;
  std::uint64_t bytes = 0;
  for (const std::string& file : info.files) bytes += open_input(file)->size_bytes();
  if (info.splats <= bytes / kLeastBytesPerSplat) return;
  throw Error(ErrorKind::input,
              fmt::format("{}: announces {} Gaussians in {} bytes, less than a byte for each; a "
                          "capture takes more than ten. If it is not damaged, convert it to PLY",
                          info.files.front(), info.splats, bytes));
}

std::unique_ptr<SplatScene> open_format(const std::string& path, const Axes& axes,
                                        const std::function<void()>& poll) {
  const auto format = source_splat_format(path);
  if (!format) {
    throw Error(ErrorKind::input,
                path +
                    ": no splat scene (PLY, SPZ, SOG, glTF with KHR_gaussian_splatting, .splat "
                    "and .ksplat are read)");
  }
  switch (format->kind) {
    case SplatKind::ply:
      return std::make_unique<SplatPly>(path, axes);
    case SplatKind::compressed_ply:
      return std::make_unique<CompressedPly>(path, axes);
    case SplatKind::spz:
      return std::make_unique<SpzScene>(open_input(path), path, axes, poll);
    case SplatKind::sog:
      return std::make_unique<SogScene>(path, axes);
    case SplatKind::gltf:
      return std::make_unique<GltfSplats>(path, axes, poll);
    case SplatKind::dot_splat:
      return std::make_unique<DotSplat>(path, axes);
    case SplatKind::ksplat:
      return std::make_unique<KsplatScene>(path, axes);
    case SplatKind::unread:
      break;
  }
  throw Error(ErrorKind::input, why_not_read(path, *format));
}

}  // namespace

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
    for (std::uint64_t i = 0; i < kSpots; ++i)
      scene.read(rows / kSpots * i + rows % kSpots * i / kSpots, kRowsPerSpot, read, ignored);
  }
  return std::move(read.splats);
}

}  // namespace pounce::io
