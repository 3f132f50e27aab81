// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/file.h"
#include "core/job_space.h"
#include "core/page_pool.h"
#include "core/vec.h"
#include "store/blocks/splat_block.h"
#include "store/blocks/splat_store.h"

namespace pounce::io {

/// How a Gaussian splat scene is stored.
enum class SplatKind {
  ply,
  compressed_ply,
  point_ply,
  las,
  spz,
  sog,
  gltf,
  dot_splat,
  ksplat,
  unread
};
struct SplatFormat {
  std::string name;  ///< "3DGS PLY", "SPZ v4", "SOG v2 (a folder)"
  SplatKind kind = SplatKind::unread;
  bool is_read() const { return kind != SplatKind::unread; }
};

/// What a file or folder holds, if that is a splat scene and nothing but one: by content, and by
/// its ending where the format has no mark of its own. So not of glTF, which may hold meshes, too.
/// Throws Error(storage) where there is nothing to read.
std::optional<SplatFormat> splat_format(const std::string& path);
/// The same, and glTF with Gaussians: what a source is.
std::optional<SplatFormat> source_splat_format(const std::string& path);

/// "room/lod-meta.json: a Gaussian splat scene in streamed SOG; pounce reads ...": for a scene that
/// is not read.
std::string why_not_read(const std::string& path, const SplatFormat& format);

/// What a scene's file says before its Gaussians are read.
struct SplatSceneInfo {
  std::string format;           ///< "3DGS PLY", "SPZ v3", "SOG v2 (bundled)", ...
  std::uint64_t splats = 0;     ///< in the file
  std::uint32_t sh_degree = 0;  ///< of the file, 0 to 4; read() gives no more than 3
  store::SplatModel model = store::SplatModel::standard;
  bool is_linear = false;   ///< colours are linear light, not sRGB-coded
  bool are_points = false;  ///< of a cloud: their sizes follow from their neighbours
  /// In the job's axes: what places are counted from (core/job_space.h, origin_for()); of clouds
  /// far from 0.
  Vec3d origin = {};
  std::vector<std::string> files;        ///< that hold it; the first is the one that was named
  std::vector<std::string> assumptions;  ///< what the format leaves open, for warnings: its axes
};

/// A trained scene in one of the formats there are: Gaussians in the file's order, of which any
/// range can be read. Memory does not grow with their number. Const members are thread-safe.
class SplatScene {
 public:
  virtual ~SplatScene() = default;
  const SplatSceneInfo& info() const { return info_; }

  /// To be called once before read() and sample(): formats in which a Gaussian cannot be found
  /// without all before it are unpacked into a scratch file of `folder`. Calls `poll` often; what
  /// it throws ends the work. Throws Error(input) for damaged files, Error(storage).
  virtual void prepare(const ScratchFolder& folder, const std::function<void()>& poll) = 0;
  /// What prepare() takes while it runs.
  virtual std::uint64_t prepare_bytes() const = 0;

  /// Room on disk that its scratch files take at most.
  virtual std::uint64_t unpacked_bytes() const = 0;

  /// Appends those of Gaussians [first, first + count) that can be used, in order, with
  /// `out.lobes` coefficients each (zeros beyond the file's degree), and counts the others by
  /// reason (all but SplatFilter::far, which needs to know the whole scene). Throws Error(input),
  /// Error(storage). Needs read_bytes() beside what it appends.
  virtual void read(std::uint64_t first, std::uint64_t count, store::SplatRows& out,
                    store::SplatCounts& filtered) const = 0;
  virtual std::uint64_t read_bytes() const = 0;

 protected:
  SplatSceneInfo info_;
};

/// Opens a scene: its format is found by content; reads headers only, but for an SPZ in gzip that
/// announces extensions, all of which is inflated. Calls `poll` often then; what it throws ends the
/// work. Throws Error(input) naming file, place and cure, Error(storage) where there is nothing to
/// read.
std::unique_ptr<SplatScene> open_splat_scene(
    const std::string& path, const Axes& axes, const std::function<void()>& poll = [] {});
/// What that takes beside what is read as JSON, and lets go again.
inline constexpr std::uint64_t kOpenSplatBytes = 256 << 10;

/// The usable Gaussians of up to 65,536 rows, taken evenly from the whole scene.
inline constexpr std::uint64_t kSampleSplats = 1 << 16;
PageVector<store::Splat> sample(const SplatScene& scene);

}  // namespace pounce::io
