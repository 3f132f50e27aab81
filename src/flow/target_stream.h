// SPDX-License-Identifier: Apache-2.0
//
// What every projection shares, whatever its source is: the target cut into pieces, the graph that
// streams them, and the result blocks.
//
//   pump ─▶ read ─▶ search ─▶ blend ─▶ store
//             ▲                          ▼
//          target store               results (scratch)
//
// A piece is a few neighbouring target blocks of one page, cut so that its lease (its texels'
// state, its result, and room for what it reads of the source) is at most budget / (4 x threads).
#pragma once

#include <tbb/flow_graph.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "flow/job_context.h"
#include "flow/pump.h"
#include "pounce/error.h"
#include "target/target_block.h"
#include "texture/result_block.h"
#include "tiles/geometry_store.h"

namespace pounce::flow {

inline constexpr std::uint32_t kMostBlocksPerPiece = 8;

/// Neighbouring blocks of one target tile.
struct Piece {
  std::uint32_t page = 0, tile = 0, first = 0, count = 0;
};

/// The pieces of all pages, in the order of the pages, and what each costs.
struct PieceList {
  std::vector<Piece> pieces;
  std::vector<std::uint64_t> costs;  ///< bytes of a piece's lease

  std::uint64_t size_bytes() const { return pieces.size() * (sizeof(Piece) + sizeof(costs[0])); }
  /// The pieces of one page: [first, second).
  std::pair<std::size_t, std::size_t> of_page(std::uint32_t page) const;
};

/// A target cut for one projection under the budget.
struct CutTarget {
  PieceList pieces;
  std::uint64_t batch_bytes = 0;  ///< of a piece's lease: for the source blocks it searches at once
  Lease index;                    ///< of the list itself
};
/// Shares the budget out: beside `fixed`, half of a piece's share goes to a batch of source blocks
/// (at least `least_batch`), half to its texels' state, of which a block needs state_bytes(entry).
/// Throws Error(budget) if the largest piece does not fit.
CutTarget cut_target(JobContext& job, const tiles::GeometryStore& target, std::uint64_t fixed,
                     std::uint64_t least_batch,
                     const std::function<std::uint64_t(const tiles::BlockEntry&)>& state_bytes);

/// A piece on its way through the graph. A projection adds its own state.
struct PieceWork {
  std::size_t index = 0;
  std::vector<tiles::BlockEntry> blocks;
  /// [channel][block], encoded and compressed; empty: nothing covered.
  std::vector<std::vector<std::vector<std::byte>>> stored;
  std::vector<std::uint32_t> raw_bytes;  ///< [channel]
  std::vector<std::uint64_t> covered;    ///< [channel] texels
  DistanceCounts distances{};            ///< of all texels that found something
  std::vector<std::uint64_t> clipped;  ///< [channel]: samples beyond what the output's depth holds
};

/// Reads a piece's blocks into work.blocks and appends their packets to `packets` and `groups`.
/// `smallest_edge` and `start`: see TargetBlock.
void read_packets(JobContext& job, const tiles::GeometryStore& target, const Piece& piece,
                  float smallest_edge, target::TargetBlock::Start start, PieceWork& work,
                  PageVector<target::TexelPacket>& packets,
                  std::vector<target::PacketGroup>& groups);

/// Encodes and compresses a finished result block of channel `c` and block `b` into the work.
void finish_block(JobContext& job, const texture::TexelFormat& format,
                  const texture::ResultBlock& result, std::size_t c, std::size_t b,
                  PieceWork& work);

/// The results of one page.
struct PageResult {
  std::unique_ptr<tiles::PackReader> pack;  ///< scratch; empty when the page has no texels
  /// [channel][block_y * blocks_x + block_x]; raw_bytes == 0: nothing covered there.
  std::vector<std::vector<tiles::ChunkRef>> blocks;
  std::vector<std::uint64_t> covered;  ///< [channel] texels
  DistanceCounts distances{};          ///< of all texels that found something
  std::vector<std::uint64_t> clipped;  ///< [channel]
};

/// One source against one target. Not thread-safe; uses the job's threads.
class PageProjector {
 public:
  virtual ~PageProjector() = default;
  /// Projects the texels of one page of the target.
  virtual PageResult project(std::uint32_t page) = 0;
};

/// Collects the result blocks of one page, in any order, in a scratch pack. Not thread-safe.
class ResultCollector {
 public:
  ResultCollector(JobContext& job, const tiles::GeometryStore& target, const mesh::Lattice& page,
                  std::size_t channels);
  void store(const PieceWork& work);
  PageResult finish();
  /// Bytes of the index of a page's results.
  static std::uint64_t index_bytes(const mesh::Lattice& page, std::size_t channels);

 private:
  JobContext& job_;
  const tiles::GeometryStore& target_;
  std::uint32_t across_;
  Lease index_lease_;
  std::unique_ptr<tiles::PackWriter> writer_;
  PageResult result_;
};

/// Streams the pieces of one page: read(piece) makes a std::shared_ptr<Work> (Work derives from
/// PieceWork), search(Work&) and blend(Work&) run in parallel, the results are collected one at a
/// time. Throws whatever they throw.
template <class Work, class Read, class Search, class Blend>
PageResult stream_page(JobContext& job, const tiles::GeometryStore& target, const PieceList& list,
                       std::uint32_t page, std::size_t channels, Read read_piece,
                       Search search_piece, Blend blend_piece) {
  namespace tf = tbb::flow;
  ResultCollector results(job, target, target.directory().pages[page], channels);
  const auto [first, last] = list.of_page(page);
  const auto pieces = std::span(list.pieces).subspan(first, last - first);
  const auto costs = std::span(list.costs).subspan(first, last - first);
  using WorkPtr = std::shared_ptr<Work>;
  std::size_t stored = 0;
  tf::graph graph;
  tf::function_node<std::size_t, WorkPtr> read(graph, tf::unlimited, [&](std::size_t i) {
    WorkPtr work = read_piece(pieces[i]);
    work->index = i;
    return work;
  });
  tf::function_node<WorkPtr, WorkPtr> search(graph, tf::unlimited, [&](WorkPtr work) {
    search_piece(*work);
    return work;
  });
  tf::function_node<WorkPtr, WorkPtr> blend(graph, tf::unlimited, [&](WorkPtr work) {
    blend_piece(*work);
    return work;
  });
  auto pump = Pump(job.budget, costs, [&](std::size_t i) { read.try_put(i); });
  tf::function_node<WorkPtr> store(graph, tf::serial, [&](const WorkPtr& work) {
    results.store(*work);
    const std::size_t index = work->index;
    *work = Work{};  // its memory goes before its lease does; the graph still holds the object
    ++stored;
    pump.release(index);
  });
  tf::make_edge(read, search);
  tf::make_edge(search, blend);
  tf::make_edge(blend, store);
  pump.admit();
  graph.wait_for_all();  // rethrows
  if (stored != costs.size()) throw Error(ErrorKind::internal, "the projection graph ended early");
  return results.finish();
}

}  // namespace pounce::flow
