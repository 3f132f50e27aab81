// SPDX-License-Identifier: Apache-2.0
//
// The target's projection maps as images: vectorization alone.
//
// Position, normal and ownership of each texel, as a transfer would start from them. They are
// evaluated from the same kind of store that projection reads, so the maps show what the program
// works with, seams and overlaps included. The requests are exact: no block stores rounded records
// (docs/decisions/020-texel-records.md), so the stores of most transfers cannot be reused.
//
// One page after the other is vectorized and written. A page's three images are written one after
// the other, and each decodes all blocks again. That costs decoding three times, but a row of
// blocks of one image is all that is in memory.
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <optional>
#include <tuple>

#include "core/portable_math.h"
#include "flow/stores/build_stores.h"
#include "io/files/output_file.h"
#include "io/image/write.h"
#include "io/read_mesh.h"
#include "job/run_job.h"
#include "options/table.h"
#include "outcome/map_tally.h"
#include "planning/describe_job.h"
#include "planning/existing_outputs.h"
#include "planning/image_output.h"
#include "planning/job_hash.h"
#include "planning/load_mesh.h"
#include "planning/plan.h"
#include "pounce/transfer.h"
#include "surface/target_block.h"

namespace pounce {
namespace flow {
namespace {

using mesh::kBlockEdge;

using planning::kMapNames;
using planning::kMask;
constexpr double kVectorizeShare = 0.4;  // of a page

/// Where a block is, without its boxes.
struct BlockPlace {
  std::int32_t y = 0, x = 0;
  std::uint32_t triangles = 0, texels = 0;
  store::ChunkRef chunk;
};

class MapsJob {
 public:
  MapsJob(const MapsOptions& options, job::JobRun& run, bool rebuild)
      : options_(options),
        job_(open_job(options.resources, options.output, nullptr, rebuild, false, run)),
        job_hash_(*job_, options),
        output_(options) {
    job_->tile_cap_bytes = mesh::kTileCapBytes;
  }

  void run() {
    read();
    for (std::uint32_t page = 0; page < pages_.size(); ++page) {
      const std::vector<int> maps = maps_to_write(page);
      if (maps.empty()) continue;
      vectorize(page);
      if (output_.by_tile() && store_->directory().texels == 0) continue;
      write_page(page, maps);
      if (output_.by_tile()) job_->report.udims.push_back(static_cast<int>(pages_[page].udim));
    }
  }

 private:
  std::uint64_t reading_bytes() const {
    return io::mesh_cost(options_.target, {options_.allow_external, {}, true}, job_->budget.limit())
        .peak_bytes;
  }

  void read() {
    const StageTimer timer(job_->clock, "read");
    require_early(*job_, {reading_bytes(), "reading " + options_.target}, 0);
    planning::PlacedMesh placed = planning::place_mesh(options_.target, options_.target_use,
                                                       "target", options_.allow_external);
    target_ = std::move(placed.mesh);
    origin_ = placed.origin;
    job_->report.origin = {origin_.x, origin_.y, origin_.z};
    if (origin_ != Vec3d{}) {
      job_->report.notes = {planning::origin_note(options_.target, origin_),
                            planning::positions_note(origin_, Depth::float32)};
    }
    if (const std::string warning = planning::coarse_positions(target_, origin_, options_.size);
        !warning.empty())
      job_->report.warnings.push_back(warning);
    job_->report.warnings.insert(job_->report.warnings.end(), target_.warnings.begin(),
                                 target_.warnings.end());
    target_files_ = target_.files;
    for (const std::string& file : target_files_) planning::add_input(file, job_->report);
    planning::PageRequest request;
    request.by_tile = output_.by_tile();
    request.uv_set = options_.target_use.uv_set.value_or(0);
    const planning::TargetPages pages =
        planning::target_pages(target_, request, job_->report.warnings);
    pages_ = pages.pages;
    output_.plan(pages_);
    const auto hashes = std::make_shared<surface::MeshHashes>(target_);
    for (std::uint32_t p = 0; p < pages_.size(); ++p) {
      surface::GeometryRequest& one = requests_.emplace_back();
      one.mesh = &target_;
      one.hashes = hashes;
      one.is_target = true;
      one.exact = true;  // they are what a user asked for, not a step on the way
      one.pages.push_back({options_.size.width, options_.size.height, request.uv_set, {}});
      one.triangles = pages.triangles;
      one.first_page = p;
      if (output_.by_tile()) one.tile = mesh::udim_tile(pages_[p].udim);
    }
    require_least(*job_, least(), target_.size_bytes());
    mesh_lease_ = runtime::Lease(job_->budget, target_.size_bytes(), "the mesh");
    smallest_edge_ = static_cast<float>(std::max(planning::diagonal(target_) * 1e-7, 1e-30));
    tally_.emplace(options_, job_->report);
  }

  void vectorize(std::uint32_t page) {
    const StageTimer timer(job_->clock, "vectorize");
    const double done = page + kVectorizeShare;
    job_->meter.begin("vectorize", 0, "tiles", done / static_cast<double>(pages_.size()));
    bool cached = false;
    store_ = geometry_store(*job_, requests_[page], &cached);
    all_cached_ = all_cached_ && cached;
    if (all_cached_) job_->clock.set_cached("vectorize");
    if (page + 1 == pages_.size()) {
      target_ = {};
      mesh_lease_ = {};
    }
    const store::GeometryDirectory& directory = store_->directory();
    Report& report = job_->report;
    report.target_texels += directory.texels;
    report.target_covered += directory.texels;  // every texel of the charts has its map
    report.target_overlapping += directory.overlapping;
    report.target_tiles += directory.tiles.size();
    report.target_store_bytes += store_->pack().size_bytes();
    job_->count_store(store_->pack(), cached);
    TargetReport& entry = report.targets.back();
    entry.counts.texels += directory.texels;
    entry.counts.covered += directory.texels;
    entry.overlapping += directory.overlapping;
    job_->meter.end();
  }

  std::string job_of(std::uint32_t page, int map) {
    return job_hash_.of_map(target_files_, pages_[page], options_.size,
                            kMapNames[static_cast<std::size_t>(map)],
                            output_.path(pages_[page], map));
  }

  /// Of a page's maps those that this very job has not made before.
  std::vector<int> maps_to_write(std::uint32_t page) {
    std::vector<int> maps;
    for (int map = 0; map < 3; ++map) {
      const std::string path = output_.path(pages_[page], map);
      // What an attempt before this one wrote may come from a damaged pack.
      const bool stays = options_.keep_made && job_->run.written_before.count(path) == 0 &&
                         planning::is_made_by(path, [&] { return job_of(page, map); });
      if (stays) {
        io::remove_leftovers_of(path);
        tally_->keeps(pages_[page], path, map);
      } else {
        maps.push_back(map);
      }
    }
    return maps;
  }

  std::uint64_t row_bytes() const {
    // 64 rows of samples, and one decoded block per thread.
    return round_to_pages(std::uint64_t{kBlockEdge} * options_.size.width * 12) +
           job_->threads * (2ULL << 20);
  }

  std::uint64_t blocks() const {
    return (options_.size.width / kBlockEdge + 1ULL) * (options_.size.height / kBlockEdge + 1ULL);
  }

  job::LeastMemory least() const {
    std::uint64_t building = 0;
    for (const surface::GeometryRequest& request : requests_)
      building = std::max(building, surface::geometry_least_bytes(request, mesh::kTileCapBytes));
    building += target_.size_bytes();
    const std::uint64_t writing =
        (pages_.size() > 1 ? target_.size_bytes() : 0) + row_bytes() +
        2 * blocks() * sizeof(BlockPlace) +
        io::ImageWriter::encoder_bytes(output_.path(pages_.front(), 0), output_.specs().front());
    const std::uint64_t reading = reading_bytes();
    job::LeastMemory most{reading, "reading " + options_.target};
    if (building > most.bytes) most = {building, "vectorizing " + options_.target};
    if (writing > most.bytes) most = {writing, "writing " + output_.path(pages_.front(), 0)};
    most.bytes += job_->threads * store::Compressor::context_bytes();
    return most;
  }

  /// All blocks of the page at hand, in image order.
  std::vector<BlockPlace> places() {
    // The store has its blocks in tiles of a k-d split, an image needs them row by row. The list is
    // leased with the rows that are written.
    std::vector<BlockPlace> all;
    for (std::uint32_t tile = 0; tile < store_->directory().tiles.size(); ++tile) {
      for (const store::BlockEntry& entry : store_->read_index(tile, job_->compressor()))
        all.push_back({entry.y, entry.x, entry.triangles, entry.texels, entry.chunk});
    }
    std::sort(all.begin(), all.end(), [](const BlockPlace& a, const BlockPlace& b) {
      return std::tie(a.y, a.x) < std::tie(b.y, b.x);
    });
    // Two blocks at one place cannot come from pounce. They would be written by two threads at
    // once.
    const auto twice = std::adjacent_find(all.begin(), all.end(), [](const auto& a, const auto& b) {
      return a.y == b.y && a.x == b.x;
    });
    if (twice != all.end()) store_->damaged("duplicate block");
    return all;
  }

  void write_page(std::uint32_t page, const std::vector<int>& maps) {
    const StageTimer timer(job_->clock, "assemble");
    const runtime::Lease lease(job_->budget, row_bytes() + 2 * blocks() * sizeof(BlockPlace),
                               "writing the maps");
    const std::vector<BlockPlace> all = places();
    for (const int map : maps) write_map(page, map, all);
  }

  void write_map(std::uint32_t page, int map, const std::vector<BlockPlace>& all) {
    const auto m = static_cast<std::size_t>(map);
    const std::string path = output_.path(pages_[page], map);
    io::ImageWriteSpec spec = output_.specs()[m];
    spec.job = job_of(page, map);
    const double done = page + kVectorizeShare + (1 - kVectorizeShare) * (map + 1) / 3;
    job_->meter.begin(std::string("write ") + kMapNames[m], spec.height, "rows",
                      done / static_cast<double>(pages_.size()));
    io::ImageWriter writer(path, spec);
    const std::size_t texel = spec.channels * store::depth_bytes(spec.depth);
    std::size_t next = 0;
    for (std::uint32_t top = 0; top < spec.height; top += kBlockEdge) {
      const std::uint32_t count = std::min<std::uint32_t>(kBlockEdge, spec.height - top);
      // Blocks are in image order, so those of this row are next in the list. They do not overlap,
      // so threads fill the rows without a lock. What no block covers stays 0.
      PageVector<std::byte> rows(std::size_t{count} * spec.width * texel);
      std::size_t end = next;
      while (end < all.size() && all[end].y == static_cast<std::int32_t>(top / kBlockEdge)) ++end;
      tbb::parallel_for(next, end, [&](std::size_t i) { fill(all[i], map, spec, rows); });
      next = end;
      {
        const WorkTimer encoding(job_->clock, "encode");
        writer.write_rows(count, rows.data());
      }
      job_->meter.advance(count);
    }
    writer.commit();
    tally_->wrote(pages_[page], path, map, store_->directory().texels);
    job_->meter.end();
  }

  void fill(const BlockPlace& place, int map, const io::ImageWriteSpec& spec,
            PageVector<std::byte>& rows) {
    store::BlockEntry entry;
    entry.x = place.x;
    entry.y = place.y;
    entry.triangles = place.triangles;
    entry.texels = place.texels;
    entry.chunk = place.chunk;
    const surface::TargetBlock block(store_->read_block(entry, job_->compressor()),
                                     store_->directory().pages.front(), smallest_edge_);
    for (std::uint32_t t = 0; t < store::kTexelsPerBlock; ++t) {
      if (!block.covered(t)) continue;
      const std::size_t x = static_cast<std::size_t>(place.x) * kBlockEdge + t % kBlockEdge;
      std::byte* const at = rows.data() + (t / kBlockEdge * std::size_t{spec.width} + x) *
                                              spec.channels * store::depth_bytes(spec.depth);
      const surface::TargetBlock::Texel texel = block.texel(t);
      // A position is written in the file's coordinates. Where these have an origin, single
      // precision is coarse again, which a note has reported (planning::positions_note).
      const Vec3f v = map == 0 ? Vec3f(Vec3d(texel.position) + origin_) : texel.normal;
      const float samples[3] = {v.x, v.y, v.z};
      if (map != kMask) {
        std::memcpy(at, samples, sizeof samples);
      } else if (spec.depth == Depth::half) {
        const std::uint16_t one = float_to_half(1);
        std::memcpy(at, &one, sizeof one);
      } else {
        *at = static_cast<std::byte>(255);
      }
    }
  }

  const MapsOptions& options_;
  std::unique_ptr<job::JobContext> job_;
  planning::JobHash job_hash_;
  planning::MapsOutput output_;
  std::optional<outcome::MapTally> tally_;  ///< once the target is read
  std::vector<std::string> target_files_;
  std::vector<planning::TargetPage> pages_;
  mesh::Mesh target_;  ///< until its last page is vectorized
  Vec3d origin_;       ///< was subtracted from its positions
  runtime::Lease mesh_lease_;
  std::vector<surface::GeometryRequest> requests_;  ///< by page
  std::unique_ptr<store::GeometryStore> store_;     ///< of the page at hand
  bool all_cached_ = true;
  float smallest_edge_ = 0;
};

void check_options(const MapsOptions& o) {
  if (o.target.empty()) throw Error(ErrorKind::usage, "a target is required");
  options::check_ranges(o);
}

}  // namespace
}  // namespace flow

Report maps(const MapsOptions& options, Progress* progress, Report* so_far) {
  return job::run_job(options.resources, progress, so_far, [&](job::JobRun& run, bool rebuild) {
    planning::describe(options, run.report);
    flow::check_options(options);
    flow::MapsJob(options, run, rebuild).run();
  });
}

}  // namespace pounce
