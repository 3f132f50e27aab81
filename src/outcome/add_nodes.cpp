// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "outcome/target_tally.h"

namespace pounce::outcome {

void add_nodes(const std::vector<NodeReport>& page, std::vector<NodeReport>& all) {
  if (page.empty()) return;  // its results were known
  // Matched by their position.
  if (all.empty()) return void(all = page);
  for (std::size_t n = 0; n < all.size(); ++n) {
    all[n].runs += page[n].runs;
    all[n].busy_s += page[n].busy_s;
    all[n].stalls += page[n].stalls;
    all[n].stalled_s += page[n].stalled_s;
    all[n].bytes += page[n].bytes;
    all[n].most_waiting = std::max(all[n].most_waiting, page[n].most_waiting);
  }
}

}  // namespace pounce::outcome
