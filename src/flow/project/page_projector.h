// SPDX-License-Identifier: Apache-2.0
//
// One source in front of one page of a target: the graph of a projection.
//
//                  ┌──────────────────────┐ as long as there is more of the source
//                  ▼                      │
//   pump ─▶ fetch ─┬─▶ bin ─▶ hit ────────┘
//             ▲    └─▶ blend ─▶ store
//      target and                 ▼
//      source stores           results (scratch)
//
// A piece of the target goes round: fetch reads the next source blocks that its texels may meet and
// decodes them, bin sorts them in space, hit tries them on the texels. When nothing is left, blend
// makes colours of what was found. Several pieces are under way at once, so that one waits for the
// disk while others compute. The best hit of a texel is a minimum and sums are integers, so batches
// may be cut anywhere and pieces may overtake each other.
//
// A piece's memory is leased by the pump before the piece is made, and released after its results
// were written. It belongs to one node at a time.
#pragma once

#include <tbb/flow_graph.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <iterator>
#include <memory>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "core/bounds.h"
#include "flow/project/pieces.h"
#include "flow/project/results.h"
#include "job/job_context.h"
#include "pounce/error.h"
#include "runtime/meter.h"
#include "runtime/pump.h"
#include "store/blocks/geometry_store.h"
#include "store/blocks/splat_store.h"

namespace pounce::flow {

/// One source against one page of a target. Not thread-safe; uses the job's threads.
class Projection {
 public:
  virtual ~Projection() = default;
  /// Makes what `results` do not have yet.
  virtual PageResult project(ResultCollector& results) = 0;
};

/// What differs from source to source is its `Method`, whose members are thread-safe for different
/// works:
///   struct Work                    derives from PieceWork
///   PieceSize kPieceSize           larger pieces are not faster
///   PieceSize piece_size() const   optional: in place of kPieceSize
///   uint64_t fixed_bytes() const, least_batch_bytes() const,
///   BlockCost state_cost(const BlockEntry&) const
///                                  of a piece: what it needs in any case, for the smallest batch
///                                  of source blocks, for the texels of one target block
///   void begin(Work&)              reads the piece's texels
///   uint64_t wanted_bytes(Work&, uint64_t most), void settle(Work&, uint64_t bytes)
///                                  where kPieceSize.settles: what a piece that has begun needs in
///                                  all, and what it got
///   uint64_t fetch(Work&)          reads the next batch of source blocks: its bytes; 0: no more
///   void bin(Work&), hit(Work&)
///   void blend(Work&)
///   void keep(const Work&)         optional: of finished works, one at a time
template <class Method>
class PageProjector final : public Projection {
 public:
  PageProjector(job::JobContext& job, const store::GeometryStore& target, Method method)
      : job_(job), target_(target), method_(std::move(method)) {}

  PageResult project(ResultCollector& results) override {
    PieceSize most = Method::kPieceSize;
    if constexpr (requires { method_.piece_size(); }) most = method_.piece_size();
    const CutTarget cut = cut_target(
        job_, target_, most, method_.fixed_bytes(), method_.least_batch_bytes(),
        [&](const store::BlockEntry& entry) { return method_.state_cost(entry); },
        [&](const store::BlockEntry& entry) { return results.has(entry); });
    stream(cut, results);
    PageResult result = results.finish();
    for (const runtime::NodeMeter* node : {&fetch_, &bin_, &hit_, &blend_, &store_})
      result.nodes.push_back(node->report());
    return result;
  }

 private:
  using Work = typename Method::Work;
  using WorkPtr = std::shared_ptr<Work>;

  void stream(const CutTarget& cut, ResultCollector& results) {
    namespace tf = tbb::flow;
    const std::span costs(cut.pieces.costs);
    std::size_t stored = 0;
    std::function<std::uint64_t(const Work&, std::uint64_t)> resize;
    tf::graph graph;
    using Fetch = tf::multifunction_node<WorkPtr, std::tuple<WorkPtr, WorkPtr>>;
    Fetch fetch(graph, tf::unlimited,
                [&](const WorkPtr& work, typename Fetch::output_ports_type& to) {
                  const bool more = fetch_.run([&] { return fetch_next(*work, cut, resize); });
                  (more ? bin_ : blend_).sent();
                  more ? std::get<0>(to).try_put(work) : std::get<1>(to).try_put(work);
                });
    tf::function_node<WorkPtr, WorkPtr> bin(graph, tf::unlimited, [&](const WorkPtr& work) {
      bin_.run([&] { method_.bin(*work); });
      hit_.sent();
      return work;
    });
    tf::function_node<WorkPtr, WorkPtr> hit(graph, tf::unlimited, [&](const WorkPtr& work) {
      hit_.run([&] { method_.hit(*work); });
      fetch_.sent();
      return work;
    });
    tf::function_node<WorkPtr, WorkPtr> blend(graph, tf::unlimited, [&](const WorkPtr& work) {
      blend_.run([&] { method_.blend(*work); });
      store_.sent();
      return work;
    });
    auto pump = runtime::Pump(
        job_.budget, costs, "projecting one block of the target",
        [&](std::size_t i) {
          auto work = std::make_shared<Work>();
          work->index = i;
          work->piece = cut.pieces.pieces[i];
          work->batch_bytes = cut.batch_bytes;
          fetch_.sent();
          fetch.try_put(work);
        },
        runtime::works_at_once(Method::kPieceSize.per_thread));
    resize = [&](const Work& work, std::uint64_t bytes) { return pump.resize(work.index, bytes); };
    tf::function_node<WorkPtr> store(graph, tf::serial, [&](const WorkPtr& work) {
      store_.run([&] {
        store_.add_bytes(results.store(*work));
        if constexpr (requires { method_.keep(*work); }) method_.keep(*work);
      });
      const std::size_t index = work->index;
      *work = Work{};  // its memory goes before its lease does; the graph still holds the object
      ++stored;
      pump.release(index);
    });
    tf::make_edge(tf::output_port<0>(fetch), bin);
    tf::make_edge(bin, hit);
    tf::make_edge(hit, fetch);
    tf::make_edge(tf::output_port<1>(fetch), blend);
    tf::make_edge(blend, store);
    pump.admit();
    graph.wait_for_all();  // rethrows
    fetch_.set_stalls(pump.stalls().count, pump.stalls().seconds);
    if (stored != costs.size())
      throw Error(ErrorKind::internal, "the projection graph ended early");
  }

  template <class Resize>
  bool fetch_next(Work& work, const CutTarget& cut, const Resize& resize) {
    if (!work.begun) {
      method_.begin(work);
      if constexpr (Method::kPieceSize.settles) {
        const std::uint64_t most =
            std::max(cut.pieces.costs[work.index] + cut.more_bytes, cut.share_bytes);
        method_.settle(work, resize(work, method_.wanted_bytes(work, most)));
      }
    }
    work.begun = true;
    const std::uint64_t bytes = method_.fetch(work);
    fetch_.add_bytes(bytes);
    return bytes > 0;
  }

  job::JobContext& job_;
  const store::GeometryStore& target_;
  Method method_;
  runtime::NodeMeter fetch_{"fetch"}, bin_{"bin"}, hit_{"hit"}, blend_{"blend"}, store_{"store"};
};

// --- the join ------------------------------------------------------------------------------------

inline bool meets(const store::BlockEntry& entry, const std::vector<Box3f>& boxes) {
  for (std::uint32_t i = 0; i < entry.box_count; ++i) {
    for (const Box3f& box : boxes) {
      if (entry.boxes[i].overlaps(box)) return true;
    }
  }
  return false;
}
inline bool meets(const store::SplatEntry& entry, const std::vector<Box3f>& boxes) {
  return std::any_of(boxes.begin(), boxes.end(),
                     [&](const Box3f& box) { return entry.box.overlaps(box); });
}

/// Goes through the blocks of a source that some of the boxes meet, in the order of the store: the
/// join. Holds one part of the index; the cache must outlive it. Not thread-safe.
template <class Cache>
class BlockWalk {
 public:
  using Entry = typename Cache::Entry;
  using Block = typename Cache::Block;

  BlockWalk(const Cache& cache, std::vector<Box3f> boxes)
      : cache_(&cache), boxes_(std::move(boxes)) {
    for (const Box3f& box : boxes_) all_.extend(box);
    find();
  }

  const Box3f& region() const { return all_; }  ///< holds all boxes
  const Entry* entry() const { return done() ? nullptr : &(*index_)[at_]; }
  bool done() const { return tile_ == tiles().size(); }
  void next() {
    ++at_;
    find();
  }

  /// Those of the boxes that meet this entry of the store.
  std::vector<Box3f> boxes_at(const Entry& entry) const {
    std::vector<Box3f> near;
    std::copy_if(boxes_.begin(), boxes_.end(), std::back_inserter(near),
                 [&](const Box3f& box) { return entry.box.overlaps(box); });
    return near;
  }

  /// The next blocks, decoded: as many as cost no more than `most_bytes`, at least one.
  template <class Cost>
  std::vector<std::shared_ptr<const Block>> take(std::uint64_t most_bytes, const Cost& cost) {
    std::vector<std::shared_ptr<const Block>> batch;
    std::uint64_t bytes = 0;
    for (; !done(); next()) {
      bytes += cost(*entry());
      if (!batch.empty() && bytes > most_bytes) break;
      batch.push_back(cache_->block(*entry()));
    }
    return batch;
  }

 private:
  const auto& tiles() const { return cache_->store().directory().tiles; }

  /// Stays, or goes on to the first entry from here that some box meets.
  void find() {
    for (;; ++at_) {
      while (index_ == nullptr || at_ == index_->size()) {
        if (index_ != nullptr) ++tile_;
        index_ = nullptr;
        at_ = 0;
        while (tile_ < tiles().size() && !tiles()[tile_].box.overlaps(all_)) ++tile_;
        if (done()) return;
        index_ = cache_->index(tile_);
      }
      if (meets((*index_)[at_], boxes_)) return;
    }
  }

  const Cache* cache_;
  std::vector<Box3f> boxes_;
  Box3f all_;
  std::shared_ptr<const typename Cache::Index> index_;
  std::uint32_t tile_ = 0;
  std::size_t at_ = 0;
};

}  // namespace pounce::flow
