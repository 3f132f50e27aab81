// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pounce/export.h"

namespace pounce {

/// Time spent in one stage of a job.
struct StageTime {
  std::string
      name;  ///< "decode", "precondition", "vectorize", "project", "assemble", "encode", ...
  double wall_s = 0;    ///< seconds between its start and end
  double cpu_s = 0;     ///< CPU seconds of all threads in it
  bool cached = false;  ///< its result came from the cache
};

/// An option that the job was given: what differs from its default.
struct OptionReport {
  std::string name;  ///< as on the command line, without dashes
  std::vector<std::string> values;
  bool is_list = false;  ///< may have several values
};

/// Texels of one image, or of several.
struct TexelCounts {
  std::uint64_t texels = 0;   ///< in the charts
  std::uint64_t covered = 0;  ///< of those: found a source
  std::uint64_t empty = 0;    ///< of those: found none
  std::uint64_t filled = 0;   ///< outside the charts: filled by padding
};

/// One image of a target.
struct ImageReport {
  std::string path;  ///< the file; of a model: the model
  std::string channel;
  std::string material;  ///< texture set; "default" where all materials share one
  int udim = 0;          ///< 0: the output has no tiles
  std::uint32_t width = 0, height = 0;
  /// "written"; "kept": up to date (skip_existing, keep_made), its counts are 0 unless it was
  /// painted over in place and only counted again; "empty": nothing was found and nothing written;
  /// "not written": found, but the job ended before its file was there.
  std::string state;
  TexelCounts counts;
};

/// Covered texels by how far away they found the source, in sixteenths of the maximum distance.
inline constexpr std::size_t kDistanceBins = 16;
using DistanceCounts = std::array<std::uint64_t, kDistanceBins>;

/// What one target got.
struct TargetReport {
  std::string path;
  /// Over its pages (material and UDIM tile), of the first channel of each that was not kept.
  TexelCounts counts;
  std::uint64_t overlapping = 0;  ///< texels that more than one triangle claims
  /// counts.texels over all texels of the same images, the charts' and those between them.
  double fill = 0;
  /// The edge of a square texel that covers as much surface as the target's do on average, in its
  /// units. Nothing where not all pages were made.
  std::optional<double> texel_size;
  double max_distance = 0;     ///< in the target's units
  DistanceCounts distances{};  ///< of the same texels
  /// Meshes, in the target's units: the mean of these texels' distances. Nothing where nothing was
  /// found.
  std::optional<double> mean_distance;
  /// Then: the part of the source's surface, 0..1, on which another layer of it that faces alike
  /// lies within twice that.
  std::optional<double> close_layers;
  /// 0..1. Splat scenes: does the scene lie at this target's surface? Below 0.5 it hardly does.
  /// Meshes: how near the source lies, over how near it would where the target is moved to fit
  /// best: 1 where no move is much better. Nothing where nothing was projected.
  std::optional<double> fit;
  /// With a fit, in the target's units: the median of the distances at which places of the target
  /// found the scene, positive outside, and how far from it nine in ten of them found it. Texels
  /// look there first.
  double scene_offset = 0, scene_spread = 0;
  std::vector<ImageReport> images;
  /// No channel is below TransferOptions::min_coverage_percent over its images that were not kept;
  /// false, too, where the job ended before that was known.
  bool enough = true;
};

/// One channel over all targets.
struct ChannelReport {
  std::string name;
  std::uint64_t images = 0;  ///< written
  TexelCounts counts;
};

/// A node of the graph that projects, over all pages (docs/architecture.md).
struct NodeReport {
  std::string name;                ///< "fetch", "bin", "hit", "blend", "store"
  std::uint64_t runs = 0;          ///< works that it did
  std::uint64_t most_waiting = 0;  ///< works that waited for it at one moment
  double busy_s = 0;               ///< summed over threads
  std::uint64_t stalls = 0;        ///< works that waited for memory before they came to it: "fetch"
  double stalled_s = 0;            ///< how long, all in all
  std::uint64_t bytes = 0;         ///< decoded by "fetch", written by "store"
};

/// Room on disk that a job may take, known before its work: bounds from above. What it really takes
/// depends on how well things compress.
struct DiskForecast {
  std::uint64_t scratch_bytes = 0;  ///< of scratch files, at one moment
  std::uint64_t cache_bytes = 0;    ///< added to the cache; 0 without one
  std::uint64_t output_bytes = 0;   ///< of all outputs
  /// What Resources::max_temp_bytes lets scratch files take, the default worked out; 0 = no limit.
  std::uint64_t scratch_limit_bytes = 0;
};

/// What a job that failed ended with.
struct Failure {
  std::string kind;     ///< error_kind_name()
  int exit_status = 0;  ///< of the program
  std::string message;
};

/// An image that an earlier run of the same job has begun: a later one goes on there.
struct HalfDoneImage {
  std::string path;  ///< of the first of the images that are made together
  std::uint64_t blocks = 0, texels = 0;
  std::uint64_t of_texels = 0;  ///< that there are
  double worked_s = 0;          ///< so far
  double left_s = 0;            ///< at that speed; what it takes to write the image is not in it
};

/// An image that cannot be assembled yet.
struct MissingImage {
  std::string path;
  std::uint64_t texels = 0, of_texels = 0;  ///< that are there; 0 of 0: nobody has begun
  std::vector<std::uint32_t> tasks;         ///< that have to make the rest
};

/// What a job did. Bytes and seconds throughout.
struct Report {
  std::string version;
  std::string command;
  std::optional<Failure> failure;     ///< nothing: the job succeeded
  std::vector<std::string> inputs;    ///< files that were read
  std::vector<OptionReport> options;  ///< that were given
  std::string isa;                    ///< instruction set of the kernels: "sse2", "avx2", "avx512"
  unsigned threads = 0;
  std::vector<StageTime> stages;
  std::vector<NodeReport> nodes;  ///< of the projection, in their order

  /// What was subtracted from all positions (scans at map coordinates, docs/decisions/042), else 0.
  std::array<double, 3> origin{};
  std::string method;  ///< of a transfer: "surface", "gaussian"; "" for the other commands
  std::string filter;  ///< of a mesh's surface: "tent", "cubic", "sharp"; else ""
  /// Of a mesh's texels as Gaussians: standard deviation in texels; 0: no such thing was made.
  double sigma_texels = 0;
  bool densify = false;  ///< and whether sparse ones were split
  std::uint64_t source_gaussians = 0;
  std::map<std::string, std::uint64_t> source_filtered;  ///< reason -> count
  /// Splats: sigma of the depth window that is averaged over, before half a texel bounds it;
  /// 0 for meshes.
  double depth_window = 0;
  /// Splats, 0..1: are the scene's Gaussians the discs of a surface (1), or needles, balls and
  /// tilted ellipsoids that make a picture together (0, captures)? Each kind is blended by its own
  /// rule. 0 for meshes.
  double discness = 0;
  /// How many sides a splat scene was looked at from; 0: along the texels' normals.
  std::uint32_t views = 0;
  /// Splats: the median of the Gaussians' largest standard deviations, in the target's units.
  double gaussian_size = 0;
  std::uint64_t images_decoded = 0;

  std::uint64_t target_texels = 0;       ///< texels of the target's charts, over all images
  std::uint64_t target_covered = 0;      ///< of those: found a source
  std::uint64_t target_filled = 0;       ///< outside the charts, filled by padding
  std::uint64_t target_empty = 0;        ///< of target_texels: found nothing
  std::uint64_t target_overlapping = 0;  ///< texels that more than one target triangle claimed
  /// Samples that the outputs' depth cannot hold (below 0 or above 1 in integers, beyond 65504 in
  /// half): cut to what it holds.
  std::uint64_t target_clipped = 0;
  std::vector<int> udims;               ///< UDIM numbers written
  std::vector<TargetReport> targets;    ///< in the order they were made
  std::vector<ChannelReport> channels;  ///< in the order of their channels

  std::uint64_t source_tiles = 0, target_tiles = 0, tiles_read = 0, tiles_written = 0;
  std::uint64_t bytes_read = 0, bytes_written = 0, temp_peak_bytes = 0;
  std::uint64_t source_store_bytes = 0, target_store_bytes = 0;
  std::uint64_t output_bytes = 0;         ///< of the files in `outputs`
  std::optional<DiskForecast> disk_most;  ///< of a transfer, once it is planned
  std::uint64_t memory_budget_bytes = 0, leased_peak_bytes = 0, peak_rss_bytes = 0;
  std::uint64_t least_memory_bytes = 0;  ///< the smallest budget that works for this job
  std::string least_memory_for;          ///< what needs so much: "writing skin.png"
  /// What the process takes of memory beside the budget: the program's and its libraries' data,
  /// threads, a margin (docs/decisions/045). A container or a scheduler must allow the sum.
  std::uint64_t memory_beside_bytes = 0;

  std::vector<std::string> warnings;
  /// What the inputs leave open, and how it was taken; what they have and is not transferred.
  std::vector<std::string> notes;
  std::vector<std::string> kept;  ///< outputs that were up to date (skip_existing, keep_made)
  std::vector<HalfDoneImage> half_done;  ///< of a plan
  /// Of a plan, roughly, by areas in UV space: what its texels take on one thread, stores aside.
  double work_s = 0;
  std::vector<MissingImage> missing;  ///< of TaskRole::assemble
  std::vector<std::string> outputs;   ///< files written; of a plan: that would be written
};

/// What a transfer would do and take.
struct PlanReport {
  std::uint64_t least_memory_bytes = 0;  ///< the smallest budget that works
  std::string least_memory_for;          ///< what needs so much: "writing skin.png"
  /// What the process takes beside its budget, measured here: a container or a scheduler must allow
  /// least_memory_bytes and this, with memory_budget_bytes at most that and this are used.
  std::uint64_t memory_beside_bytes = 0;
  std::uint64_t memory_budget_bytes = 0;  ///< what the job would have, the default worked out
  unsigned threads = 0;                   ///< so, too
  DiskForecast disk_most;
  std::vector<std::string> inputs;    ///< files that would be read
  std::vector<std::string> outputs;   ///< files that would be written
  std::vector<std::string> kept;      ///< outputs that are up to date (skip_existing, keep_made)
  std::vector<std::string> warnings;  ///< what the job would warn of before its work
  std::vector<HalfDoneImage> half_done;
};

/// A scene whose TargetReport::fit is below that hardly lies at its target: what fits less is
/// warned of and stays empty.
inline constexpr double kLeastFit = 0.5;

/// Why a Gaussian is left out: a key of Report::source_filtered, and the same in words, with the
/// option that decides it.
struct LeftOutReason {
  const char* key;
  const char* words;
};
/// All reasons that a splat scene's Gaussians have, those of options first.
POUNCE_API std::span<const LeftOutReason> left_out_reasons();

/// The report as JSON with the keys of docs/report.md. Ends with a newline.
POUNCE_API std::string to_json(const Report& report);

/// Writes it into a file, which appears whole or not at all, as outputs do: links stay, what is
/// replaced hands on its permissions, missing folders are made. Throws Error(storage).
POUNCE_API void save_report(const Report& report, const std::string& path);

}  // namespace pounce
