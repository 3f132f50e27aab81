// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tbb/flow_graph.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "pounce/error.h"
#include "runtime/pump.h"

namespace pounce::runtime {

/// Runs make(i) for every i in parallel and take(i, result) one at a time in order of i, with as
/// many results alive as the budget holds. costs[i] is the lease of work i from before make until
/// after take. Throws Error(budget), naming `what` it is for, if one work alone does not fit
/// (before anything is made, if that is known then), and whatever make or take throw.
template <class Result, class Make, class Take>
void run_ordered(MemoryBudget& budget, std::span<const std::uint64_t> costs,
                 const std::string& what, Make make, Take take) {
  namespace tf = tbb::flow;
  if (costs.empty()) return;
  { const Lease fits(budget, *std::max_element(costs.begin(), costs.end()), what); }

  struct Item {
    std::size_t index;
    std::optional<Result> result;
  };
  using ItemPtr = std::shared_ptr<Item>;
  std::size_t taken = 0;
  tf::graph graph;
  tf::function_node<std::size_t, ItemPtr> maker(graph, tf::unlimited, [&](std::size_t i) {
    return std::make_shared<Item>(Item{i, make(i)});
  });
  auto pump = Pump(budget, costs, what, [&](std::size_t i) { maker.try_put(i); });
  tf::sequencer_node<ItemPtr> in_order(graph, [](const ItemPtr& item) { return item->index; });
  tf::function_node<ItemPtr> taker(graph, tf::serial, [&](const ItemPtr& item) {
    take(item->index, *item->result);
    // Its memory goes before its lease does; the graph still holds the item itself.
    item->result.reset();
    ++taken;
    pump.release(item->index);
  });
  tf::make_edge(maker, in_order);
  tf::make_edge(in_order, taker);
  pump.admit();
  graph.wait_for_all();  // rethrows
  if (taken != costs.size())
    throw Error(ErrorKind::internal, "a flow graph ended early while it was to " + what);
}

}  // namespace pounce::runtime
