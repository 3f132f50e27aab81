// SPDX-License-Identifier: Apache-2.0
#include "flow/early_mesh.h"

#include <algorithm>
#include <exception>
#include <utility>

#include "core/input_file.h"
#include "job/run_job.h"

namespace pounce::flow {

EarlyMesh::EarlyMesh(job::JobContext& job, std::uint64_t others_bytes,
                     std::function<std::uint64_t(std::uint64_t most_bytes)> cost_bytes,
                     std::function<mesh::Mesh()> read) {
  // What is made of a mesh while it is planned, tangents above all, takes several times what
  // reading it takes; and the needs that are compared with limits meanwhile do not know of this
  // one. What is larger is not read early, nor is it waited for where the other one is refused.
  constexpr std::uint64_t kShare = 16, kMost = 512U << 20;
  const std::uint64_t most = std::min(job::bytes_at_once(job) / kShare, kMost);
  if (job.threads < 2 || others_bytes >= most) return;
  tasks_.run([this, &job, left = most - others_bytes, cost = std::move(cost_bytes),
              read = std::move(read)] {
    const SharesInputs inputs(job.inputs);
    try {
      if (cost(left) <= left) mesh_ = read();
    } catch (const std::exception&) {
      // It is read again when its turn comes, and says so then.
    }
  });
}

EarlyMesh::~EarlyMesh() {
  tasks_.cancel();  // if it has not begun
  tasks_.wait();
}

std::optional<mesh::Mesh> EarlyMesh::take() {
  tasks_.wait();
  return std::exchange(mesh_, std::nullopt);
}

}  // namespace pounce::flow
