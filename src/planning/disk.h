// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "planning/plan.h"
#include "pounce/report.h"

namespace pounce::planning {

/// Room on disk, bounds from above: what a job would take if nothing compressed. Adds up a job from
/// its source and its targets.
class DiskPlan {
 public:
  /// `keeps`: stores go into the cache, which takes no more than `cache_limit_bytes` (0 = any),
  /// else into scratch files.
  DiskPlan(bool keeps, std::uint64_t cache_limit_bytes)
      : keeps_(keeps), cache_limit_bytes_(cache_limit_bytes) {}

  /// The tiles of a source image.
  void add_column(const io::ImageInfo& info);
  /// The same of an image that targets may see in smaller levels. `in_part`: some of its tiles may
  /// be kept first.
  void add_seen_column(const io::ImageInfo& info, bool in_part);
  /// The blocks of a mesh.
  void add_geometry(const surface::GeometryRequest& request);
  /// The hits of so many images of a map.
  void add_map(ImageSize size, std::uint64_t images);
  /// So many Gaussians, sorted; of a scene that may have to be unpacked.
  void add_splats(std::uint64_t splats, std::uint32_t lobes, std::uint64_t unpacked_bytes);
  /// What the levels of an image take until it is whole.
  using LevelsBytes = std::uint64_t (*)(const ImageOutput&, const shading::TexelFormat&);
  /// A target. `is_model`: its images pass through a scratch file into copies of its files.
  void add_target(const SourcePlan& plan, const TargetPlan& target, const mesh::Mesh& mesh,
                  bool is_model, LevelsBytes levels_bytes);
  DiskForecast forecast() const;
  /// Of a limit of scratch files (0 = none): what is left of it for encoded rows that are kept for
  /// a later run, beside all that this one needs.
  std::uint64_t spare_bytes(std::uint64_t limit_bytes) const;
  /// How much of the scratch files need not be compressed (store::PlainRoom), of a job with so much
  /// memory: none where a limit (0 = none), or that of a single file, is too little for all of them
  /// as they are.
  std::uint64_t plain_bytes(std::uint64_t limit_bytes, std::uint64_t largest_file_bytes,
                            std::uint64_t memory_bytes) const;

 private:
  /// A scene and a target, drawn from so many sides.
  void add_views(std::uint32_t count, const mesh::Mesh& target);
  /// What the texels of a page hit: one store more.
  void add_hits(const PassPlan& pass, const surface::GeometryRequest& target);

  std::uint64_t stores_ = 0;        ///< that stay until the job ends, or in the cache
  std::uint64_t small_levels_ = 0;  ///< of these, what is scratch even where stores are kept
  std::uint64_t beside_ = 0;        ///< the most of scratch files that one target has beside these
  std::uint64_t passing_ = 0;       ///< the most of other scratch files at one moment
  std::uint64_t needed_ = 0;        ///< the same without what is kept for a later run
  std::uint64_t outputs_ = 0;
  const bool keeps_;
  const std::uint64_t cache_limit_bytes_;
};

/// That scratch files may come to take more than they are allowed; empty = they cannot.
std::string scratch_note(const DiskForecast& disk);

}  // namespace pounce::planning
