// SPDX-License-Identifier: Apache-2.0
//
// Gaussians become a store of blocks, whatever they come from.
//
//   sample    a few from everywhere: where they are, how large they are
//   runs      consecutive ones are read, filtered, sorted and, if many, spilled; runs in parallel
//   merge     all runs at once, cut into blocks where neighbours are farthest apart; blocks are
//             encoded in parallel and written in order
//
// Whatever the budget, the sequence is that of one stable sort of the source's order by key, and
// the cuts depend on that sequence alone: so do the bytes of the store.
//
// A scene of any size passes through a budget that holds a fraction of it. Runs are as long as the
// budget allows, merges are as wide; both change the work, never the sequence. No block can be made
// before all runs are sorted, since any run may have Gaussians of any place.
#include "flow/stores/gaussian_store.h"

#include <fmt/format.h>
#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <utility>

#include "gaussian/gaussian_source.h"
#include "gaussian/splat_statistics.h"
#include "runtime/pump.h"
#include "sorting/block_cutter.h"
#include "sorting/block_encoder.h"
#include "sorting/splat_sort.h"
#include "store/blocks/splat_store.h"

namespace pounce::flow {
namespace {

using sorting::BlockCutter;
using sorting::EncodedBlock;
using sorting::KeyedSplat;
using sorting::SortedSplats;
using sorting::SplatMerge;
using sorting::SplatRun;
using sorting::SplatRuns;
using sorting::SplatRunWriter;
using store::Splat;
using store::SplatLattice;

constexpr std::uint64_t kLeastRun = 16 << 10, kMostRun = 4 << 20;
constexpr std::size_t kLeastFanIn = 16, kMostFanIn = 1024;

/// Per Gaussian of a run that is being made: the Gaussian, its harmonics, and twice its key.
constexpr std::uint64_t row_bytes(std::uint32_t lobes) {
  return sizeof(Splat) + store::lobe_bytes(lobes) + 2 * sizeof(KeyedSplat);
}

std::uint64_t run_bytes(std::uint64_t read_bytes, std::uint64_t splats, std::uint32_t lobes) {
  constexpr std::uint64_t kCounts = 64 << 10;  // of the sort's digits
  return read_bytes + SplatRunWriter::write_bytes(lobes) + kCounts +
         round_to_pages(splats * sizeof(Splat)) +
         round_to_pages(splats * store::lobe_bytes(lobes)) +
         2 * round_to_pages(splats * sizeof(KeyedSplat));
}

class StoreBuilder {
 public:
  StoreBuilder(job::JobContext& job, const GaussianStoreRequest& request)
      : job_(job), request_(request), source_(*request.source), lobes_(source_.lobes()) {}

  std::unique_ptr<store::SplatStore> build() {
    directory_.model = request_.facts.model;
    directory_.is_linear = request_.facts.is_linear;
    directory_.lobes = lobes_;
    const SplatLattice lattice = make_lattice();
    directory_.middle_box = lattice.middle_box();
    SplatRuns runs = make_runs(lattice);
    return merge(lattice, std::move(runs));
  }

 private:
  SplatLattice make_lattice();
  SplatRuns make_runs(const SplatLattice& lattice);
  SplatRun make_run(const SplatLattice& lattice, SplatRunWriter* writer, std::uint64_t first,
                    std::uint64_t rows, store::SplatCounts& filtered);
  std::optional<store::SplatFilter> prepare(const SplatLattice& lattice, store::SplatRows& rows,
                                            std::size_t i) const;
  std::unique_ptr<store::SplatStore> merge(const SplatLattice& lattice, SplatRuns runs);

  job::JobContext& job_;
  const GaussianStoreRequest& request_;
  const gaussian::GaussianSource& source_;
  const std::uint32_t lobes_;
  store::SplatDirectory directory_;
  runtime::Lease held_;  ///< of runs in memory
};

SplatLattice StoreBuilder::make_lattice() {
  const runtime::Lease lease(job_.budget,
                             gaussian::kept_sample_bytes(source_.count(), source_.read_bytes()),
                             "scanning " + request_.path);
  // Of what is wanted alone: floaters that are filtered anyway must not stretch the lattice.
  const PageVector<Splat> sample = gaussian::kept_sample(source_, request_.keep);
  directory_.roundness = gaussian::median_roundness(sample);
  directory_.typical_size = gaussian::median_size(sample);
  directory_.thickness = gaussian::quartile_thickness(sample);
  return SplatLattice(sample);
}

/// Without a writer the run stays in memory.
SplatRun StoreBuilder::make_run(const SplatLattice& lattice, SplatRunWriter* writer,
                                std::uint64_t first, std::uint64_t rows,
                                store::SplatCounts& filtered) {
  store::SplatRows read{lobes_, {}, {}};
  read.splats.reserve(rows);
  read.sh.reserve(rows * 3 * lobes_);
  source_.read(first, rows, read, filtered);
  PageVector<KeyedSplat> order, scratch;
  order.reserve(read.splats.size());
  for (std::size_t i = 0; i < read.splats.size(); ++i) {
    if (const auto reason = prepare(lattice, read, i)) {
      ++filtered[static_cast<std::size_t>(*reason)];
      continue;
    }
    // A key is that of the rounded Gaussian. The merge computes it again from what was spilled, and
    // both must agree.
    order.push_back({lattice.key(read.splats[i]), static_cast<std::uint32_t>(i)});
  }
  sorting::sort_by_key(order, scratch);
  if (writer != nullptr) return writer->write(read, order);
  const std::uint64_t kept = order.size();
  return {
      {}, std::make_shared<SortedSplats>(SortedSplats{std::move(read), std::move(order)}), kept};
}

/// Rounds Gaussian i, or says why it is left out. What the user wants is compared unrounded.
std::optional<store::SplatFilter> StoreBuilder::prepare(const SplatLattice& lattice,
                                                        store::SplatRows& rows,
                                                        std::size_t i) const {
  if (const auto reason = request_.keep.filter(rows.splats[i])) return reason;
  const std::size_t halves = std::size_t{3} * lobes_;
  if (!store::all_finite(std::span(rows.sh).subspan(i * halves, halves)))
    return store::SplatFilter::not_finite;
  store::round_for_store(rows.splats[i]);
  return lattice.filter(rows.splats[i]);
}

SplatRuns StoreBuilder::make_runs(const SplatLattice& lattice) {
  const std::uint64_t rows = source_.count();
  // As many runs at once as there are threads, and no longer than that leaves room for.
  const std::uint64_t room = (job_.budget.limit() - job_.budget.leased()) / job_.threads;
  const std::uint64_t fixed = run_bytes(source_.read_bytes(), 0, lobes_);
  // Long runs merge faster. An eighth of the share is left over, since buffers are rounded up to
  // pages.
  std::uint64_t run = room > fixed ? (room - fixed) * 7 / 8 / row_bytes(lobes_) : 0;
  run = std::clamp(run, kLeastRun, kMostRun);
  run = std::min(run, std::max(kLeastRun, (rows + job_.threads - 1) / job_.threads));
  if (request_.run_splats > 0) run = request_.run_splats;
  struct Made {
    SplatRun run;
    store::SplatCounts filtered{};
  };
  const std::uint64_t count = (rows + run - 1) / run;
  const std::uint64_t rest = job_.budget.limit() - job_.budget.leased(),
                      own = run_bytes(0, std::min(run, rows), lobes_),
                      held = count * (own - SplatRunWriter::write_bytes(lobes_));
  const std::vector<std::uint64_t> costs(count, source_.read_bytes() + own);
  // What is little of the budget stays in memory until it is merged.
  const bool is_little = held <= room / 4 && held + source_.read_bytes() + own <= rest;
  std::optional<SplatRunWriter> writer;
  if (is_little && count <= kLeastFanIn && request_.run_splats == 0 && request_.fan_in == 0)
    held_ = runtime::Lease(job_.budget, held, "sorting the Gaussians of " + request_.path);
  else
    writer.emplace(job_, lobes_);
  SplatRuns runs;
  runtime::run_ordered<Made>(
      job_.budget, costs, "sorting the Gaussians of " + request_.path,
      [&](std::size_t i) {
        const std::uint64_t first = i * run, here = std::min(run, rows - first);
        Made made;
        made.run = make_run(lattice, writer ? &*writer : nullptr, first, here, made.filtered);
        return made;
      },
      [&](std::size_t i, Made& made) {
        if (made.run.splats > 0) runs.runs.push_back(std::move(made.run));
        for (std::size_t k = 0; k < store::kSplatFilters; ++k)
          directory_.filtered[k] += made.filtered[k];
        job_.meter.advance(std::min(run, rows - i * run));
      });
  if (writer) runs.pack = writer->finish();
  return runs;
}

std::unique_ptr<store::SplatStore> StoreBuilder::merge(const SplatLattice& lattice,
                                                       SplatRuns runs) {
  const std::uint64_t total = std::max<std::uint64_t>(runs.splats(), 1);
  const runtime::Lease lists(job_.budget, runs.size_bytes(), "the places of sorted Gaussians");
  // Where little is left, the lease below says what is missing.
  const auto less = [](std::uint64_t a, std::uint64_t b) { return a > b ? a - b : 0; };
  const std::uint64_t room =
      less(job_.budget.limit(), job_.budget.leased() + BlockCutter::most_bytes(lobes_));
  // At most half of what is left goes to blocks on their way, up to two per thread, the rest to
  // cursors of the merge. With too few cursors there are more rounds of merging, each of which
  // reads and writes all.
  const std::uint64_t tokens = std::clamp<std::uint64_t>(
      room / 2 / EncodedBlock::most_bytes(lobes_), 1, 2 * static_cast<std::uint64_t>(job_.threads));
  const std::uint64_t cursors =
      less(room, tokens * EncodedBlock::most_bytes(lobes_)) / SplatMerge::cursor_bytes(lobes_);
  std::size_t fan_in = std::clamp<std::size_t>(cursors, kLeastFanIn, kMostFanIn);
  if (request_.fan_in > 0) fan_in = request_.fan_in;
  fan_in = std::min(fan_in, std::max<std::size_t>(runs.runs.size(), 1));
  const runtime::Lease lease(job_.budget,
                             BlockCutter::most_bytes(lobes_) +
                                 tokens * EncodedBlock::most_bytes(lobes_) +
                                 fan_in * SplatMerge::cursor_bytes(lobes_),
                             "merging the Gaussians of " + request_.path);
  runs = sorting::merge_to_fan_in(job_, lattice, lobes_, std::move(runs), fan_in);

  const bool fades = request_.fades == gaussian::FadeIsolated::of_all_scenes ||
                     (request_.fades == gaussian::FadeIsolated::of_made_scenes &&
                      gaussian::is_made(directory_.roundness, directory_.thickness));
  SplatMerge sequence(lattice, lobes_, runs.pack, runs.runs);
  BlockCutter cutter(sequence, lobes_);
  // The last stage ends blocks in order, so those under way are neighbours: each has its own slot.
  std::vector<EncodedBlock> slots;
  for (std::uint64_t i = 0; i < tokens; ++i) slots.emplace_back(lobes_);
  store::SplatStoreWriter writer(job_.stores->create(
      store::PackKind::splats, request_.key,
      fmt::format("{}, {} Gaussians", std::filesystem::path(request_.path).filename().string(),
                  source_.count())));
  sorting::BlockEstimate noise, sizes;
  std::uint64_t blocks = 0, done = 0;
  const auto write = [&](EncodedBlock& slot) {
    // A tile has one size class: a few large Gaussians would enlarge the box of a tile of small
    // ones, and pieces far away would read its index.
    const auto tile = writer.open_tile();
    if (!tile.empty() && (tile.size() == store::kMostBlocksPerSplatTile ||
                          slot.entry.size_class != tile.front().size_class)) {
      writer.end_tile(job_.compressor());
      ++job_.report.tiles_written;
    }
    writer.add_block(slot.entry, slot.stored, static_cast<std::uint32_t>(slot.raw.size()));
    directory_.has_normals |= !slot.block.normal[0].empty();
    noise.add(slot.cut.ordinal, slot.noise);
    sizes.add(slot.cut.ordinal, slot.sizes);
    blocks = slot.cut.ordinal + 1;
    done += slot.entry.splats;
    // In rows of the source, of which the filters may have left few: the bar counts each row twice.
    job_.meter.advance(source_.count() * done / total -
                       source_.count() * (done - slot.entry.splats) / total);
  };
  std::size_t next_slot = 0;
  tbb::parallel_pipeline(
      tokens,
      tbb::make_filter<void, EncodedBlock*>(tbb::filter_mode::serial_in_order,
                                            [&](tbb::flow_control& control) -> EncodedBlock* {
                                              EncodedBlock& slot = slots[next_slot++ % tokens];
                                              if (!cutter.next(slot.cut)) control.stop();
                                              return &slot;
                                            }) &
          tbb::make_filter<EncodedBlock*, EncodedBlock*>(
              tbb::filter_mode::parallel,
              [&](EncodedBlock* slot) {
                slot->encode(job_, {request_.are_points, fades});
                return slot;
              }) &
          tbb::make_filter<EncodedBlock*, void>(tbb::filter_mode::serial_in_order,
                                                [&](EncodedBlock* slot) { write(*slot); }));
  if (blocks == 0) {
    throw Error(ErrorKind::input,
                fmt::format("{}: none of its {} Gaussians can be used ({})", request_.path,
                            source_.count(), store::filtered_text(directory_.filtered)));
  }
  writer.end_tile(job_.compressor());
  ++job_.report.tiles_written;
  directory_.surface_noise = noise.median(blocks);
  if (request_.are_points) directory_.typical_size = sizes.median(blocks);
  return std::make_unique<store::SplatStore>(
      job_.stores->publish(writer.finish(directory_, job_.compressor())), request_.facts,
      job_.compressor());
}

}  // namespace

std::unique_ptr<store::SplatStore> build_gaussian_store(job::JobContext& job,
                                                        const GaussianStoreRequest& request) {
  return StoreBuilder(job, request).build();
}

std::uint64_t gaussian_store_least_bytes(std::uint64_t count, std::uint64_t read_bytes,
                                         std::uint32_t lobes) {
  const std::uint64_t lists = count / 1024 * 2 * sizeof(store::ChunkRef) +
                              count / kLeastRun * 2 * sizeof(SplatRun) + kPageBytes;
  return std::max({gaussian::kept_sample_bytes(count, read_bytes),
                   run_bytes(read_bytes, std::min(count, kLeastRun), lobes) + lists,
                   lists + BlockCutter::most_bytes(lobes) + EncodedBlock::most_bytes(lobes) +
                       kLeastFanIn * SplatMerge::cursor_bytes(lobes)}) +
         (64 << 10);
}

void report_filtered(job::JobContext& job, const store::SplatStore& store) {
  for (std::size_t k = 0; k < store::kSplatFilters; ++k) {
    const std::uint64_t count = store.directory().filtered[k];
    if (count > 0)
      job.report.source_filtered[store::filter_name(static_cast<store::SplatFilter>(k))] += count;
  }
}

runtime::Lease count_splat_store(job::JobContext& job, const store::SplatStore& store,
                                 bool cached) {
  if (cached) job.clock.set_cached("precondition");
  const store::SplatDirectory& directory = store.directory();
  job.report.source_gaussians = directory.splats;
  job.report.source_tiles = directory.tiles.size();
  job.count_store(store.pack(), cached);
  job.report.source_store_bytes += store.pack().size_bytes();
  return {job.budget, store.size_bytes(), "the directory of the source store"};
}

}  // namespace pounce::flow
