// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace pounce {

/// Time spent in one stage of a job.
struct StageTime {
  std::string
      name;  ///< "decode", "precondition", "vectorize", "project", "assemble", "encode", ...
  double wall_s = 0;    ///< seconds between its start and end
  double cpu_s = 0;     ///< CPU seconds of all threads in it
  bool cached = false;  ///< its result came from the cache
};

/// What a job did. Bytes and seconds throughout.
struct Report {
  std::string version;
  std::string command;
  std::string isa;  ///< instruction set of the kernels: "sse2", "avx2", "avx512"
  unsigned threads = 0;
  std::vector<StageTime> stages;

  std::uint64_t source_gaussians = 0;
  std::map<std::string, std::uint64_t> source_filtered;  ///< reason -> count
  /// Splats: sigma of the depth window that is averaged over, before half a texel bounds it;
  /// 0 for meshes.
  double depth_window = 0;
  std::uint64_t images_decoded = 0;

  std::uint64_t target_texels = 0;       ///< texels of the target's charts, over all images
  std::uint64_t target_covered = 0;      ///< of those: found a source
  std::uint64_t target_filled = 0;       ///< outside the charts, filled by padding
  std::uint64_t target_empty = 0;        ///< of target_texels: found nothing
  std::uint64_t target_overlapping = 0;  ///< texels that more than one target triangle claimed
  std::vector<int> udims;                ///< UDIM numbers written

  std::uint64_t source_tiles = 0, target_tiles = 0, tiles_read = 0, tiles_written = 0;
  std::uint64_t bytes_read = 0, bytes_written = 0, temp_peak_bytes = 0;
  std::uint64_t source_store_bytes = 0, target_store_bytes = 0;
  std::uint64_t memory_budget_bytes = 0, leased_peak_bytes = 0, peak_rss_bytes = 0;
  std::uint64_t least_memory_bytes = 0;  ///< the smallest budget that works for this job

  std::vector<std::string> warnings;
  std::vector<std::string> kept;     ///< outputs that were up to date (skip_existing)
  std::vector<std::string> outputs;  ///< files written; with plan_only: files that would be written
};

/// The report as JSON with the keys of docs/report.md. Ends with a newline.
std::string to_json(const Report& report);

}  // namespace pounce
