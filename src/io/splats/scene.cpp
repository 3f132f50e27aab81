// SPDX-License-Identifier: Apache-2.0
#include "io/splats/scene.h"

#include "io/splats/format.h"
#include "io/splats/ply.h"
#include "pounce/error.h"

namespace pounce::io {

std::unique_ptr<SplatScene> open_splat_scene(const std::string& path, const Axes& axes) {
  const auto format = splat_format(path);
  if (!format || format->is_read) return std::make_unique<SplatPly>(path, axes);
  throw Error(ErrorKind::input, why_not_read(path, *format));
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
